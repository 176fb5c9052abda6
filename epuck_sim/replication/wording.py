"""Checks, effects and p-values in words."""

from epuck_sim.figures.labels import format_axis_values, key_name
from epuck_sim.replication.checks import Check, FormulaCheck, PairCheck, RatioCheck
from epuck_sim.replication.effects import Effect

LEAST_P = 1e-4
"""p-values below this are printed as such."""


def describe_check(check: Check) -> str:
    """Return what a test looks at."""
    if isinstance(check, FormulaCheck):
        return check.number.replace("_", " ")
    what = " ".join(filter(None, [check.take, check.of or "T_sync"]))
    names = {key: getattr(check, key) for key in ("place", "law", "than", "censored_at") if hasattr(check, key)}
    names |= {key: key_name(getattr(check, key)) for key in ("along", "over") if hasattr(check, key)}
    names |= {"what": what, "measure": check.of or "synchronised"}
    if isinstance(check, RatioCheck | PairCheck):
        names["first"], names["second"] = (format_axis_values({**check.where, **place}) for place in check.between)
        return NAMES[check.test].format(**names)
    name = NAMES[check.test].format(**names)
    return f"{name} where {format_axis_values(check.where)}" if check.where else name


NAMES = {
    "ratio": "{what} where {second}, over that where {first}",
    "superiority": "chance that {what} is larger where {second} than where {first}",
    "share_difference": "share {measure} where {second}, minus that where {first}",
    "level": "{what}",
    "share": "share {measure}",
    "largest_rise": "largest rise of {what} with {along}",
    "power_exponent": "power of {along} in {what}",
    "exponential_rate": "c of exp(c {along}) in {what}",
    "rank_trend": "rank correlation of {what} with {along}",
    "likelier": "nats a trial by which {law} distributions make {what} likelier than {than} ones",
    "weibull_ratio": "Weibull mean of {what}, censored at {censored_at:g}, over the mean",
    "place_exponent": "power of {over} in {place}",
    "collapse": "distance of curves of T_sync over {measure}, relative to that over {along}",
}
"""What each test finds."""


def describe_prediction(check: Check) -> str:
    """Return what the claim predicts of the effect.

    >>> describe_prediction(FormulaCheck(test="formula", number="sigma_a", above=2))
    'above 2'
    """
    low, high = check.predicted
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    return f"below {high:g}" if low is None else f"above {low:g}"


def describe_effect(effect: Effect) -> str:
    """Return an effect with its interval."""
    return str(effect.estimate)


def format_p(p_value: float) -> str:
    """Return a p-value in two digits.

    >>> format_p(0.0312), format_p(1e-9)
    ('0.031', '< 0.0001')
    """
    return f"{p_value:.2g}" if p_value >= LEAST_P else f"< {LEAST_P:.4f}"
