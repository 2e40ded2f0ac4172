"""Many channels at once: each as if alone, in any order, on any number of threads."""

import numpy as np
import pytest
from sampled_diagrams import PERIOD, PLANT_PARAMETERS, one_axis_loop, saturated_loop

from flipdiagram.compiled import CompiledDiagram, compile_diagram
from flipdiagram.errors import InputError

RNG = np.random.default_rng(3)
N = 37
COMMANDS = {"x_cmd": 0.1, "v_cmd": 0.0, "a_cmd": 0.0}
GAINS = {
    "pd.0": RNG.uniform(400, 900, N),
    "dob.0": RNG.uniform(5, 50, N),
    "plant.0": np.c_[RNG.uniform(1, 3, N), RNG.uniform(-9, 9, N)],
}


@pytest.fixture(scope="module")
def axis() -> CompiledDiagram:
    return compile_diagram(one_axis_loop())


@pytest.fixture(scope="module")
def saturated() -> CompiledDiagram:
    return compile_diagram(saturated_loop())


def test_channels_equal_separate_runs_bit_for_bit(axis):
    together = axis.run(400, parameters=GAINS, inputs=COMMANDS, threads=2)
    assert together.final.shape == (N, len(axis.state_names))
    assert len(np.unique(together.state["plant"][:, 0])) == N
    for c in range(N):
        alone = axis.run(400, parameters={name: v[c : c + 1] for name, v in GAINS.items()}, inputs=COMMANDS)
        assert (alone.final == together.final[c]).all()
        assert (alone.outputs["f"] == together.outputs["f"][c]).all()


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_threads_and_different_lengths_change_nothing(axis, threads):
    ticks = RNG.integers(0, 500, N)
    run = axis.run(ticks, parameters=GAINS, inputs=COMMANDS, threads=threads, log=["x"], every=7)
    assert (run.ticks == ticks).all()
    longest = axis.run(500, parameters=GAINS, inputs=COMMANDS, log=["x", "plant"])
    for c in range(N):
        assert run.state["plant"][c, 0] == longest.log["plant"][c, ticks[c], 0]
        rows = ticks[c] // 7 + 1
        assert (run.log["x"][c, :rows] == longest.log["x"][c, : ticks[c] + 1 : 7]).all()
        assert np.isnan(run.log["x"][c, rows:]).all()


def test_a_run_in_pieces_equals_one_in_one_piece(axis):
    series = {"x_cmd": np.sin(np.arange(300) * 0.05)[None], "v_cmd": 0.0, "a_cmd": 0.0}
    whole = axis.run(300, parameters=GAINS, inputs=series)
    first = axis.run(100, parameters=GAINS, inputs=series)
    rest = {**series, "x_cmd": series["x_cmd"][:, 100:]}
    second = axis.run(200, parameters=GAINS, inputs=rest, state=first.final, start=first.ticks)
    assert (second.final == whole.final).all() and (second.ticks == 300).all()


def test_series_are_read_tick_by_tick_and_their_last_row_is_held(saturated):
    steps = np.array([[0.1, 0.0, -0.2]])
    by_series = saturated.run(10, inputs={"reference": steps}, log=["u"])
    state, found = None, []
    for k in range(10):
        one = saturated.run(1, inputs={"reference": steps[0, min(k, 2)]}, state=state, start=k, log=["u"])
        found.append(one.log["u"][0, 0])
        state = one.final
    assert (by_series.final == state).all() and (by_series.log["u"][0, :10] == found).all()
    several = saturated.run(4, inputs={"reference": RNG.uniform(-0.1, 0.1, (3, 4))})
    assert several.final.shape == (3, 2)


def test_names_and_sizes_are_those_of_the_diagram(axis):
    assert axis.default_state["dob"] == [0.0] and axis.parameters["plant.0"] == 2
    assert axis.states == {"dob": 1, "plant": 2, "velocity": 1}
    assert axis.state_names == ["dob", "plant[0]", "plant[1]", "velocity"]


def test_names_reach_into_sub_diagrams_and_elements():
    nested = compile_diagram(one_axis_loop(nested=True))
    flat = compile_diagram(one_axis_loop())
    values = {"plant.0[0]": 2.0, "plant.0[1]": -9.0}
    a = nested.run(300, inputs=COMMANDS, parameters={**values, "controller::pd.0": [300.0, 500.0]})
    b = flat.run(300, inputs=COMMANDS, parameters={"plant.0": [2.0, -9.0], "pd.0": [300.0, 500.0]})
    assert (a.state["plant"] == b.state["plant"]).all()
    assert (a.state["controller::dob"] == b.state["dob"]).all()


def test_a_block_may_name_its_parameters():
    diagram = one_axis_loop()
    diagram.GetSubsystemByName("pd").numeric_parameter_names = ("k_p", "k_v")
    compiled = compile_diagram(diagram)
    assert "pd.k_p" in compiled.parameters and "pd.0" not in compiled.parameters
    a = compiled.run(10, inputs=COMMANDS, parameters={"pd.k_p": 300.0, **PLANT_PARAMETERS})
    b = compiled.run(10, inputs=COMMANDS, parameters={"pd.0": 300.0, **PLANT_PARAMETERS})
    assert (a.final == b.final).all()


def test_tied_parameters_are_one():
    tied = compile_diagram(one_axis_loop(), tie={"m": ["dob.1", "plant.0[0]"], "k": ["pd.0"]})
    assert tied.parameters["m"] == 1 and "dob.1" not in tied.parameters
    free = compile_diagram(one_axis_loop())
    a = tied.run(200, inputs=COMMANDS, parameters={"m": [1.0, 2.0], "k": 500.0, "plant.0[1]": -9.0})
    b = free.run(
        200,
        inputs=COMMANDS,
        parameters={"dob.1": [1.0, 2.0], "plant.0[0]": [1.0, 2.0], "pd.0": 500.0, "plant.0[1]": -9.0},
    )
    assert (a.final == b.final).all()


BAD = [
    ({"parameters": {"pd.7": 1.0}}, r"unknown parameter 'pd.7'; choose from .*pd\.k_p"),
    ({"parameters": {"pd.0[1]": 1.0}}, r"unknown parameter 'pd.0\[1\]'"),
    ({"parameters": {"pd.0": np.ones((2, 2))}}, r"'pd.0' has shape \(2, 2\)"),
    ({"parameters": {"pd.0": [1.0, np.nan]}}, "'pd.0' holds nan"),
    ({"parameters": {"pd.0": "much"}}, "'pd.0' = 'much'"),
    ({"parameters": {"pd.0": [1.0, 2.0], "dob.0": [1.0, 2.0, 3.0]}}, "numbers of channels differ"),
    ({"parameters": {"pd.0": [1.0, 2.0]}, "start": [0, 0, 0]}, "numbers of channels differ"),
    ({"state": np.zeros(3)}, r"state has shape \(3,\); valid is \(channels, 4\)"),
    ({"state": {"mass": 1.0}}, "unknown state 'mass'; choose from dob, plant"),
    ({"inputs": {"x_cmd": 0.0}}, "input 'a_cmd' has no value"),
    ({"inputs": {**COMMANDS, "w": 0.0}}, "unknown input 'w'"),
    ({"inputs": {**COMMANDS, "x_cmd": np.zeros((1, 3, 2))}}, "'x_cmd' has shape"),
    ({"ticks": -1}, "ticks = -1"),
    ({"ticks": 1.5}, "ticks = 1.5"),
    ({"start": -1}, "start = -1"),
    ({"every": 0}, "every = 0"),
    ({"threads": 0}, "threads = 0"),
    ({"log": ["speed"]}, "unknown output or state 'speed'; choose from f, x, dob, plant, velocity"),
    ({"log": "x"}, r"valid is a list of names, such as \['x'\]"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD, ids=[message[:30] for _, message in BAD])
def test_bad_arguments_are_named(axis, arguments, message):
    with pytest.raises(InputError, match=message):
        axis.run(**{"ticks": 1, "inputs": COMMANDS, **arguments})


@pytest.mark.parametrize(
    ("tie", "message"),
    [
        ({"pd.0": ["pd.0"]}, "is the name of a parameter already"),
        ({"m": ["plant.0", "dob.1"]}, r"different sizes \(plant.0: 2, dob.1: 1\)"),
        ({"m": ["dob.1", "plant.0[0]"], "n": ["plant.0[0]", "pd.0"]}, "is tied already"),
        ({"m": ["dob.1", "plant.0[0]"], "n": ["pd.0", "plant.0[0]"]}, "is tied already"),
        ({"m": ["dob.9"]}, "unknown parameter 'dob.9'"),
    ],
)
def test_bad_ties_are_named(tie, message):
    with pytest.raises(InputError, match=message):
        compile_diagram(one_axis_loop(), tie=tie)


def test_time_of_a_tick_is_drakes(axis):
    assert axis.time(7) == 7 * PERIOD and axis.time([1, 2]).shape == (2,)
