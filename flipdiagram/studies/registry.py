"""The studies, a record each.  A new one: a folder beside these with run, figures and tables, and its record here."""

from __future__ import annotations

from pathlib import Path

from flipdiagram.studies.study import ARCHITECTURE, JOBS, Later, Option, Study, flag, positive

_READ = "results.summaries"
_MAPS = "disturbance, payload, clearance, gains, cone, inertia, sensing, variations (all)"
_EXPORT = "write a campaign.sqlite as .csv, .parquet or .nc"
_LOOK = ("run", "instead")
_FILE = Option("file", to=_LOOK, nargs="?", metavar="FILE", help="the campaign as YAML, see examples/campaign.yaml")
_SCHEDULER = Option("--scheduler", metavar="ADDRESS", help="a Dask scheduler, such as tcp://127.0.0.1:8786")
_ANALYSE = "analyse a campaign.sqlite again into --out"

STUDIES = {
    study.name: study
    for study in (
        Study(
            "plan",
            command="plan",
            text="Plan the motion only: summary, plan and figure.",
            run=Later("studies.plan.run:run"),
            figures=Later("studies.plan.figures:write_figures"),
            tables=Later("studies.plan.tables:tables"),
            read=Later(f"{_READ}:plan"),
        ),
        Study(
            "turnover",
            command="flip",
            text="Plan the motion and simulate it under each controller.",
            run=Later("studies.turnover.run:run"),
            figures=Later("studies.turnover.figures:write_figures"),
            tables=Later("studies.turnover.tables:tables"),
            read=Later(f"{_READ}:turnover"),
            instead=Later("studies.turnover.run:show_live"),
            options=(
                Option(*ARCHITECTURE.names, to=_LOOK, **ARCHITECTURE.settings),
                flag("--quick", "shorter hold, no snapshots and replay", to=("run", "figures")),
                flag("--meshcat", "watch the simulation in a browser, at half speed", to=("instead",)),
                flag("--no-replay", "no snapshots and no replay.html", to=("figures",)),
                JOBS,
            ),
        ),
        Study(
            "frequency",
            command="frequency",
            text="Measure gain, phase, error, torque and noise of the 1-DOF loop.",
            run=Later("studies.frequency.run:run"),
            figures=Later("studies.frequency.figures:write_figures"),
            tables=Later("studies.frequency.tables:tables"),
            read=Later(f"{_READ}:frequency"),
            stored=Later("studies.frequency.run:stored"),
            alone=True,
            written=lambda summary, out: (
                f"{summary['channel_steps'] / 1e6:.0f} M channel-steps in {summary['seconds']:.1f} s; written to {out}"
            ),
            options=(flag("--quick", "fewer frequencies, no table of realisations"),),
        ),
        Study(
            "experiment",
            command="experiment",
            text="Fly eight starts under each controller and judge E1-E8.",
            run=Later("studies.experiment.run:run"),
            figures=Later("studies.experiment.figures:write_figures"),
            tables=Later("studies.experiment.tables:tables"),
            read=Later(f"{_READ}:experiment"),
            options=(
                Option("--starts", nargs="+", type=float, metavar="M", help="starts on y [m] (0 0.02 ... 0.14)"),
                ARCHITECTURE,
                flag("--quick", "two starts only"),
                JOBS,
            ),
        ),
        Study(
            "borders",
            command="borders",
            text="Map where each controller stops working.",
            run=Later("studies.borders.run:run"),
            figures=Later("studies.borders.figures:write_figures"),
            tables=Later("studies.borders.tables:tables"),
            read=Later(f"{_READ}:borders"),
            options=(
                Option("--maps", nargs="+", metavar="MAP", help=_MAPS),
                Option("--resolution", type=positive, metavar="N", help="points per axis (5 or 6)"),
                flag("--quick", "two maps of two points per axis"),
                JOBS,
            ),
        ),
        Study(
            "replanning",
            command="replanning",
            text="Fly disturbed flips planned once, and again and again.",
            run=Later("studies.replanning.run:run"),
            tables=Later("studies.replanning.tables:tables"),
            read=Later(f"{_READ}:replanning"),
            options=(flag("--quick", "two disturbances only"), JOBS),
        ),
        Study(
            "place",
            command="place",
            text="Lay the object down: it slides off the tilted spatula.",
            run=Later("studies.place.run:run"),
            figures=Later("studies.place.figures:write_figures"),
            tables=Later("studies.place.tables:tables"),
            read=Later(f"{_READ}:place"),
            success=("object", "laid down"),
            options=(ARCHITECTURE, flag("--no-replay", "no replay.html", to=("figures",)), JOBS),
        ),
        Study(
            "campaign",
            command="campaign",
            text="Fly thousands of uncertain flips: how often does each work?",
            run=Later("studies.campaign:fly"),
            tables=Later("studies.campaign:tables"),
            read=Later(f"{_READ}:campaign"),
            instead=Later("studies.campaign:show"),
            otherwise={"tune": "tuning"},
            options=(
                _FILE,
                flag("--resume", "go on with what --out holds: fly what is missing"),
                _SCHEDULER,
                flag("--yes", "even if it takes longer than limit_hours"),
                flag("--any-version", "go on although code or versions have changed"),
                flag("--tune", "search the gains of the file's section `tune` instead", to=()),
                Option("--watch", to=("instead",), type=Path, metavar="FILE", help="show a running campaign.sqlite"),
                Option("--analyse", to=_LOOK, type=Path, metavar="FILE", help=_ANALYSE),
                Option("--export", to=("instead",), type=Path, nargs=2, metavar=("FILE", "TO"), help=_EXPORT),
                JOBS,
            ),
        ),
        Study(
            "tuning",
            text="Search the gains that work most often.",
            file="tuning.json",
            run=Later("studies.campaign:tune"),
            tables=Later("studies.campaign:tuning_tables"),
            read=Later(f"{_READ}:tuning"),
            options=(_FILE, _SCHEDULER, JOBS),
        ),
        Study(
            "report",
            command="report",
            text="Run or reuse all studies; every claim measured, on one page.",
            run=Later("report.report:run"),
            tables=Later("report.claims:tables"),
            read=Later(f"{_READ}:report"),
            written=lambda summary, out: f"written to {out / 'report.html'} and {out / 'report.md'}",
            options=(flag("--quick", "under two minutes: coarse, two starts, few maps"), JOBS),
        ),
    )
}
"""By the name in their schema."""
COMMANDS = {
    command: study for study in STUDIES.values() if (command := study.name if study.command is None else study.command)
}
"""By the name of their command, in the order of the help."""
