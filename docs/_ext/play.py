"""Shows scenarios as pages on which they run: the directive `play`, with a scenario's name."""

from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

from epuck_sim.page.writer import write_page

FOLDER = "_static/play"  # where the pages lie in the site


class Play(Directive):  # type: ignore[misc]
    """A frame with a page, which is made with the site."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the frame."""
        environment = self.state.document.settings.env
        (name,) = self.arguments
        path = Path(environment.app.outdir) / FOLDER / f"{name}.html"
        if environment.app.builder.format != "html":
            return []
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            write_page(name, path)
        up = "../" * environment.docname.count("/")
        frame = f'<iframe src="{up}{FOLDER}/{name}.html" title="{name}, to play with" loading="lazy"'
        return [nodes.raw("", f'{frame} style="width:100%;height:62em;border:0"></iframe>', format="html")]


def setup(app: Sphinx) -> dict[str, Any]:
    """Add the directive."""
    app.add_directive("play", Play)
    return {"parallel_read_safe": False}
