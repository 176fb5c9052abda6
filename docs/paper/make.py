"""Fill docs/paper/paper.md.in with the numbers of the tables in docs, and write docs/paper/paper.md."""

import csv
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from epuck_sim.util.messages import comma_list

HERE = Path(__file__).parent
DOCS = HERE.parent
VERDICTS = ("holds", "contradicted", "reading", "undecided", "not asked", "identity", "no claim")


def read_table(name: str) -> list[dict[str, str]]:
    """Return the rows of a CSV file in docs."""
    return list(csv.DictReader((DOCS / name).read_text(encoding="utf-8").splitlines()))


def count_verdicts() -> Iterator[tuple[str, str]]:
    """Yield numbers of claims by verdict, the table by chapter, and the sentences that are contradicted."""
    claims = read_table("replication.csv")
    counts = Counter(claim["verdict"] for claim in claims)
    yield "claims", str(len(claims))
    yield "decidable", str(len(claims) - counts["identity"] - counts["no claim"])
    for verdict in VERDICTS:
        yield verdict.replace(" ", "_"), str(counts[verdict])
    by_chapter = Counter((claim["section"].split(".")[0], claim["verdict"]) for claim in claims)
    chapters = sorted({chapter for chapter, _ in by_chapter})
    rows = [[chapter, *(str(by_chapter[chapter, verdict]) for verdict in VERDICTS)] for chapter in chapters]
    yield "verdict_names", " | ".join(VERDICTS)
    yield "rule", " --- |" * len(VERDICTS)
    yield "verdict_rows", "\n".join(f"| {' | '.join(row)} |" for row in rows)
    contradicted = (claim for claim in claims if claim["verdict"] == "contradicted")
    yield "contradicted_rows", "\n".join(f'- {claim["id"]}: "{claim["quote"]}"' for claim in contradicted)


def read_validation() -> Iterator[tuple[str, str]]:
    """Yield how many points are compared with other simulators, and with what result."""
    text = (DOCS / "validation.md").read_text(encoding="utf-8")
    (points,) = re.findall(r"(\d+) points are compared", text)
    yield "compared", points
    rows = re.findall(r"^\| ([^|]+), (?:Enki|C\+\+) \| \d+ of \d+ \| [^|]+ \| [^|]+ \| ([^|]+) \|", text, re.MULTILINE)
    yield "validation_rows", "ratios of mean T_sync: " + comma_list([f"{what} {ratio}" for what, ratio in rows])


def read_base_curve() -> Iterator[tuple[str, str]]:
    """Yield T_sync of the base case at its slowest and fastest speed, and at its minimum and peak between."""
    curve = [(float(row["mean_of_1000"]), row["speed_cm_s"]) for row in read_table("figures/base_curve.csv")]
    falling = next(place for place in range(len(curve)) if curve[place + 1] > curve[place])
    places = {"slow": curve[0], "low": curve[falling], "peak": max(curve[falling:]), "fast": curve[-1]}
    for name, (mean, speed) in places.items():
        yield f"base_{name}", f"{mean:.1f}"
        yield f"base_{name}_v", speed


def read_theory() -> Iterator[tuple[str, str]]:
    """Yield how often a prediction that decides is right where trials decide."""
    text = (DOCS / "figures" / "theory.txt").read_text(encoding="utf-8")
    ((right, of),) = re.findall(r"not predicted open: (\d+) of (\d+)", text)
    yield "theory_right", right
    yield "theory_of", of


def write_paper() -> str:
    """Return the text with its numbers."""
    template = (HERE / "paper.md.in").read_text(encoding="utf-8")
    numbers = dict([*count_verdicts(), *read_validation(), *read_base_curve(), *read_theory()])
    return template.format_map(numbers)


if __name__ == "__main__":
    (HERE / "paper.md").write_text(write_paper(), encoding="utf-8")
