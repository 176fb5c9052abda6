"""The site of the docs is built without a warning, and every link within it leads somewhere."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from typer.main import get_command

import epuck_sim
from epuck_sim.cli.app import app
from epuck_sim.cli.listing import list_names
from epuck_sim.measures.loader import SHIPPED
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import ParticleScenario
from tests.browsers import shown
from tests.tools import needs_browser

ROOT = Path(__file__).parent.parent


SPHINX = ("--fail-on-warning", "--keep-going", "--fresh-env", "--quiet")


class Page(HTMLParser):
    """The places and the links of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.places: set[str] = {""}
        self.links: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, _tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("id", "name") and value:
                self.places.add(value)
            elif name in ("href", "src") and value:
                self.links.add(value)


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    target = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", *SPHINX, "--doctree-dir", target / "doctrees", "docs", target / "html"]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return target / "html"


def test_every_link_within_the_site_leads_somewhere(site: Path) -> None:
    pages = {path: Page(path) for path in site.rglob("*.html")}
    assert {"index.html", "keys.html", "commands.html", "thesis.html", "particles.html"} <= {
        path.name for path in pages
    }
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert target.exists(), (path.name, link)
            if target in pages:
                assert unquote(parts.fragment) in pages[target].places, (path.name, link)


def test_pages_load_nothing_from_elsewhere(site: Path) -> None:
    for path in site.rglob("*.html"):
        far = [urlsplit(link) for link in Page(path).links if urlsplit(link).netloc]
        assert not [each for each in far if each.path.endswith((".js", ".css", ".png", ".svg"))], path.name


def words(page: Path) -> set[str]:
    """Return the words of a page, such as dotted keys and names of options."""
    return set(re.sub(r"<[^>]*>", "", page.read_text(encoding="utf-8")).split())


def test_the_reference_has_every_key(site: Path) -> None:
    keys = words(site / "keys.html")
    for model in (EmbodiedScenario, ParticleScenario):
        for name in model.model_fields.keys() - {"model"}:
            assert any(word == name or word.startswith(f"{name}.") for word in keys), name
    assert {"robots.N.camera.latency_ms", "arena.obstacles.N.radius_cm", "stop.when.relation"} <= keys


def test_the_reference_has_every_command_and_all_that_is_shipped_and_public(site: Path) -> None:
    commands = words(site / "commands.html")
    assert get_command(app).commands.keys() | {"--measure", "--statistic", "--threshold-ms"} <= commands
    shipped = {name for kind in list_names().values() for name in kind}
    assert shipped | SHIPPED.keys() <= words(site / "shipped.html")
    public = words(site / "api.html")
    assert all(any(word.startswith(f"epuck_sim.{name}") for word in public) for name in epuck_sim.__all__)


PROBE = """<script>
const problems = [];
addEventListener("error", event => problems.push(event.message || event.target.src || event.target.href), true);
addEventListener("load", () => document.documentElement.dataset.problems = problems.join(" ") || "none");
</script>"""


@needs_browser
@pytest.mark.parametrize("name", ["index", "gallery", "keys"])
def test_pages_open_without_an_error_or_a_missing_picture(name: str, site: Path, tmp_path: Path) -> None:
    page = site / f"{name}-probed.html"
    page.write_text((site / f"{name}.html").read_text(encoding="utf-8").replace("<head>", f"<head>{PROBE}", 1))
    assert 'data-problems="none"' in shown(page, tmp_path / "profile")


@needs_browser
def test_words_are_found(site: Path, tmp_path: Path) -> None:
    found = shown(site / "search.html", tmp_path / "profile", "?q=refractory")
    assert "keys.html" in found
