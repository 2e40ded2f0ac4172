"""Section III without friction: the measured fundamental, the closed form and the linearised diagram are one curve."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flipdiagram.compiled import compile_diagram
from flipdiagram.diagrams.one_dof import build_controller, build_open
from flipdiagram.scenario.one_dof import OneDof
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.frequency import realisations
from flipdiagram.studies.frequency.laboratory import (
    WITH_OBSERVER,
    Laboratory,
    closed_form,
    peak_force_theory,
    rms_error_theory,
)

# NumPy reports the floating-point flags that Drake's symbolic scalars leave behind.
pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
PAPER = Scenario()
OMEGA = [0.1, 1.0, 9.0, 30.0, 47.3, 120.0, 700.0, 3000.0]
TENTH_PERCENT, TENTH_DEGREE = 1e-3, np.radians(0.1)


def assert_equal_responses(one, other):
    ratio = np.asarray(one) / np.asarray(other)
    assert np.abs(np.abs(ratio) - 1).max() < TENTH_PERCENT
    assert np.abs(np.angle(ratio)).max() < TENTH_DEGREE


def linearised(loop, of: OneDof, omega, source=None, output="x"):
    """The same response from A, B, C, D of the compiled loop without command, meters and friction."""
    name, g = loop
    own = of.model_copy(update={"g_dis": g}) if g else of
    linear = compile_diagram(build_open(build_controller(name, own), own), check=0)
    found = linear.linearize(inputs=dict.fromkeys(linear.inputs, 0.0))
    w = np.asarray(omega, dtype=float)
    response = found.response(w, outputs=(output,))[:, 0, :]
    names = [text.partition("[")[0] for text in found.input_names]
    if source is not None:
        return response[:, names.index(source)]
    command = {"x_cmd": 1.0 + 0j * w, "v_cmd": 1j * w, "a_cmd": -(w**2) + 0j}
    return sum(response[:, names.index(key)] * value for key, value in command.items() if key in names)


OBSERVERS = {"r = 1, g_v = 400 rad/s": {**realisations.TEXTBOOK, "velocity_cutoff": 400.0}} | {
    name: {**realisations.TEXTBOOK, **changes} for name, changes in realisations.REALISATIONS.items()
}
UNSTABLE = {"documented, 10 Hz: r = 1, g_v = 62.8 rad/s": {300.0}, "r = 0.5, g_v = 62.8 rad/s": {100.0, 300.0}}
"""g_dis [rad/s] of loops that have a growing pole, by realisation."""


@pytest.mark.parametrize("observer", OBSERVERS)
def test_fundamental_closed_form_and_linearisation_agree(observer):
    """From 0.1 to 3000 rad/s, for every realisation: all architectures, all g_dis of the study and the ends of Fig. 9."""
    of = PAPER.one_dof.model_copy(update=OBSERVERS[observer])
    laboratory = Laboratory(of, PAPER.frequency, lenient=True)
    cut_offs = sorted({of.g_dis, *PAPER.frequency.g_dis, *PAPER.frequency.torque_g_dis})
    loops = laboratory.stable(laboratory.loops(cut_offs))
    assert set(laboratory.unstable) == {(name, g) for name in WITH_OBSERVER for g in UNSTABLE.get(observer, ())}
    commanded, noisy = laboratory.responses(loops, OMEGA), laboratory.responses(loops, OMEGA, "noise")
    assert set(commanded) == set(loops)
    for loop in loops:
        form = closed_form(of, loop)
        assert commanded[loop].steady.all()
        assert_equal_responses(-commanded[loop].x, form.command(OMEGA))
        assert_equal_responses(linearised(loop, of, OMEGA), form.command(OMEGA))
        assert_equal_responses(commanded[loop].a / np.square(OMEGA), form.acceleration(OMEGA))
        assert_equal_responses(noisy[loop].x / PAPER.frequency.noise_amplitude, form.noise(OMEGA))
        assert_equal_responses(linearised(loop, of, OMEGA, "v_noise"), form.noise(OMEGA))
        assert_equal_responses(linearised(loop, of, OMEGA, "f_d"), form.disturbance(OMEGA))
        assert_equal_responses(linearised(loop, of, OMEGA, output="force"), form.torque(OMEGA))
        # a sampled peak may miss the top of the sinusoid, by how much depends on the samples of its window
        assert commanded[loop].peak_a / np.square(OMEGA) == pytest.approx(np.abs(form.acceleration(OMEGA)), rel=2e-3)
        assert commanded[loop].peak_force == pytest.approx(peak_force_theory(form, OMEGA), rel=2e-3)
        assert commanded[loop].rms_error == pytest.approx(rms_error_theory(form, OMEGA), rel=2e-3)


@settings(max_examples=12)
@given(
    st.floats(0.3, 5.0),
    st.floats(100.0, 2000.0),
    st.floats(25.0, 150.0),
    st.floats(5.0, 150.0),
    st.floats(0.3, 1.5),
    st.booleans(),
)
def test_they_agree_for_other_numbers_than_the_papers(mass, k_p, k_v, g, ratio, scaled):
    changes = {
        "mass": mass,
        "k_p": k_p,
        "k_v": k_v,
        "nominal_mass_ratio": ratio,
        "reference_scaled_by_nominal_mass": scaled,
    }
    of = PAPER.one_dof.model_copy(update=changes)
    laboratory = Laboratory(of, PAPER.frequency, lenient=True)
    omega = [3.0, 40.0, 1000.0, 3000.0]
    for loop, response in laboratory.responses(laboratory.loops((g,)), omega).items():
        assert_equal_responses(-response.x, closed_form(of, loop).command(omega))
        assert_equal_responses(linearised(loop, of, omega), closed_form(of, loop).command(omega))
