"""Claims about what a control step calls: nothing that its scenario does not need, and in order."""

import pytest

from epuck_sim.embodied.changes.calls import plan_calls
from epuck_sim.scenario.changes import FAULTS
from epuck_sim.scenario.loader import load_scenario

NEEDED = {"clock_drift": {"rate": 1.1}, "clock_jitter": {"jitter": 0.1}, "camera_misses": {"missed": 0.5}}

OF_ALL_ROBOTS = [kind for kind in FAULTS if kind != "sensor_dead"]
"""Faults that robots may have without sensors in files of their own, whose tests are in `test_own`."""


def calls_of(faults=(), **others):
    """Return the names of early and late calls, with a group's number, and of what hides flashes."""
    given = {
        "robots": [{"count": 2}, {"count": 3}],
        "faults": [{"kind": kind, **NEEDED.get(kind, {})} for kind in faults],
    }
    plan = plan_calls(load_scenario({**given, **others}), [["infrared", "camera"], ["radio"]], ["one", "other"])
    early, late = ([(getattr(call, "function", call), number) for call, number in calls] for calls in plan[:2])
    named = [[(getattr(call, "__name__", call), number) for call, number in calls] for calls in (early, late)]
    return *named, plan.hide and plan.hide.function.__name__


SENSING = [("infrared", 0), ("camera", 0), ("radio", 1)]
CONTROL = [("one", 0), ("other", 1)]


def test_robots_without_faults_sense_and_then_run_their_controllers():
    assert calls_of() == (SENSING + CONTROL, [], None)


@pytest.mark.parametrize("kind", OF_ALL_ROBOTS)
def test_a_fault_adds_what_changes_what_it_changes(kind):
    begin, before, after, last, late, hide = [("change_faults", 0)], [], [], [], [], None
    match FAULTS[kind].changes:
        case "clock":
            begin.append(("tick_clocks", 0))
        case "phase":
            before, last = ([(name, group) for group in range(2)] for name in ("hold_phases", "freeze_phases"))
        case "infrared":
            after = [("blank_infrared", 0), ("blank_infrared", 1)]
        case "ring":
            late = [("fail_rings", 0)]
        case "wheels":
            late = [("stop_wheels", 0)]
        case "flashes":
            hide = "hide_flashes"
    assert calls_of([kind, kind]) == (begin + before + SENSING + after + CONTROL + last, late, hide)


def test_who_is_out_senses_nothing_and_rests_whatever_fails():
    early, late, hide = calls_of(OF_ALL_ROBOTS, schedule=[{"at_s": 1, "remove": [3]}])
    blank = [("blank", 0), ("blank", 1)]
    assert early == [
        *(("change_faults", 0), ("tick_clocks", 0), ("hold_phases", 0), ("hold_phases", 1)),
        *(*SENSING, ("blank_infrared", 0), ("blank_infrared", 1), *blank, *CONTROL),
        *(("freeze_phases", 0), ("freeze_phases", 1)),
    ]
    assert late == [("fail_rings", 0), ("stop_wheels", 0), ("rest", 0)]
    assert hide == "hide_flashes"
    assert calls_of(schedule=[{"at_s": 1, "remove": [3]}]) == (SENSING + blank + CONTROL, [("rest", 0)], None)
