"""Claims about what a control step calls: nothing that its scenario does not need, and in order."""

import pytest

from epuck_sim.embodied.loop import plan_calls
from epuck_sim.scenario.loader import load_scenario

SENSING = [("infrared", 0), ("camera", 0), ("radio", 1)]
CONTROL = [("one", 0), ("other", 1)]


def of_groups(kernel):
    return [(kernel, 0), (kernel, 1)]


FAULTY = [("change_faults", 0), *of_groups("hold"), *SENSING, *of_groups("blank_readings")]


@pytest.mark.parametrize(
    ("changes", "early", "late"),
    [
        ({}, SENSING + CONTROL, []),
        ({"spread": {"clock_rate": 0.1}, "stuck": {"per_hour": 1}},
         [("tick", 0), ("stop_and_release", 0), *SENSING, *CONTROL], []),
        ({"faults": [{"kind": "ring_dead"}]}, [*FAULTY, *CONTROL, *of_groups("freeze")], [("fail_actuators", 0)]),
        ({"schedule": [{"at_s": 1, "remove": [3]}]}, [*SENSING, *of_groups("blank"), *CONTROL], [("rest", 0)]),
        ({"faults": [{"kind": "restart"}], "schedule": [{"at_s": 1, "remove": [3]}]},
         [*FAULTY, *of_groups("blank"), *CONTROL, *of_groups("freeze")], [("fail_actuators", 0), ("rest", 0)]),
    ],
)  # fmt: skip
def test_a_control_step_calls_what_its_scenario_needs_in_order(changes, early, late):
    scenario = load_scenario({"robots": [{"count": 2}, {"count": 3}], **changes})
    plan = plan_calls(scenario, [["infrared", "camera"], ["radio"]], ["one", "other"])
    functions = [[(getattr(call, "function", call), number) for call, number in calls] for calls in plan]
    assert [[(getattr(call, "__name__", call), number) for call, number in calls] for calls in functions] == [
        early,
        late,
    ]
