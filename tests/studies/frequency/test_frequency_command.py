"""`flipdiagram frequency` as a command: bad input, what it writes and says, and that quick runs are quick."""

import itertools
import json

import pytest

from flipdiagram.cli import main as cli
from flipdiagram.cli.options import parser, split_overrides
from flipdiagram.errors import InputError, SimulationError
from flipdiagram.files import OWN, sole_use, write_atomically
from flipdiagram.folders import renewed
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.frequency import realisations
from flipdiagram.studies.frequency import run as frequency

# NumPy reports the floating-point flags that Drake's symbolic scalars leave behind.
pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
PAPER = Scenario()


@pytest.mark.parametrize(
    ("words", "code", "parts"),
    [
        (["--frequency.omega", "[1, 0]"], 2, ["frequency.omega", "0.0001 to 1000000 [rad/s]"]),
        (["--frequency.omega=[40000]"], 2, ["frequency.omega", "below the Nyquist frequency", "31415.9"]),
        (["--frequency.highest=40000"], 2, ["frequency.highest", "Nyquist"]),
        (["--frequency.lowest=-1"], 2, ["frequency.lowest", "from 0.0001"]),
        (["--frequency.lowest=6000"], 2, ["frequency.highest", "above frequency.lowest"]),
        (["--one_dof.k_p=-900"], 2, ["one_dof.k_p", "from 0 to 100000000"]),
        (["--one_dof.viscous=1000"], 2, ["one_dof.viscous", "at most"]),
        (["--one_dof.friction_model=tanh"], 2, ["signum, stick-slip"]),
        (["--frequency.g_dis=[]"], 2, ["frequency.g_dis", "at least one"]),
        (
            ["--one_dof.velocity_cutoff=62.8"],
            3,
            ["'pd+dob, g_dis = 100' is unstable", "pole at s = 3.716 ± 86.7j rad/s"],
        ),
        (["--one_dof.k_v=0"], 3, ["'pd' is unstable", "30j rad/s"]),
    ],
)
def test_bad_input_ends_with_one_line(words, code, parts, tmp_path, capsys):
    assert cli.main(["frequency", "--quick", "--quiet", "--out", str(tmp_path / "out"), *words]) == code
    done = capsys.readouterr()
    assert done.out == "" and done.err.startswith("flipdiagram: error: ") and done.err.count("\n") == 1
    for part in parts:
        assert part in done.err


def test_the_command_writes_figures_and_prints_the_claims(tmp_path, capsys):
    # what a full run left in the folder does not survive a quick one
    stale = {"quick": False, "realisations": [1], "friction_models": {}, "measurement": {"unsteady": [1]}}
    with renewed(tmp_path, "summary.json"):
        write_atomically(tmp_path / "summary.json", json.dumps(stale))
        write_atomically(tmp_path / "fig11.png", "of the full run only")
    words = [
        "--frequency.omega",
        "[2, 20, 60, 100, 300, 4000]",
        "--frequency.torque_count",
        "3",
        "--frequency.noise_time",
        "7",
    ]
    assert cli.main(["frequency", "--quick", "--out", str(tmp_path), *words]) == 0
    done = capsys.readouterr()
    assert "C14" in done.out and "largest relative difference" in done.out
    assert "Successive windows agree within 1e-05" in done.out and "a quick run" in done.out
    data = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert data["quick"] is True and not {"realisations", "friction_models"} & set(data)
    assert {len(curve["omega_rad_s"]) for curve in data["curves"]} == {6}
    assert 1 not in data["measurement"]["unsteady"]
    names = [
        "fig05_gain",
        "fig06_gain_with_friction",
        "fig07_position_error",
        "fig08_phase",
        "fig09_torque",
        "fig10_noise",
    ]
    assert {path.name for path in tmp_path.iterdir()} - {OWN} == {f"{n}.{s}" for n in names for s in ("png", "svg")} | {
        "summary.json",
        "frequency.nc",
        "claims.md",
    }


def test_two_runs_do_not_share_a_folder(tmp_path, capsys):
    """A quick and a full run at once in out/frequency, say, would leave figures of one beside the summary of the other."""
    words = ["frequency", "--quick", "--quiet", "--out", str(tmp_path / "new"), "--one_dof.k_v=0"]
    with sole_use(tmp_path / "new"):
        assert cli.main(words) == 2
        assert "new' is in use by another run" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
    assert (
        cli.main(words) == 3 and "unstable" in capsys.readouterr().err
    )  # the folder is free, and left as it was found
    assert not list(tmp_path.iterdir())


def test_no_order_of_options_loses_quick():
    groups = [
        ["--quick"],
        ["--quiet"],
        ["--out", "a.b/c"],
        ["--scenario=d.yaml"],
        ["--frequency.count", "3"],
        ["--frequency.lowest=2"],
    ]
    for order in itertools.permutations(groups):
        rest, overrides = split_overrides(["frequency", *itertools.chain(*order)])
        assert parser().parse_args(rest).quick is True and overrides == {
            "frequency.count": "3",
            "frequency.lowest": "2",
        }
    for word in (
        "--qui",
        "--quic",
        "--quick=yes",
        "--full",
    ):  # no abbreviation, no value, nothing unknown is passed over
        with pytest.raises(InputError):
            parser().parse_args(["frequency", word])
    assert parser().parse_args(["frequency", "--quiet"]).quick is False


def test_a_quick_run_leaves_no_trace_in_the_next(tmp_path, monkeypatch):
    """Neither what a run is told nor the scenario it was given changes by running."""
    before = dict(frequency.QUICK), PAPER.model_dump()
    seen = []

    def stop(laboratory, progress):
        seen.append(laboratory.study)
        raise SimulationError("seen enough")

    monkeypatch.setattr(realisations, "measure_all", stop)
    other = PAPER.with_overrides({"frequency.omega": [2.0, 20.0], "frequency.count": 5})
    for scenario, quick in ((PAPER, True), (PAPER, False), (other, True), (PAPER, True)):
        with pytest.raises(SimulationError, match="seen enough"):
            frequency.run(scenario, tmp_path, quick=quick)
    assert [(study.lowest, study.count) for study in seen] == [(1.0, 24), (0.1, 64), (0.1, 5), (1.0, 24)]
    assert before == (frequency.QUICK, PAPER.model_dump())
