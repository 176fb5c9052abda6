"""The figures, the table beside each, and the page about a run folder that shows them.

From Python, `plot` draws what `read_points` returns, also into Axes of matplotlib.
"""

import lazy_loader

from epuck_sim.errors import extras_named

# labels of tables come from this room, too: they must not wait for matplotlib; __init__.pyi lists the names
_find, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__getattr__ = extras_named()(_find)
