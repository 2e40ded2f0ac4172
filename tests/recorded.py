"""The body of a summary.json of every study, from what a full run wrote into docs/report wherever it stands there."""

import json
from functools import lru_cache
from pathlib import Path

from flipdiagram.files import write_summary
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.challenge.score import problems, scores
from flipdiagram.studies.experiment.claims import MEASURED

REPORT = Path(__file__).parent.parent / "docs" / "report" / "summary.json"
MODES = {"turned over": 3, "slid later": 1}
RATE = {"rate": 0.75, "low": 0.3, "high": 0.95, "modes": MODES}


@lru_cache
def report():
    return json.loads(REPORT.read_text(encoding="utf-8"))


def experiment():
    written = report()
    claims = [
        {"id": c["id"], "text": c["claim"], "holds": c["holds"], "measured": c["measured"], "paper": c["paper"]}
        | {"numbers": {}, "difference": c["remark"]}
        for c in written["claims"]
        if c["id"].startswith("E")
    ]
    parts = dict(written["experiment"])
    parts["runs"] = [run | {new: run[old] for old, new in MEASURED.items() if new not in run} for run in parts["runs"]]
    if isinstance(parts["second_engine"], dict):  # of the report's last run, some versions ago
        parts["second_engine"] = parts["second_engine"]["runs"]
    return {"quick": False, "claims": claims, **parts}


def turnover():
    runs = [run for run in experiment()["runs"] if run["start_y_m"] == 0.0]
    more = [{"real_time_factor": 1.0, "recording": f"{run['architecture']}.nc"} for run in runs]
    return {"plan": runs[0]["plan"], "runs": [{**run, **extra} for run, extra in zip(runs, more, strict=True)]}


def borders():
    written = report()["borders"]
    return {"quick": False, "maps": written["maps"][:2], "variations": written["variations"][:3]}


def frequency():
    curve = {"architecture": "pd", "g_dis_rad_s": None, "friction": False, "omega_rad_s": [1.0, 2.0]}
    torque = {"architecture": "pd", "omega_rad_s": 10.0, "g_dis_rad_s": [3.0, 30.0]}
    return {
        "quick": False,
        "curves": [curve | {"figure": "5", "unit": "1", "value": [1.0, 0.9], "theory": [1.0, 0.9]}],
        "torque": [torque | {"figure": "9a", "max_torque_N": [1.0, 2.0], "theory": [1.0, 2.0]}],
        "claims": [{"id": "C14", "claim": "", "holds": True, "measured": {"largest_relative_difference": 0.0}}],
        "measurement": {"unsteady": [], "tolerance": 1e-5},
        "channel_steps": 2e6,
        "seconds": 1.0,
    }


def campaign():
    """As the analysis of four trials of two architectures writes it."""
    levels = {"0.05": 0.001, "0.5": 0.002, "0.95": 0.004}
    entry = {"flips": 4, "counted": 4, "successes": 3, "saturated": 0.0, **RATE}
    entry["quantiles"] = {"position_rmse_m": levels, "angle_rmse_rad": levels, "max_slip_m": None}
    pair = {"first": "pd+ff+dob", "second": "pd", "trials": 4, "first_only": 3, "second_only": 0}
    pair |= {"difference": 0.75, "low": 0.1, "high": 0.9, "p": 0.2, "p_holm": 0.2}
    lost = entry | {"successes": 0, "rate": 0.0, "low": 0.0, "high": 0.49, "modes": {"struck the table": 4}}
    return {"trials": 4, "flips": 8, "architectures": {"pd": lost, "pd+ff+dob": entry}, "pairs": [pair]}


def tuning():
    side = {"quantile": 0.004, **RATE}
    sides = {"trials": 4, "default": side, "tuned": side}
    difference = {"difference": 0.1, "low": -0.1, "high": 0.3, "p": 0.5}
    return {
        "architecture": "pd+ff+dob",
        "objective": "the highest success rate",
        "quantile_name": "90 % quantile of position_rmse_m",
        "candidates": 20,
        "flips": 80,
        "best": 3,
        "gains": {"controller.k_p": {"default": 350.0, "tuned": 900.0}},
        "search": sides,
        "held_out": sides | {"difference": difference},
        "history": [side | {"gains": {"controller.k_p": 350.0}, "score": 0.7}],
    }


def engines():
    """As two campaigns of four trials compare: one flip differs."""
    entry = {"counted": 4, "equal": 3, "rate": 0.75, "low": 0.3, "high": 0.95, "turned_over": [3, 2]}
    entry["outcomes"] = [{"pair": ["turned over", "turned over"], "flips": 2}, {"pair": ["slid later"] * 2, "flips": 1}]
    differ = {"trial": 2, "architecture": "pd", "outcomes": ["turned over", "slid later"]}
    return {
        "engines": ["drake", "mujoco"],
        "trials": 4,
        "architectures": {"pd": entry, "pd+ff+dob": entry | {"equal": 4, "rate": 1.0, "turned_over": [3, 3]}},
        "differ": [differ | {"values": {"object.friction": 0.9}}],
        "parameters": [{"name": "object.friction", "equal": 1.4, "other": 0.9, "p": 0.1, "p_holm": 0.1}],
    }


def pancake():
    """As two worlds under one architecture give it: the second engine says otherwise of one."""
    place = {"friction": 0.6, "thickness_m": 0.012, "architecture": "pd"}
    flown = {k: v for k, v in turnover()["runs"][0].items() if k not in ("plan", "recording")}
    runs = [
        {**flown, **place, "youngs_modulus_Pa": E, "overrides": {"object.youngs_modulus": E}, "outcome": "turned over"}
        | {"success": True, "failure": None, "largest_deformation_energy_J": 0.01, "away_m": 0.02}
        for E in (1e4, 1e6)
    ]
    won = {"outcome": "turned over", "success": True, "failure": None}
    lost = {"outcome": "folded", "success": False, "failure": "folded, 9 % of its upper face look up"}
    difference = {"touchdown_time_s": 0.01, "touchdown_angle_rad": -0.1, "final_centre_m": 0.02}
    rows = [
        {**place, "youngs_modulus_Pa": E, "drake": won, "mujoco": said, "difference": difference, "judged": True}
        for E, said in ((1e4, lost), (1e6, won))
    ]
    counts = {"flips": 2, "same": 1, "both": 1, "only_drake": 1, "only_mujoco": 0, "neither": 0}
    body = {"quick": False, "architectures": ["pd"], "runs": runs, "second_engine": rows}
    return body | {"agreement": {**counts, "rate": 0.5, "low": 0.09, "high": 0.91}}


def calibrate():
    """As four worlds of two unknowns give it."""
    numbers = [{"name": "position RMSE, mean over the starts", "unit": "cm", "paper": 1.1, "tolerance": 0.15}]
    unknown = {"source": "", "posterior": [0.2, 0.4, 0.6], "rejection": [0.1, 0.4, 0.7], "base": 0.1}
    names = ("joint_friction.coulomb", "object.mass")
    return {
        "worlds": 4,
        "starts_y_m": [0.0, 0.14],
        "rounds": [{"distance": 2.0, "size": 3.0, "kept": 0.5}],
        "unknowns": [{"name": name, "prior": {"uniform": [0.0, 1.0]}, **unknown} for name in names],
        "draws": {"u": [[0.2, 0.5], [0.4, 0.6], [0.6, 0.1]], "weight": [0.3, 0.4, 0.3], "distance": [1.0, 1.5, 2.0]},
        "predictions": [
            row | {"prior": [0.3, 0.9, 2.0], "posterior": [1.0, 1.1, 1.3], "scenarios": {"median": 1.05}}
            for row in numbers
        ],
        "claim_shares": [{"id": "E2", "posterior": 1.0, "prior": 0.5, "scenarios": {"median": True}}],
        "recovered": {"worlds": 2, "coverage": 0.75, "unknowns": dict(zip(names, (0.5, 1.0), strict=True))},
        "held_out": [
            {"name": "position RMSE, last start", "paper": 1.18, "interval": [1.0, 1.1, 1.4], "inside": True},
            {"name": "E5", "paper": True, "share": 0.9},
        ],
        "pairs": [{"first": "E3", "second": "E7", "alone": [2, 2], "both": 0, "expected": 1.0, "lift": 0.0}],
    }


def inverse():
    """As three worlds give it, none of which fits."""
    flip = {
        "outcome": "struck the table",
        "failure": "struck the table at 0.2 s, dropped at 0.3 s",
        "max_slip_m": 0.004,
    }
    world = {"trial": 1, "passed": 0, "values": {"object.friction": 1.5}, "flips": {"pd": flip}}
    stages = [("pd", ["slid at the start", "slid later"], 3), ("pd+ff", ["slid at the start", "slid later"], 0)]
    stages += [("pd+dob", ["turned over"], 0), ("pd+ff+dob", ["turned over"], 0)]
    rows = [{"architecture": name, "wanted": wanted, "flown": n, "went": 0, "modes": {}} for name, wanted, n in stages]
    found = {"worlds": 3, "found": 0, "rate": 0.0, "low": 0.0, "high": 0.56}
    return found | {"stages": rows, "worlds_found": [], "region": [], "smallest": None, "nearest": [world]}


def challenge():
    """As an entry that fails in one of two worlds."""
    flips = [
        {"kind": "public", "suite": "nominal", "index": k, "hash": f"{k:016x}", "engine": "drake"}
        | {"outcome": mode, "failure": failure, "landing_cost_J": 0.7, "compute_p99_s": 1e-3, "noise_gain_Nms": 2.0}
        for k, (mode, failure) in enumerate([("turned over", None), ("crashed", "crashed: 'mine.py', line 2: …")])
    ]
    entry = {"name": "mine", "author": "", "reference": "", "file": "mine.py", "digest": "0" * 64}
    return {
        "entry": entry | {"kinds": ["control"], "settings": {}},
        "suite": {"version": "v1", "digest": "1" * 64},
        "held_out": None,
        "code": "",
        "of": {"flipdiagram": "0.1.0", "drake": "1.51.1"},
        "scores": scores(flips),
        "problems": problems(flips),
        "flips": flips,
        "against": [],
    }


def leaderboard():
    entry = challenge()
    return {"folder": "entries", "entries": [{k: entry[k] for k in ("entry", "suite", "held_out", "of", "scores")}]}


NO_WORLDS: dict = {"count": 0, "vary": [], "entries": []}

BODIES = {
    "turnover": turnover,
    "frequency": frequency,
    "experiment": experiment,
    "borders": borders,
    "replanning": lambda: {"quick": False, "cases": {}, "ways": {}, "worlds": NO_WORLDS, **report()["replanning"]},
    "place": lambda: report()["place"],
    "engines": engines,
    "pancake": pancake,
    "calibrate": calibrate,
    "inverse": inverse,
    "challenge": challenge,
    "leaderboard": leaderboard,
    "campaign": campaign,
    "tuning": tuning,
    "report": lambda: {key: value for key, value in report().items() if key not in ("schema", "versions", "scenario")},
}
"""By study; a plan is a file beside its summary, so it is run."""


def write(study, folder, body=None):
    """The summary file of a study in a folder, written as the study writes it; body: another than the recorded one."""
    return write_summary(folder / study.file, study.name, Scenario(), BODIES[study.name]() if body is None else body)
