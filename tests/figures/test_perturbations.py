"""Claims about maps of a perturbation: which trials they show, that colours hold the deviations, and zero is blank."""

from io import BytesIO

import numpy as np
import pytest
from matplotlib import colormaps, image
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, to_hex
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.forms import twins
from epuck_sim.figures.forms.form import Choices
from epuck_sim.figures.forms.twins import MIN_DEVIATION, Deviations, Perturbation
from epuck_sim.figures.saving import Table
from epuck_sim.particles.twin import simulate_with_twin
from epuck_sim.scenario.axes import FigureSection
from epuck_sim.scenario.points import points
from tests.figures.drawn import laid_out, written
from tests.runs.made_folders import censored, ended, in_memory, six_digits, sweep

SPEED, COUPLING = "agents.speed_cm_s", "response.coupling"


def particles(grid: dict, cycles: int = 12, **changes):
    """Return the scenario of a sweep of a few agents, one of which is displaced."""
    sections = {
        "agents": {"count": 5},
        "start": {"phases": "synchronised", "displacement": 0.01},
        "stop": {"order_parameter": None, "max_cycles": cycles},
        **changes,
    }
    return sweep(grid, trials=2, name="map", model="particles", **sections)


def never(point):
    return censored(point, point.scenario.trials)


def read_perturbations(points) -> list[Deviations]:
    return list(Perturbation.read(points, Choices(FigureSection())).shown)


def draw_perturbations(shown: list[Deviations]) -> Figure:
    return Perturbation(shown=shown).draw_figure()


def perturbations_table(shown: list[Deviations]) -> Table:
    return Perturbation(shown=shown).tables[".csv"]


SCENARIO = particles({SPEED: [3, 30, 90]})
READ = read_perturbations(in_memory(SCENARIO, never))


def made(deviation, **axes) -> Deviations:
    """Return a perturbation, (moments, agents), that no trial had."""
    values = np.array(deviation, float)
    return Deviations(axes, np.arange(0.5, len(values)), values)


# What is read


def test_what_is_read_is_trial_0_of_each_point_with_the_seed_it_has_in_the_sweep() -> None:
    for read, point in zip(READ, points(SCENARIO), strict=True):
        assert read.axes == point.axes
        assert read.cycle.tolist() == np.arange(0.5, 12).tolist()
        course = simulate_with_twin(point.scenario, point.seed(0), read.cycle)
        np.testing.assert_array_equal(read.deviation, course.deviation)
        assert read.deviation.shape == (12, 5)
        assert (read.deviation > 0).any()


def test_of_a_point_without_its_trial_0_the_first_is_read_that_has_a_result_and_of_one_without_any_none() -> None:
    trials = {3: 1, 30: 0, 90: 0}
    found = in_memory(SCENARIO, lambda point: ended([12] * trials[point.axes[SPEED]]))
    point = points(SCENARIO)[0]
    (read,) = read_perturbations([found[0]._replace(seeds=(point.seed(1),)), *found[1:]])
    assert read.axes == {SPEED: 3}
    np.testing.assert_array_equal(
        read.deviation, simulate_with_twin(point.scenario, point.seed(1), read.cycle).deviation
    )


def test_of_a_long_trial_the_beginning_is_shown(monkeypatch) -> None:
    monkeypatch.setattr(twins, "MAX_CYCLES", 7)
    for read, whole in zip(read_perturbations(in_memory(SCENARIO, never)), READ, strict=True):
        assert read.cycle.tolist() == np.arange(0.5, 7).tolist()
        np.testing.assert_array_equal(read.deviation, whole.deviation[:7])


@pytest.mark.parametrize("start", [{"phases": "random"}, {"phases": "synchronised"}])
def test_a_sweep_in_which_nothing_can_deviate_is_refused_and_not_drawn_blank(start: dict) -> None:
    with pytest.raises(EpuckSimError, match=r"nothing deviates .* would be blank; --form course shows"):
        read_perturbations(in_memory(particles({SPEED: [3]}, start=start), never))
    assert read_perturbations(in_memory(particles({SPEED: [3]}, start=start, clocks={"jitter": 0.01}), never))


# What is drawn


def panels_of(given: list[Deviations]) -> list[Axes]:
    """Return the panels of a figure, laid out; the last of its axes is the colour bar."""
    return laid_out(draw_perturbations(given)).axes[:-1]


def painted(given: Deviations) -> list[list[str]]:
    """Return the colour of the page in the middle of each agent and moment, agents first."""
    figure = draw_perturbations([given])
    panel = figure.axes[0]
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_locator(NullLocator())
    whole = BytesIO()
    figure.savefig(whole, dpi=150)
    whole.seek(0)
    figure.set_dpi(150)
    picture = image.imread(whole)[::-1]
    agents = range(given.deviation.shape[1])
    places = [[panel.transData.transform((x, agent)).astype(int) for x in given.cycle] for agent in agents]
    return [[to_hex(picture[row, column, :3]) for column, row in line] for line in places]


def test_there_is_a_panel_for_each_point_titled_with_its_values() -> None:
    panels = panels_of(READ)
    assert [panel.get_title() for panel in panels] == ["V = 3 cm/s", "V = 30 cm/s", "V = 90 cm/s"]
    assert (panels[0].get_xlabel(), panels[0].get_ylabel()) == ("time (cycles)", "agent")


def test_each_panel_holds_the_deviation_of_every_agent_at_every_moment_with_nothing_where_it_is_zero() -> None:
    for panel, read in zip(panels_of(READ), READ, strict=True):
        (mesh,) = panel.collections
        shown = mesh.get_array().reshape(5, 12)
        np.testing.assert_array_equal(np.ma.getmaskarray(shown), read.deviation.T == 0)
        np.testing.assert_array_equal(shown.filled(0), read.deviation.T)
        corners = mesh.get_coordinates()
        assert corners[0, :, 0].tolist() == list(range(13))
        assert corners[:, 0, 1].tolist() == [agent - 0.5 for agent in range(6)]


def test_all_panels_share_one_logarithmic_scale_up_to_half_a_cycle() -> None:
    norms = [panel.collections[0].norm for panel in panels_of(READ)]
    for norm in norms:
        assert isinstance(norm, LogNorm)
        assert (norm.vmin, norm.vmax) == (MIN_DEVIATION, 0.5)
    figure = draw_perturbations(READ)
    assert figure.axes[-1].get_ylabel() == "|Δϕ| (cycles)"


def test_on_the_page_zero_is_blank_and_anything_else_has_the_colour_of_its_size() -> None:
    def viridis(place: float) -> str:
        return to_hex(colormaps["viridis"](place))

    middle = float(np.sqrt(MIN_DEVIATION * 0.5))
    colours = painted(made([[0.5, 0, MIN_DEVIATION], [middle, MIN_DEVIATION / 1000, 0]]))
    assert colours == [[viridis(1.0), viridis(0.5)], ["#ffffff", viridis(0.0)], [viridis(0.0), "#ffffff"]]


@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (5, 1)])
def test_the_smallest_trials_are_drawn_too(tmp_path, shape: tuple[int, int]) -> None:
    smallest = [made(np.full(shape, 0.1))]
    laid_out(draw_perturbations(smallest))
    assert len(written(tmp_path, perturbations_table(smallest))) == shape[0] * shape[1]


@pytest.mark.parametrize("shape", [(1, 4), (5, 1)])
def test_one_moment_or_one_agent_is_seen_too(shape: tuple[int, int]) -> None:
    colours = {colour for line in painted(made(np.full(shape, 0.5))) for colour in line}
    assert colours == {to_hex(colormaps["viridis"](1.0))}


# What is written


def test_the_table_holds_every_deviation_that_is_not_zero(tmp_path) -> None:
    table = written(tmp_path, perturbations_table(READ))
    assert [*table[0]] == [SPEED, "cycle", "agent", "deviation"]
    expected = [
        [str(read.axes[SPEED]), six_digits(cycle), str(agent), six_digits(read.deviation[moment, agent])]
        for read in READ
        for moment, cycle in enumerate(read.cycle)
        for agent in range(5)
        if read.deviation[moment, agent] > 0
    ]
    assert [[*row.values()] for row in table] == expected
    assert 36 <= len(expected) < 180


def test_the_table_is_exactly_this(tmp_path) -> None:
    written(tmp_path, perturbations_table([made([[0, 0.25], [1 / 3, 2e-9 / 3]], **{SPEED: 0.5, COUPLING: 2})]))
    assert (tmp_path / "table.csv").read_text() == (
        f"{SPEED},{COUPLING},cycle,agent,deviation\n0.5,2,0.5,1,0.25\n0.5,2,1.5,0,0.333333\n0.5,2,1.5,1,6.66667e-10\n"
    )


def test_more_points_than_a_page_holds_are_refused_in_words() -> None:
    with pytest.raises(EpuckSimError, match=r"there would be 65 panels.*; allowed: up to 64"):
        draw_perturbations([made([[0.1]], **{SPEED: speed}) for speed in range(65)])
