"""The figures, the table beside each, and the page about a run folder that shows them.

From Python, `plot` draws what `read_points` returns, also into Axes of matplotlib.
"""

import lazy_loader

# labels of tables come from this room, too: they must not wait for matplotlib; __init__.pyi lists the names
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
