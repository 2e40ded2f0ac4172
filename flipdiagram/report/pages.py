"""The text of the report.  Every number in it comes from the studies' summaries."""

from collections.abc import Mapping

from flipdiagram.report.claims import claims_grid
from flipdiagram.report.contents import with_contents
from flipdiagram.report.findings import border_sentences, fragile_sentence, lead_sentence
from flipdiagram.report.sources import model_grid, scenario_grid
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.borders.tables import border_grid, variation_grid
from flipdiagram.studies.experiment.tables import engine_grid, runs_grid
from flipdiagram.studies.frequency.tables import realisations_grid
from flipdiagram.studies.place.tables import tables as place_tables
from flipdiagram.studies.replanning.tables import tables as replanning_tables
from flipdiagram.studies.study import Summary

FREQUENCY_FIGURES = (
    ("fig05_gain", "Fig. 5: gain without friction"),
    ("fig06_gain_with_friction", "Fig. 6: gain with friction"),
    ("fig07_position_error", "Fig. 7: position error"),
    ("fig08_phase", "Fig. 8: phase"),
    ("fig09_torque", "Fig. 9: maximum torque"),
    ("fig10_noise", "Fig. 10: noise gain"),
)
EXPERIMENT_FIGURES = (
    ("fig13_all_starts", "Fig. 13, all starts: paths of the control point; ×: the block is lost"),
    ("fig14_all_starts", "Fig. 14, all starts: velocities"),
    ("fig15_all_starts", "Fig. 15, all starts: accelerations"),
    ("by_start", "Errors, torque and delay by start; open marks: the block was lost"),
    ("cone_use", "Friction cone used, planned and realised; at 1 the block slides"),
)
PLACE_FIGURES = (
    ("contact_states", "Sliding angle, slide on the blade and contact states of eqs. (7)–(9) (the paper's Fig. 2)"),
    ("path", "Paths of the tool and of the block"),
)
REPLANNING = (
    "Disturbed flips with the plan made once, and with the rest of the motion planned again while the block is on the"
    " blade: every 20 ms, with more or fewer samples too, every millisecond, and with a camera; then random worlds."
    " With feed-forward the plan starts from the measured tool, without it from the command: there the error is what"
    " accelerates the arm."
)
PLACE = "Beyond the paper: the block is let slide off the tilted blade, eq. (8), to lie flat within 2 cm of a target."
QUICK = "> **A quick report**: coarse, two starts, few maps. Run `flipdiagram report` for the numbers to quote.\n"


def page(summary: Summary, studies: Mapping[str, Summary], scenario: Scenario, further: str = "") -> str:
    """The report as Markdown; pictures by their paths below the report's folder; further: sections of other studies."""
    experiment, borders = studies["experiment"], studies["borders"]
    parts = [
        "# Reproduction report: a robot arm turns a block over",
        QUICK if summary["quick"] else "",
        _versions(summary),
        "## Every claim of the paper",
        _counts(summary),
        claims_grid(summary, commands=True).markdown(),
        "## Section III: what each block does",
        _observer(summary),
        realisations_grid(summary["realisations"]).markdown() if summary["realisations"] else "",
        _pictures("frequency", FREQUENCY_FIGURES),
        "## Section IV: the experiment",
        runs_grid(experiment).section(),
        _pictures("experiment", EXPERIMENT_FIGURES),
        "## Where each controller stops working",
        border_grid(borders).section(),
        lead_sentence(borders),
        *(_map(a_map) for a_map in borders["maps"]),
        "## Is it physics or the solver?",
        fragile_sentence(borders, experiment),
        variation_grid(borders).section(),
        engine_grid(experiment).section(),
        "## What planning again buys",
        REPLANNING,
        *(grid.section() for grid in replanning_tables(studies["replanning"])),
        "## Laying the block down",
        PLACE,
        *(grid.section() for grid in place_tables(studies["place"])),
        _pictures("place", PLACE_FIGURES),
        further,
        "## What is assumed",
        "Every field of the scenario; the studies above change only the fields that they name.",
        scenario_grid(scenario).markdown(),
        "The arm's numbers and the other models, with their sources:",
        model_grid().markdown(),
        "## To reproduce",
        _commands(summary),
    ]
    text = "\n\n".join(part.strip("\n") for part in parts if part) + "\n"
    return with_contents(text)


def _versions(summary: Summary) -> str:
    v = summary["versions"]
    return (
        f"flipdiagram {v['flipdiagram']}, Drake {v['drake']}, Python {v['python']}. "
        "Every number below was measured by the run that wrote this page."
    )


def _counts(summary: Summary) -> str:
    claims = summary["claims"]
    held, failed, open_ = ([e["id"] for e in claims if e["holds"] is holds] for holds in (True, False, None))
    parts = [f"{len(held)} of {len(claims)} claims hold in this physics"]
    parts += [f"{', '.join(failed)} do not"] if failed else []
    parts += [f"{', '.join(open_)} could not be judged"] if open_ else []
    return "; ".join(parts) + "."


def _observer(summary: Summary) -> str:
    o = summary["observer"]
    cutoff = o["velocity_cutoff_rad_s"]
    velocity = "exact velocity" if cutoff is None else f"velocity filtered at {cutoff:g} rad/s"
    scaled = "scaled by the nominal mass" if o["reference_scaled_by_nominal_mass"] else "with the true mass"
    more = "; which claims hold under which:" if summary["realisations"] else "."
    return (
        f"Observer realised with nominal-mass ratio r = {o['nominal_mass_ratio']:g}, {velocity}, reference force"
        f" {scaled}. The textbook observer (r = 1, exact velocity) does not change the response to commands at all, so"
        " some claims need another realisation" + more
    )


def _map(a_map: Summary) -> str:
    axes = f"{a_map['x']['label']} × {a_map['y']['label']}"
    lines = [f"### {a_map['title']}", a_map["question"], _picture("borders", f"map_{a_map['name']}", axes)]
    return "\n\n".join([*lines, border_sentences(a_map)])


def _pictures(study: str, figures: tuple[tuple[str, str], ...]) -> str:
    return "\n\n".join(_picture(study, name, text) for name, text in figures)


def _picture(study: str, name: str, text: str) -> str:
    return f"![{text}]({study}/{name}.png)\n\n*{text}*"


def _commands(summary: Summary) -> str:
    flag = " --quick" if summary["quick"] else ""
    return (
        f"`flipdiagram report{flag}` writes this page. One row of a table: `flipdiagram frequency`, "
        "`flipdiagram experiment`, `flipdiagram borders --maps NAME`; one cell of a map or one variation: "
        "`flipdiagram flip` with the fields it sets as options, listed under `overrides` in `borders/summary.json`."
    )
