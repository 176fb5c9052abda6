"""Whether a form of figures fits a sweep; one that does not would be drawn blank, or mislead."""

from collections.abc import Sequence

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import require_model
from epuck_sim.statistics.measured import measure
from epuck_sim.statistics.names import Statistic


def require_particles(point: PointTrials) -> ParticleScenario:
    """Return the scenario of a point; raise ScenarioError for a model other than particles."""
    return require_model(point.scenario, ParticleScenario, "the forms perturbation and course need model: particles")


def check_has_values(points: Sequence[PointTrials], form: str) -> None:
    """Raise EpuckSimError if all trials are censored, or without a value, so that a map or violins would be blank."""
    if any(measure(point).observed.any() for point in points):
        return
    of = points[0].of
    if of is not None:
        raise EpuckSimError(f"no trial has a value of {of}, so that --form {form} would be blank")
    raise EpuckSimError(
        f"all trials are censored, so that --form {form} would be blank; raise stop.max_cycles, or draw --form curves, "
        "which marks where trials are censored"
    )


def check_statistic_of_map(statistic: Statistic) -> None:
    """Raise EpuckSimError for a statistic that few trials may dominate, which a map, without intervals, cannot show."""
    if statistic == Statistic.WEIBULL_MEAN:
        raise EpuckSimError(
            "--statistic weibull-mean is not for --form map: where trials are censored it is extrapolated from a few, "
            "and a map has no intervals to show that; allowed: mean, which is restricted there, and median"
        )


def check_deviates(points: Sequence[PointTrials]) -> None:
    """Raise EpuckSimError if no agent of any point can deviate from the undisturbed twin."""
    scenarios = [require_particles(point) for point in points]
    if not any(each.start.displacement > 0 or each.clocks.jitter > 0 for each in scenarios):
        raise EpuckSimError(
            "nothing deviates from the undisturbed twin, because start.displacement and clocks.jitter are 0, so that "
            "--form perturbation would be blank; --form course shows the order parameter"
        )
