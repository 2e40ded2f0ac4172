"""The studies, a record each.  A new one: a folder beside these with run, figures and tables, and its record here."""

from pathlib import Path
from typing import Any

from flipdiagram.scenario.work import frequency_work, place_work
from flipdiagram.studies.study import ARCHITECTURE, JOBS, JSON, YES, Later, Option, Study, flag, nothing, positive

_MAPS = "disturbance, payload, clearance, gains, cone, inertia, sensing, variations (all)"
_EXPORT = "write a campaign.sqlite as .csv, .parquet or .nc"
_LOOK = ("run", "first")
_FILE = Option("file", to=_LOOK, nargs="?", metavar="FILE", help="the campaign as YAML, see examples/campaign.yaml")
_VIDEO = "the flips side by side as .gif or .webp (DIR/flip.gif)"
_VIDEO_FILE = Later("rendering.video:video_file")
_SCHEDULER = Option("--scheduler", metavar="ADDRESS", help="a Dask scheduler, such as tcp://127.0.0.1:8786")
_ANALYSE = "analyse a campaign.sqlite again into --out"


def _study(name: str, text: str, *options: Option, **more: Any) -> Study:
    """A record whose functions stand in the study's own folder, save those that are given."""
    parts: dict[str, Any] = {"run": Later(f"studies.{name}.run:run"), "tables": Later(f"studies.{name}.tables:tables")}
    parts |= {"figures": Later(f"studies.{name}.figures:write_figures"), "read": Later(f"results.summaries:{name}")}
    return Study(name, text, options=options, **{"command": name} | parts | more)


_RECORDS = (
    _study("plan", "Plan the motion only: summary, plan and figure."),
    _study(
        "turnover",
        "Plan the motion and simulate it under each controller.",
        Option(*ARCHITECTURE.names, to=_LOOK, **ARCHITECTURE.settings),
        flag("--quick", "shorter hold, no snapshots and replay", to=("run", "figures")),
        flag("--meshcat", "show the simulation in a browser first, at half speed", to=("first",)),
        flag("--no-replay", "no snapshots and no replay.html", to=("figures",)),
        Option("--video", to=("figures",), nargs="?", type=_VIDEO_FILE, const=True, metavar="FILE", help=_VIDEO),
        JOBS,
        command="flip",
        first=Later("studies.turnover.run:show_live"),
    ),
    _study(
        "frequency",
        "Measure gain, phase, error, torque and noise of the 1-DOF loop.",
        flag("--quick", "fewer frequencies, no table of realisations"),
        stored=Later("studies.frequency.run:stored"),
        work=frequency_work,
        written=lambda summary, out: (
            f"{summary['channel_steps'] / 1e6:.0f} M channel-steps in {summary['seconds']:.1f} s; written to {out}"
        ),
    ),
    _study(
        "experiment",
        "Fly eight starts under each controller and judge E1-E8.",
        Option("--starts", nargs="+", type=float, metavar="M", help="starts on y [m] (0 0.02 ... 0.14)"),
        ARCHITECTURE,
        flag("--quick", "two starts only"),
        JOBS,
    ),
    _study(
        "borders",
        "Map where each controller stops working.",
        Option("--maps", nargs="+", metavar="MAP", help=_MAPS),
        Option("--resolution", type=positive, metavar="N", help="points per axis (5 or 6)"),
        flag("--quick", "two maps of two points per axis"),
        JOBS,
    ),
    _study(
        "replanning",
        "Fly disturbed flips planned once, and again and again.",
        flag("--quick", "two disturbances only"),
        JOBS,
        figures=nothing,
    ),
    _study(
        "engines",
        "Fly a campaign's worlds in Drake and in MuJoCo: do they agree?",
        Option("file", nargs="?", metavar="FILE", help="the campaign as YAML, see examples/campaign.yaml"),
        YES,
        JOBS,
    ),
    _study(
        "pancake",
        "Map where the rigid plan stops working for a pancake that bends.",
        ARCHITECTURE,
        Option("--moduli", nargs="+", type=float, metavar="PA", help="Young's moduli [Pa] (1e4 5e4 2e5 1e6)"),
        Option("--frictions", nargs="+", type=float, metavar="MU", help="friction coefficients (0.3 0.45 0.6 1.0)"),
        Option("--thicknesses", nargs="+", type=float, metavar="M", help="thicknesses [m] (the scenario's)"),
        flag("--quick", "two by two pancakes only, of the coarsest mesh"),
        JOBS,
        success=("pancake", "turned over"),
    ),
    _study(
        "calibrate",
        "Find the worlds that explain what the paper measured.",
        Option("file", nargs="?", metavar="FILE", help="priors as YAML, see examples/calibration.yaml"),
        _SCHEDULER,
        YES,
        JOBS,
    ),
    _study(
        "inverse",
        "Search worlds in which only the observers keep the block.",
        Option("file", nargs="?", metavar="FILE", help="the box of worlds as YAML, see examples/inverse.yaml"),
        _SCHEDULER,
        YES,
        JOBS,
    ),
    _study(
        "place",
        "Lay the object down: it slides off the tilted spatula.",
        ARCHITECTURE,
        flag("--no-replay", "no replay.html", to=("figures",)),
        JOBS,
        success=("object", "laid down"),
        work=place_work,
    ),
    _study(
        "campaign",
        "Fly thousands of uncertain flips: how often does each work?",
        _FILE,
        flag("--resume", "go on with what --out holds: fly what is missing"),
        _SCHEDULER,
        YES,
        flag("--any-version", "go on although code or versions have changed"),
        flag("--tune", "search the gains of the file's section `tune` instead", to=()),
        Option("--watch", to=("first",), type=Path, metavar="FILE", help="show a running campaign.sqlite"),
        Option("--analyse", to=_LOOK, type=Path, metavar="FILE", help=_ANALYSE),
        Option("--export", to=("first",), type=Path, nargs=2, metavar=("FILE", "TO"), help=_EXPORT),
        flag("--salvage", "of a damaged file export what is sound", to=("first",)),
        JSON,
        JOBS,
        run=Later("campaign.study:fly"),
        figures=nothing,
        tables=Later("campaign.study:tables"),
        first=Later("campaign.study:show"),
        otherwise={"tune": "tuning"},
    ),
    _study(
        "tuning",
        "Search the gains that work most often.",
        _FILE,
        _SCHEDULER,
        JOBS,
        command="",
        file="tuning.json",
        run=Later("campaign.study:tune"),
        figures=nothing,
        tables=Later("campaign.study:tuning_tables"),
    ),
    _study(
        "challenge",
        "Enter a controller of your own: its score in frozen worlds.",
        Option("file", nargs="?", metavar="FILE", help="the entry as a Python file, see --template"),
        flag("--template", "print an entry to begin with", to=("first",)),
        Option("--suites", nargs="+", metavar="SUITE", help="nominal, uncertain, disturbed, hard (all)"),
        Option("--engines", nargs="+", metavar="E", help="referees: drake, mujoco (those installed)"),
        Option("--seed-file", metavar="FILE", help="the organiser's secret: held-out worlds beside the public ones"),
        Option("--against", metavar="DIR", help="compare with the entries whose summaries are in DIR"),
        Option("--leaderboard", to=(), type=Path, metavar="DIR", help="make the page of the entries in DIR instead"),
        flag("--no-replay", "no replays of the leaderboard's entries", to=()),
        JSON,
        JOBS,
        first=Later("studies.challenge.ask:show"),
        otherwise={"leaderboard": "leaderboard"},
        work=lambda scenario: {},
    ),
    _study(
        "leaderboard",
        "The page of all entries.",
        Option("--leaderboard", type=Path, metavar="DIR"),
        flag("--no-replay", "", to=("figures",)),
        Option("--jobs", to=("figures",)),
        command="",
        file="leaderboard.json",
        run=Later("studies.challenge.leaderboard:run"),
        figures=Later("studies.challenge.leaderboard:write_figures"),
        tables=Later("studies.challenge.leaderboard:tables"),
        read=Later("results.summaries:challenge"),
        written=lambda summary, out: f"written to {out / 'leaderboard.md'} and {out / 'index.html'}",
    ),
    _study(
        "report",
        "Run or reuse all studies; every claim measured, on one page.",
        flag("--quick", "under two minutes: coarse, two starts, few maps"),
        JOBS,
        run=Later("report.report:run"),
        figures=nothing,
        tables=Later("report.claims:tables"),
        written=lambda summary, out: f"written to {out / 'report.html'} and {out / 'report.md'}",
    ),
)
STUDIES = {study.name: study for study in _RECORDS}
"""By the name in their schema."""
COMMANDS = {study.command: study for study in _RECORDS if study.command}
"""By the name of their command, in the order of the help."""
