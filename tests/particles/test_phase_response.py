"""Response curves: their shapes and caps, what they do to the order of two, and curves of users' own."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from epuck_sim import ParticleSimulation, load_scenario, points
from epuck_sim.errors import CurveError
from epuck_sim.particles.phase_response import CURVES, Response, make_response, order_change, phase_shift
from epuck_sim.util.yaml_io import write_yaml
from tests.measures.files import write
from tests.particles.naive_model import shift
from tests.particles.simulations import make_simulation

MULTIPLICATIVE = 0
unit = st.floats(0, 1)


def phase_after_pulse(response, phase):
    return phase + float(phase_shift(response, phase))


@pytest.mark.parametrize("curve", range(6))
@given(st.floats(0, 5), st.floats(0, 0.499), unit, st.floats(0.01, 20), unit, st.floats(-3, 3))
def test_a_pulse_shifts_phases_beyond_the_refractory_period_by_the_curve_up_to_0_and_1(
    curve, coupling, refractory, phase, dissipation, knee, early_slope
):
    parameters = {"dissipation": dissipation, "knee": knee, "early_slope": early_slope}
    after = phase + shift(CURVES[curve], coupling, parameters, phase)
    expected = min(max(after, 0), 1) if phase > refractory else phase
    found = phase_after_pulse(Response(curve, coupling, refractory, dissipation, knee, early_slope), phase)
    assert found == pytest.approx(expected, abs=1e-9)
    assert 0 <= found <= 1
    assert phase > refractory or found == phase


@given(st.sampled_from([0, 1, 2]), unit, st.floats(0, 0.499), unit)
def test_the_change_is_that_of_the_complex_order_parameter_of_two(curve, coupling, refractory, phase):
    def order(other):
        return abs(1 + np.exp(2j * math.pi * other)) / 2  # of the one that fires, at 1 or 0, and the other

    response = Response(curve, coupling, refractory)
    assert curve == MULTIPLICATIVE or order_change(response, [phase])[0] >= -1e-12  # delay and advance drive none apart
    expected = order(phase_after_pulse(response, phase)) - order(phase)
    assert order_change(response, [phase])[0] == pytest.approx(expected, abs=1e-12)


POWER = """
from beside import power

PARAMETERS = {"bend": 1.0, "times": 1, "scales": [1.0]}

def phase_shift(phase, coupling, parameters):
    shift = coupling * power(phase, parameters.bend)
    return shift * parameters.times * parameters.scales.sum()
"""


@pytest.fixture
def power(tmp_path):
    write(tmp_path / "beside.py", "def power(phase, bend):\n    return phase**bend\n")
    return write(tmp_path / "power.py", POWER)


def scenario_of(curve, **response):
    return {"model": "particles", "response": {"curve": str(curve), "coupling": 0.1, **response}}


def test_a_curve_that_says_what_the_multiplicative_one_does_gives_the_same_bits(power):
    one, other = ParticleSimulation(scenario_of(power), 3), ParticleSimulation({"model": "particles"}, 3)
    one.run(2000)
    other.run(2000)
    assert one.phases().tobytes() == other.phases().tobytes()
    assert one.instants == other.instants > 10_000


def test_parameters_and_the_coupling_reach_the_function_and_shapes_are_kept_whether_or_not_an_array_is_a_block(power):
    phases = np.linspace(0.01, 1, 30)
    for coupling, bend, times in [(0.1, 2.0, 1), (0.3, 0.5, -2), (0.1, 3.0, 1)]:
        section = scenario_of(power, parameters={"bend": bend, "times": times}, coupling=coupling)
        response = make_response(load_scenario(section).response)
        expected = np.clip(phases + times * coupling * phases**bend, 0, 1) - phases
        assert phase_shift(response, phases) == pytest.approx(expected, abs=1e-14)
        assert order_change(response, phases).shape == phases.shape
    response = Response(MULTIPLICATIVE, 0.1, 0.0)
    for shape in ((), (3, 4), (0,)):
        phases = np.linspace(0.1, 0.9, math.prod(shape)).reshape(shape).T
        assert phase_shift(response, phases) == pytest.approx(0.1 * phases)
        assert order_change(response, phases).shape == phases.shape


def test_two_curves_take_turns_in_one_process_and_a_changed_file_is_another_whose_error_has_a_class(power, tmp_path):
    added = write(tmp_path / "curve.py", "def phase_shift(phase, coupling, parameters):\n    return coupling")

    def swarms(*curves):
        return [make_simulation(1, response={"curve": str(curve), "coupling": 0.05}) for curve in curves]

    alone, together = swarms(power, "additive"), swarms(power, added)
    for swarm in alone:
        swarm.run(50)
    added.write_text("def phase_shift(phase, coupling, parameters):\n    return 2 * coupling")
    assert phase_shift(make_response(load_scenario(scenario_of(added)).response), 0.5) == pytest.approx(0.2)
    for cycle in range(50):
        for swarm in together:
            swarm.run(cycle + 1)
    phases = [swarm.phases().tobytes() for swarm in together]
    assert phases == [swarm.phases().tobytes() for swarm in alone]
    assert phases[0] != phases[1]
    added.write_text("def phase_shift(phase, coupling, parameters):\n    return coupling / (not 0.502 < phase < 0.508)")
    with pytest.raises(CurveError, match="ZeroDivisionError"):  # between the phases at which curves are tried
        ParticleSimulation(scenario_of(added), 1).run(10_000)


def test_curves_and_their_parameters_can_be_swept_and_a_path_is_relative_to_the_scenario_s_file(power):
    path = power.parent / "scene.yaml"
    path.write_text(write_yaml(scenario_of("power.py", parameters={"bend": 2})))
    response = load_scenario(str(path)).response
    assert (response.curve, response.parameters) == (str(power), {"bend": 2.0, "times": 1, "scales": (1.0,)})
    axes = {"response.curve": ["sine", str(power)], "response.coupling": [0.1, 0.2]}
    found = points({"model": "particles", "sweep": {"grid": axes}})
    assert [point.axes["response.curve"] for point in found] == ["sine", "sine", "power.py", "power.py"]
    assert found[2].scenario.response.parameters == {"bend": 1.0, "times": 1, "scales": (1.0,)}
    (_, bent) = points({**scenario_of(power), "sweep": {"grid": {"response.parameters.bend": [1, 2]}}})
    assert bent.scenario.response.parameters == {"bend": 2.0, "times": 1, "scales": (1.0,)}
