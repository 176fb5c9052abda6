"""Checks, effects and p-values in words."""

from epuck_sim.display.numbers import format_estimate
from epuck_sim.figures.labels import format_axis_values, key_name
from epuck_sim.replication.checks import (
    Check,
    CollapseCheck,
    FormulaCheck,
    LevelCheck,
    LikelierCheck,
    PlaceCheck,
    PowerCheck,
    RateCheck,
    RatioCheck,
    RiseCheck,
    ShareCheck,
    SuperiorityCheck,
    TrendCheck,
)
from epuck_sim.replication.effects import Effect
from epuck_sim.statistics.summary import finite_or_none

LEAST_P = 1e-4
"""p-values below this are printed as such."""


def describe_check(check: Check) -> str:
    """Return what a test looks at."""
    if isinstance(check, FormulaCheck):
        return check.number.replace("_", " ")
    what = " ".join(filter(None, [check.take, check.of or "T_sync"]))
    if isinstance(check, RatioCheck | SuperiorityCheck):
        first, second = (format_axis_values({**check.where, **place}) for place in check.between)
        if isinstance(check, RatioCheck):
            return f"{what} where {second}, over that where {first}"
        return f"chance that {what} is larger where {second} than where {first}"
    axes = {key: key_name(getattr(check, key)) for key in ("along", "over") if hasattr(check, key)}
    name = NAMES[type(check)].format(check=check, what=what, measure=check.of or "synchronised", **axes)
    return f"{name} where {format_axis_values(check.where)}" if check.where else name


NAMES: dict[type[Check], str] = {
    LevelCheck: "{what}",
    ShareCheck: "share {measure}",
    RiseCheck: "largest rise of {what} with {along}",
    PowerCheck: "power of {along} in {what}",
    RateCheck: "c of exp(c {along}) in {what}",
    TrendCheck: "rank correlation of {what} with {along}",
    LikelierCheck: "nats a trial by which {check.law} distributions make {what} likelier than {check.than} ones",
    PlaceCheck: "power of {over} in {check.place}",
    CollapseCheck: "distance of curves of T_sync over {measure}, relative to that over {along}",
}
"""What tests of one place look at."""


def describe_prediction(check: Check) -> str:
    """Return what the claim predicts of the effect.

    >>> describe_prediction(FormulaCheck(test="formula", number="sigma_a", above=2))
    'above 2'
    """
    if check.above is not None:
        return f"above {check.above:g}"
    if check.below is not None:
        return f"below {check.below:g}"
    assert check.within is not None
    return f"{check.within[0]:g} to {check.within[1]:g}"


def describe_effect(effect: Effect) -> str:
    """Return an effect with its interval."""
    value, low, high = map(finite_or_none, effect.estimate)
    return format_estimate(value, low, high)


def format_p(p_value: float) -> str:
    """Return a p-value in two digits.

    >>> format_p(0.0312), format_p(1e-9)
    ('0.031', '< 0.0001')
    """
    return f"{p_value:.2g}" if p_value >= LEAST_P else f"< {LEAST_P:.4f}"
