"""The text for ReScience C holds the numbers of the docs' tables, and is as short as the journal wants it."""

import yaml

from docs.paper.make import HERE, write_paper


def test_the_paper_has_the_numbers_of_the_tables_is_short_and_its_metadata_has_its_title() -> None:
    text = (HERE / "paper.md").read_text(encoding="utf-8")
    assert text == write_paper(), "run `python -m docs.paper.make`"
    assert len(text.split()) <= 2500
    metadata = yaml.safe_load((HERE / "metadata.yaml").read_text(encoding="utf-8"))
    assert text.startswith(f"# {metadata['title']}\n")
