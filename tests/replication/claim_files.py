"""What the tests of the command share: files of claims with tiny sweeps."""

from pathlib import Path

from epuck_sim.util.yaml_io import write_yaml
from tests.cli.commands import call

SPEED = "agents.speed_cm_s"

SWEEP = {  # agents that all hear all: with a strong coupling they are several times as fast, whatever their speed
    "scenario": "particles",
    "keys": {
        "trials": 12,
        "stop": {"max_cycles": 500},
        "neighbourhood": {"k": 3},
        "agents": {"count": 4},
        "sweep": {"grid": {"response.coupling": [0.05, 0.4], SPEED: [1, 10, 100]}},
        "figure": {"panels": "response.coupling"},
    },
}

FASTER = {"test": "ratio", "between": [{"response.coupling": 0.05}, {"response.coupling": 0.4}], "where": {SPEED: 1}}
OURS = {"reading": "the margin", "changed": "The margin.", "quantifier": "far", "source": "Doe (2009)"}


def claim(name: str, *checks: dict, **keys) -> dict:
    """Return a claim on the sweep of this module."""
    said = {"section": "9", "claim": f"Claim {name}", "quote": f"Sentence {name}", "line": 7}
    return {"id": name, **said, "sweep": "tiny", "checks": list(checks), **keys}


RISE = {"test": "largest_rise", "along": SPEED, "where": {"response.coupling": 0.4}, "within": [0.999, 1.001]}
EVERY_VERDICT = [  # claims with each of the verdicts, and one that needs no trials
    claim("A1", {**FASTER, "below": 1}),
    claim("A2", {**FASTER, "above": 1}, otherwise="Slower ones | of another kind."),
    claim("A3", RISE),
    {"id": "A4", "section": "9", "claim": "Claim A4", "not_asked": "It takes 900 CPU hours."},
    {**claim("A5", {"test": "formula", "number": "sigma_a", "within": [0.2, 0.3]}), "sweep": None},
    {**claim("A6", {"test": "formula", "number": "sigma_b", "above": 2}, identity="A definition"), "sweep": None},
    claim("A7", {**FASTER, "rises": True}, **OURS),
    {"id": "A8", "section": "9", "claim": "Claim A8", "no_claim": "An open question"},
]


def write_claims(folder: Path, claims: list[dict] = EVERY_VERDICT, sweep: dict = SWEEP) -> Path:
    path = folder / "claims.yaml"
    more = {"seed": 5, "pooled": "Seed 5 alone counts.", "notes": ["A misprint."]}
    path.write_text(write_yaml({**more, "sweeps": {"tiny": sweep}, "claims": claims}))
    return path


def replicate(file: Path, folder: Path, *words: object, code: int = 0):
    result = call("replicate", *words, "--claims", file, "--out", folder, "--workers", 1)
    assert result.exit_code == code, result.stderr
    return result
