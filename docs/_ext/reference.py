"""Directives that write the reference while the site is built: keys, commands, what is shipped."""

from collections.abc import Callable
from functools import partial
from pathlib import PurePath

import shipped
from command_line import write_commands
from docutils import nodes
from scenario_keys import write_scenario_keys
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata

import epuck_sim

PAGES_OF_FILES = {"README": "index", "CHANGELOG": "changes", "CONTRIBUTING": "contributing"}
"""Pages that show files from outside the folder of the docs, by the names of these files."""


def _directive(write: Callable[[], str]) -> type[SphinxDirective]:
    """Return a directive in whose place stands what a function writes as Markdown."""

    class Generated(SphinxDirective):
        def run(self) -> list[nodes.Node]:
            return self.parse_text_to_nodes(write(), allow_section_headings=True)

    return Generated


def _link_pages_of_files(_: Sphinx, page: nodes.document) -> None:
    """Lead links to files outside the folder of the docs to the pages that show them."""
    for link in page.findall(pending_xref):
        shown = PAGES_OF_FILES.get(PurePath(link["reftarget"]).stem)
        if shown is not None:
            link["refdomain"], link["reftarget"] = "doc", shown
            link.setdefault("reftargetid", None)


def setup(app: Sphinx) -> ExtensionMetadata:
    """Register the directives with Sphinx."""
    app.add_directive("scenario-keys", _directive(write_scenario_keys))
    app.add_directive("commands", _directive(write_commands))
    for kind in shipped.KINDS:
        app.add_directive(f"shipped-{kind}", _directive(partial(shipped.write, kind)))
    app.connect("doctree-read", _link_pages_of_files)
    return {"version": epuck_sim.__version__, "parallel_read_safe": True}
