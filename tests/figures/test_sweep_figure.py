"""Claims about figures from Python: they draw into the Axes they are given, and what does not fit one is refused."""

from functools import partial
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from epuck_sim import EpuckSimError, figures
from epuck_sim.figures.sweep_figure import read_form
from epuck_sim.figures.trial_page import describe_changes
from tests.cli.commands import refused
from tests.figures.drawn import legend_texts, written
from tests.runs import made_folders
from tests.runs.made_folders import COUNT, SPEED, WIDTH, censored, ended, in_memory, store_measured, sweep, weibull

SPEEDS = [0.5, 5]
DELAY = "robots.0.parameters.delay_ms"
POINTS = in_memory(sweep({WIDTH: [40, 60], SPEED: SPEEDS}, trials=9), lambda point: weibull(point, 50))
GIVEN = {"start": {"phases": "synchronised", "displacement": 0.01}, "stop": {"order_parameter": None, "max_cycles": 5}}
AGENTS = sweep({"agents.speed_cm_s": [3, 30]}, trials=2, model="particles", agents={"count": 4}, **GIVEN)
DISPLACED = in_memory(AGENTS, lambda point: censored(point, 2))
SIGNED = [point._replace(of="mine", measured=(-1.0,) * 9) for point in POINTS]
SERIES = [point._replace(of="mine", measured=([1, 2, 3],) * 9) for point in POINTS if point.axes[SPEED] in SPEEDS[:2]]

OF_AGENTS = {"course": (DISPLACED, 2), "perturbation": (DISPLACED, 2)}
FORMS = {"curves": (POINTS, 1), "map": (POINTS, 1), "violins": (POINTS, 2), "series": (SERIES, 1), **OF_AGENTS}
"""Points that each form is drawn of, and the number of its panels."""


@pytest.mark.parametrize("form", FORMS)
def test_a_form_draws_into_the_axes_it_is_given_and_adds_neither_title_nor_legend(form: str) -> None:
    points, count = FORMS[form]
    figure = Figure()
    left, *right = figure.subplots(1, 1 + count)
    assert figures.plot(points, form=form, ax=right[0] if count == 1 else right) is figure
    assert not left.has_data()
    assert (figure.get_suptitle(), figure.legends) == ("", [])
    for panel in right:
        assert panel.has_data()
        assert panel.get_legend() is None
        assert panel.get_xlabel()
        assert panel.get_ylabel()
    figure.draw_without_rendering()
    made = figures.plot(points, form=form, font_pt=11.0)  # without Axes it makes a figure with a legend
    width_cm = 8.5 if count == 1 or form == "course" else 17.5
    assert made.get_size_inches()[0] * 2.54 == pytest.approx(width_cm)
    assert {*legend_texts(made)} == {label for panel in made.axes for label in panel.get_legend_handles_labels()[1]}
    assert {made.axes[0].yaxis.label.get_fontsize()} == {11}


def test_labels_are_as_asked_for_without_units_in_the_legend_and_axes_are_named_by_endings_of_keys() -> None:
    labels = {SPEED: "speed (cm/s)", WIDTH: "side (cm)", "T_sync": "time to $"}
    panel = figures.plot(POINTS, labels=labels, title="two sides").axes[0]
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("speed (cm/s)", "time to \\$")
    assert panel.get_legend_handles_labels()[1][:2] == ["side = 40 cm", "side = 60 cm"]
    assert panel.figure.get_suptitle() == "two sides"
    for form in ("curves", "map", "violins"):
        named = (["width_cm", "speed_cm_s"], [WIDTH, SPEED])
        asked = ({"form": form, "x": keys[0], "labels": dict.fromkeys(keys, "mine")} for keys in named)
        short, long = (read_form(POINTS, options) for options in asked)
        assert short.settings == long.settings
        assert short.labels[0] == "mine"
    assert read_form(POINTS, {"panels": "width_cm"}).titles == ["L = 40 cm", "L = 60 cm"]


def test_n_is_the_number_of_all_robots_and_no_count_of_one_of_two_groups_or_of_faults() -> None:
    counts = {COUNT: [9, 5], "robots.1.count": [1, 5]}
    mixed = sweep(None, 9, robots=[{"count": 9}, {"count": 1}], sweep={"zip": counts, "grid": {SPEED: SPEEDS}})
    read = read_form(in_memory(mixed, lambda point: weibull(point, 50)), {})
    assert [label for _, label, _ in read.placed] == ["count of robots.0 = 9", "count of robots.0 = 5"]
    assert ", count of robots.0 = 9, count of robots.1 = 1, " in describe_changes(mixed)
    dead = [[{"kind": "ring_dead", "count": count}] for count in (1, 2)]
    read = read_form(in_memory(sweep({"faults": dead, SPEED: SPEEDS}, 9), lambda point: weibull(point, 50)), {})
    assert [label for _, label, _ in read.placed] == [f"faults = ring_dead, count = {count}" for count in (1, 2)]


@pytest.mark.parametrize(("form", "x"), [("curves", SPEED), ("curves", DELAY), ("violins", SPEED), ("map", SPEED)])
def test_axes_of_a_zip_are_all_told_in_the_caption_and_the_table(form: str, x: str) -> None:
    zipped = sweep(None, 9, sweep={"zip": {SPEED: SPEEDS, DELAY: [0, 62]}, "grid": {COUNT: [3, 5]}})
    read = read_form(in_memory(zipped, lambda point: weibull(point, 50)), {"form": form, "x": x})
    assert "Together vary V = 0.5 cm/s, Δ = 0 ms; V = 5 cm/s, Δ = 62 ms." in read.caption.splitlines()
    told = {(row[SPEED], row[DELAY]) for row in written(read.tables[".csv"])}
    assert told == {("0.5", "0"), ("5", "62")}


@pytest.mark.parametrize("form", ["curves", "violins"])
def test_each_trial_is_a_dot_within_the_figure_and_hollow_if_it_is_censored(form: str) -> None:
    half = ended([10] * 4 + [5000] * 5, [True] * 4 + [False] * 5)
    points = in_memory(sweep({SPEED: SPEEDS}, trials=9), lambda point: censored(point, 9) if point.number else half)
    panel = figures.plot(points, form=form, points=True).axes[0]
    for label, is_known in (("a trial", True), ("a censored trial", False)):
        drawn = [line for line in panel.get_lines() if line.get_label() == label]
        found = [y for line in drawn for y in line.get_ydata()]
        assert found == [t for p in points for t, seen in zip(p.times, p.observed, strict=True) if seen == is_known]
        assert {line.get_markerfacecolor() == "none" for line in drawn} == {not is_known}
        assert len({x for line in drawn for x in line.get_xdata()}) == (1 if is_known else 5 + 9)  # each to be seen
    assert panel.get_ylim()[1] > 5000


@pytest.mark.parametrize("form", ["curves", "violins", "map", "series"])
@pytest.mark.parametrize("scale", ["linear", "log"])
def test_the_scale_is_as_asked_for(form: str, scale: str) -> None:
    panel, *others = figures.plot(SERIES if form == "series" else POINTS, form=form, scale=scale).axes
    if form != "map":
        assert panel.get_yscale() == scale
        return
    bar = others[-1]
    assert (bar.get_ylim()[1] < 5) == (scale == "log")


def test_axes_are_those_asked_for_or_else_the_scenario_s() -> None:
    violins = {"form": "violins", "x": COUNT, "censored_at_cycles": 30}
    for figure, options, expected in [
        ({}, {"form": "map", "y": WIDTH}, {"x": SPEED, "y": WIDTH}),
        ({"form": "map", "y": COUNT}, {}, {"x": SPEED, "y": COUNT}),
        ({"form": "map", "x": WIDTH, "y": COUNT}, {"y": SPEED}, {"x": WIDTH, "y": SPEED}),
        ({}, {"form": "violins"}, {"axis": SPEED, "censored_at": None}),
        (violins, {}, {"axis": COUNT, "censored_at": 30}),
        (violins, {"x": WIDTH, "censored_at_cycles": 20}, {"axis": WIDTH, "censored_at": 20}),
        ({"form": "map", "x": COUNT, "y": SPEED}, {"form": "curves"}, {"axis": COUNT}),
        ({"panels": COUNT}, {"x": COUNT}, {"axis": COUNT, "split_by": None}),
    ]:
        scenario = sweep({COUNT: [3, 5], WIDTH: [40, 60], SPEED: [1, 2]}, trials=5, figure=figure)
        form = read_form(in_memory(scenario, lambda point: weibull(point, 30)), options)
        assert {name: getattr(form, name) for name in expected} == expected


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> list[Path]:
    """Return two run folders, of scenarios of other names with the same axes in another order."""
    folder, axes, made = tmp_path_factory.mktemp("folders"), [(COUNT, [3, 5]), (SPEED, SPEEDS)], []
    for name, scenario, mean, step in (("a", "demo", 50, 1), ("b", "other", 90, -1)):
        swept = sweep(dict(axes[::step]), 9, scenario)
        made.append(made_folders.store(folder / name / "run", swept, partial(weibull, mean=mean)))
    return made


def test_folders_are_told_apart_by_their_names_in_the_figure_the_table_and_the_caption(folders) -> None:
    form = read_form(folders, {}, names=["mine", "thesis"])
    (panel,) = form.draw_figure().axes
    assert panel.get_legend_handles_labels()[1][:3] == ["mine, N = 3", "mine, N = 5", "thesis, N = 3"]
    assert [*written(form.tables[".csv"])[0]][:3] == ["folder", COUNT, SPEED]
    told = (f"{name} (scenario {name.split()[1]}, seed 0, run folder run)." for name in ("mine: demo", "thesis: other"))
    assert form.caption.splitlines()[:2] == [*told]
    alone = [figures.plot(folder).axes[0].get_lines() for folder in folders]
    drawn = {tuple(line.get_ydata()) for lines in alone for line in lines if len(line.get_ydata()) == len(SPEEDS)}
    assert drawn == {tuple(line.get_ydata()) for line in panel.get_lines() if len(line.get_ydata()) == len(SPEEDS)}
    expected = {"map": ["a", "b", ""], "violins": ["a, N = 3", "a, N = 5", "b, N = 3", "b, N = 5"]}
    for kind, titles in expected.items():
        assert [panel.get_title() for panel in figures.plot(folders, form=kind, names=["a", "b"]).axes] == titles


def test_a_measure_has_the_unit_of_its_file_and_folders_with_other_units_are_refused(tmp_path) -> None:
    folders = []
    for unit in ("cm", "mm"):
        path = tmp_path / unit / "mine.py"
        path.parent.mkdir()
        path.write_text(f'UNIT = "{unit}"\n\n\ndef way(simulation): return 1.0\n')
        scenario = sweep({SPEED: SPEEDS}, trials=2, measures=[str(path)])
        folders.append(store_measured(tmp_path / f"run-{unit}", scenario, lambda point: [point.axes[SPEED]] * 2))
    assert [figures.plot(each, of="way").axes[0].get_ylabel() for each in folders] == ["way (cm)", "way (mm)"]
    with pytest.raises(EpuckSimError, match="the unit of way differs: cm, mm; give folders with one unit"):
        figures.plot(folders, of="way")
    assert "the unit of way differs: cm, mm; give folders with one unit" in refused("compare", *folders, "--of", "way")
    (tmp_path / "mm/mine.py").unlink()
    assert figures.plot(folders[1], of="way").axes[0].get_ylabel() == "way"
    assert read_form(folders[1], {}, "way", where="speed_cm_s=0.5,5").ties == ["only points with speed_cm_s=0.5,5"]


def test_what_does_not_fit_is_refused_in_words() -> None:
    for draw, message in [
        (lambda: figures.plot(POINTS, form="violins", ax=Figure().subplots()), "has 2 panels, but ax is 1 Axes"),
        (lambda: figures.plot(POINTS, ax=()), "has 1 panel, but ax is 0 Axes"),
        (lambda: figures.plot(iter(())), "there is nothing to draw; give a run folder, or points of one"),
        (lambda: figures.plot([POINTS[0], "folder"]), "of the type PointTrials, str; allowed: run folders, or points"),
        (lambda: figures.plot(3), "results are of the type int; allowed: run folders"),
        (lambda: figures.plot(POINTS, ax=3), "ax is 3; allowed: Axes, or several"),
        (
            lambda: figures.plot(["a", "a.rrd"]),
            r"a\.rrd: is a recording, which .*`plot FILE\.rrd`, or .*draw_page\(read_recording",
        ),
        (lambda: figures.plot(POINTS, where=["count=3"]), "names, where and of are for run folders"),
        (lambda: figures.plot(POINTS, form="pie"), "figure.form: is 'pie'; allowed: 'curves', 'map'"),
        (lambda: figures.plot(POINTS, width=3), "figure.width: unknown 'width', did you mean 'width_cm'"),
        (lambda: figures.plot(SIGNED, scale="log"), "--log: mine has values that are not positive, such as -1"),
    ]:
        with pytest.raises(EpuckSimError, match=message):
            draw()
