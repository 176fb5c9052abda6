"""How Sphinx builds the site: `make docs`."""

import sys
from pathlib import Path

from epuck_sim import __version__

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "epuck-sim"
author = "The epuck-sim developers"
project_copyright = "2026, the epuck-sim developers"
release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "play", "reference"]
exclude_patterns = ["figures", "notebook.ipynb"]
myst_heading_anchors = 3
myst_enable_extensions = ["attrs_inline"]  # widths of pictures
smartquotes = False  # -- begins an option
default_role = "literal"  # in docstrings `name` is code, as in Markdown

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
maximum_signature_line_length = 88
napoleon_numpy_docstring = False

html_theme = "furo"
html_title = f"epuck-sim {release}"
html_copy_source = False
html_static_path = ["_static"]
html_css_files = ["site.css"]
