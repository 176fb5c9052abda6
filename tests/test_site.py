"""The site of the docs: it is built without a warning, its links lead somewhere, and its reference has everything."""

import re
import subprocess
import sys
from html import unescape
from importlib import import_module
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from typer.main import get_command

import epuck_sim
from epuck_sim.cli.app import app
from epuck_sim.cli.listing import list_names
from epuck_sim.measures.measure import SHIPPED
from epuck_sim.scenario.loader import load_scenario
from tests.browsers import Driven
from tests.tools import needs_browser

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    target = tmp_path_factory.mktemp("site")
    options = ("--fail-on-warning", "--keep-going", "--fresh-env", "--quiet", "--doctree-dir", target / "doctrees")
    command = [sys.executable, "-m", "sphinx", *options, "docs", target / "html"]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return target / "html"


def words(text: str) -> set[str]:
    """Return the words of Markdown, such as dotted keys and names of options."""
    return set(re.sub(r"[`|*(),]", " ", text).split())


def test_the_reference_has_every_key_every_command_and_all_that_is_shipped(monkeypatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs/_ext")
    keys = import_module("scenario_keys").write_scenario_keys()
    for model in ("embodied", "particles"):
        for section, inner in load_scenario({"model": model}).model_dump().items():
            names = [f"{section}.{key}" for key in inner] if isinstance(inner, dict) else [section]
            assert [name for name in names if f"`{name}" not in keys] == []
    assert {"robots.N.camera.latency_ms", "arena.obstacles.N.radius_cm", "stop.when.relation"} <= words(keys)
    commands = words(import_module("command_line").write_commands())
    assert get_command(app).commands.keys() | {"--measure", "--statistic", "--threshold-ms"} <= commands
    module = import_module("shipped")
    shipped = words("".join(map(module.write, module.KINDS)))
    assert {name for kind in list_names().values() for name in kind} | SHIPPED.keys() <= shipped


@pytest.mark.slow
def test_every_link_within_the_site_leads_somewhere_and_pages_load_nothing_from_elsewhere(site: Path) -> None:
    texts = {path: unescape(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    pages = {path: {"", *re.findall(r'\s(?:id|name)="([^"]+)"', text)} for path, text in texts.items()}
    names = {path.name for path in pages}
    assert {"index.html", "keys.html", "commands.html", "thesis.html", "particles.html"} <= names
    for path, text in texts.items():
        for link in set(re.findall(r'\s(?:href|src)="([^"]+)"', text)):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                assert not parts.netloc or not parts.path.endswith((".js", ".css", ".png", ".svg")), (path.name, link)
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert target.exists(), (path.name, link)
            if target in pages:
                assert unquote(parts.fragment) in pages[target], (path.name, link)
    public = set(re.sub(r"<[^>]*>", "", (site / "api.html").read_text(encoding="utf-8")).split())
    assert all(any(word.startswith(f"epuck_sim.{name}") for word in public) for name in epuck_sim.__all__)


@needs_browser
@pytest.mark.slow
def test_pages_open_without_an_error_or_a_missing_picture_and_words_are_found(site: Path, tmp_path: Path) -> None:
    browser = Driven(tmp_path / "profile")
    for name in ("index", "gallery", "keys"):
        is_there = f"location.pathname.endsWith('{name}.html') && document.readyState === 'complete'"
        browser.open((site / f"{name}.html").as_uri(), is_there)
    assert [said for said in browser.said if not said.startswith("asks for")] == []
    found = "document.querySelector('#search-results a[href*=\"keys.html\"]') !== null"
    browser.open(f"{(site / 'search.html').as_uri()}?q=refractory", found)
    browser.close()
