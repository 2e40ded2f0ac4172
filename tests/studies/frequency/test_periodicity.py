"""Responses whose windows differ: told apart by what they do where a window is a whole number of ticks and periods."""

from types import SimpleNamespace

import numpy as np
import pytest

from flipdiagram.errors import SimulationError
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.frequency import run as frequency
from flipdiagram.studies.frequency import tables as frequency_tables
from flipdiagram.studies.frequency.laboratory import Laboratory, Measured
from flipdiagram.studies.frequency.periodicity import MOST_WINDOWS, judge, repetitions, whole_frequency
from flipdiagram.studies.frequency.sweep import Windows, measure

# NumPy reports the floating-point flags that Drake's symbolic scalars leave behind.
pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
PAPER = Scenario()


class Logistic:
    """In the place of a compiled loop: the amplitude of x is A[k+1] = r A[k] (1 − A[k]), once a window; r a parameter.

    r = 2.5 settles at once, 2.95 and 1.15 slowly, from alternating sides and from one; 3.2 and 3.5 repeat after 2 and
    4 windows, 3.9 is chaotic and 4.1 diverges.
    """

    period = 1e-3
    state_names = ("loop[0]", "lockin_x[0]")
    states = ("loop", "lockin_x")
    default_state = {"loop": np.array([0.4]), "lockin_x": np.array([0.0])}

    def __init__(self):
        self.omegas = []

    def run(self, ticks, parameters, state=None, start=0):
        n = len(parameters["omega"])
        ticks, start = np.broadcast_to(ticks, (n,)), np.broadcast_to(start, (n,))
        if state is None:
            state = np.tile([0.4, 0.0], (n, 1))
        assert (state[:, 1] == 0.0).all()  # the meters begin anew
        self.omegas.append(parameters["omega"])
        moved = ticks > 0
        with np.errstate(over="ignore"):
            amplitude = np.where(moved, parameters["r"] * state[:, 0] * (1 - state[:, 0]), state[:, 0])
        outputs = {name: np.zeros((n, 2)) for name in ("peak_x", "peak_a", "peak_force")}
        outputs |= {"rms_error": np.abs(amplitude)[:, None], "lockin_a": np.zeros((n, 3)), "lockin_x": np.zeros((n, 3))}
        for c in range(n):
            sines = np.sin(parameters["omega"][c] * self.period * np.arange(start[c], start[c] + ticks[c]))
            outputs["lockin_x"][c, 0] = amplitude[c] * (sines @ sines)
        return SimpleNamespace(final=np.stack([amplitude, np.ones(n)], axis=1), ticks=start + ticks, outputs=outputs)


KINDS = {
    2.5: "periodic",
    2.95: "settling",
    1.15: "settling",
    3.2: "subharmonic",
    3.5: "subharmonic",
    3.9: "not periodic",
}


def test_what_a_loop_does_is_told_from_its_windows():
    loop, r = Logistic(), np.array(list(KINDS))
    omega = np.full(len(r), 10.0)
    found, steps = repetitions(loop, omega, [6283] * len(r), {"r": r}, 100, tolerance=1e-5)
    assert [each["verdict"] for each in found] == list(KINDS.values())
    # 6283 ticks of 1 ms are ten periods of 10 rad/s, but for a part of a tick
    assert [each["repeats_after_periods"] for each in found] == [10, None, None, 20, 40, None]
    assert all(each["judged_at_omega_rad_s"] == pytest.approx(20 * np.pi / 6.283, rel=1e-15) for each in found)
    for driven in loop.omegas:
        assert driven == pytest.approx(20 * np.pi / 6.283, rel=1e-15)
    assert [each["spread_there"] <= 1e-5 for each in found] == [True, False, False, True, True, False]
    assert found[0]["windows"] < MOST_WINDOWS and found[5]["windows"] == MOST_WINDOWS
    assert steps == 6283 * (found[0]["windows"] + 5 * MOST_WINDOWS) + 6 * 100


@pytest.mark.parametrize("r", [2.95, 1.15])
def test_settling_says_after_how_many_windows(r):
    (found,), _ = repetitions(Logistic(), [10.0], [6283], {"r": [r]}, 0, tolerance=1e-5)
    amplitudes = [0.4, 0.4 * r * 0.6]
    while abs(amplitudes[-1] / amplitudes[-2] - 1) > 1e-5:
        amplitudes.append(r * amplitudes[-1] * (1 - amplitudes[-1]))
    assert found["windows"] == pytest.approx(len(amplitudes) - 1, rel=0.15) and found["windows"] > MOST_WINDOWS


def test_the_spreads_of_a_measurement_are_of_fundamental_and_rms():
    response = measure(Windows(Logistic(), [10.0, 10.0], {"r": [2.5, 3.2]}, 0), tolerance=1e-5, most_windows=9)
    assert response.steady.tolist() == [True, False]
    assert (response.spread_x <= response.spread).all()
    # 3.2 goes to and fro between 0.51304 and 0.79946
    assert response.spread_x[1] == pytest.approx(1 - 0.51304 / 0.79946, rel=1e-2)


def test_a_loop_that_diverges_is_named():
    with pytest.raises(SimulationError, match="'mine' diverged at omega = 10.0003"):
        repetitions(Logistic(), [9.99], [6283], {"r": [4.5]}, 0, tolerance=1e-5, name="mine")


def test_judging_needs_agreement_more_than_once():
    steady = [np.array([1.0 + 0j, 0.5])] * 2
    assert judge(steady, 1e-5)[0] == "not periodic" and judge([*steady, steady[0]], 1e-5)[0] == "periodic"
    by_rms = [np.array([1.0 + 0j, 0.5 + 0.1 * (k % 3)]) for k in range(MOST_WINDOWS)]
    assert judge(by_rms, 1e-5)[:2] == ("subharmonic", 3)
    drifting = [np.array([1.0 + 0.01j * k, 0.5]) for k in range(MOST_WINDOWS)]
    assert judge(drifting, 1e-5)[0] == "not periodic"


def test_whole_frequencies_lie_beside_those_asked_for():
    omega = np.array([0.1, 135.72, 5000.0])
    whole, m = whole_frequency(omega, [628_319, 2315, 2011], 1e-4)
    assert m.tolist() == [1, 5, 160]
    assert whole * np.array([628_319, 2315, 2011]) * 1e-4 == pytest.approx(2 * np.pi * m, rel=1e-15)
    assert np.abs(whole / omega - 1).max() < 2e-4


def test_held_friction_feels_the_part_of_a_tick_that_a_period_leaves():
    """Unsteady at the frequency asked for, periodic beside it; stick-slip friction, exact within a step, is steady."""
    omega = [0.19876838169865108, 135.7208808297453]
    found = {}
    for law in ("signum", "stick-slip"):
        settings = PAPER.one_dof.model_copy(update={"friction_model": law})
        laboratory = Laboratory(settings, PAPER.frequency)
        loops = [("pd+ff", 0.0), ("pd+ff+dob", 10.0)]
        responses = laboratory.responses(loops, omega, "friction")
        before = laboratory.steps
        found[law] = frequency.unsteady_responses(laboratory, Measured(settings, PAPER.frequency, friction=responses))
        missed = [response.steady[i] for response in responses.values() for i in (0, 1)].count(False)
        assert len(found[law]) == missed and (laboratory.steps > before) == (missed > 0)
    assert found["stick-slip"] == []
    assert [(e["architecture"], e["omega_rad_s"]) for e in found["signum"]] == [
        ("pd+ff", omega[1]),
        ("pd+ff+dob", omega[0]),
    ]
    for entry, periods in zip(found["signum"], (5, 1), strict=True):
        assert (entry["kind"], entry["friction_model"], entry["verdict"]) == ("friction", "signum", "periodic")
        assert entry["repeats_after_periods"] == periods
        assert entry["spread"] > 1e-5 > 1e-8 > entry["spread_there"]
        assert entry["spread_of_fundamental"] < 1e-7  # the motion hardly differs, its small error does


def test_the_sentence_counts_what_unsteady_responses_do():
    entries = [
        {"verdict": name, "spread": 2e-4, "spread_of_fundamental": 3e-8}
        for name in ("periodic", "subharmonic", "periodic")
    ]
    summary = {"measurement": {"unsteady": entries, "tolerance": PAPER.frequency.tolerance}}
    said = frequency_tables.steadiness(summary)
    assert "within 1e-05" in said and "but 3, which differ by up to 0.0002, in the fundamental by up to 3e-08" in said
    assert (
        "2 settled and periodic" in said
        and "1 repeating only after several windows" in said
        and "not periodic" not in said
    )
    summary["measurement"]["unsteady"] = []
    assert frequency_tables.steadiness(summary) == "Successive windows agree within 1e-05 for every response."
