"""A campaign's analysis as tables and as a section of Markdown."""

from collections import Counter
from collections.abc import Mapping
from typing import Any

from flipdiagram.campaign.sensitivity import TARGETS, strength
from flipdiagram.flips.outcome import NOT_PHYSICS, SUCCESS
from flipdiagram.grid import Grid, number
from flipdiagram.scenario.scenario import with_unit

Summary = Mapping[str, Any]

FIGURES = (
    ("campaign_success", "Success rates with 95 % intervals (Wilson), and what became of the other flips"),
    ("campaign_sensitivity", "What matters: share of the variance of the ranks that goes with each parameter"),
    ("campaign_map", "Success over the two parameters that matter most"),
    ("campaign_errors", "Position error and torque of all flips, as shares of flips below a value"),
)
QUANTITIES = (
    ("position_rmse_m", 100, 2, "position RMSE [cm]"),
    ("angle_rmse_rad", 1, 3, "angle RMSE [rad]"),
    ("acceleration_rmse_m_s2", 1, 2, "acceleration RMSE [m/s²]"),
    ("max_slip_m", 1000, 1, "slip [mm]"),
    ("torque_use", 1, 2, "torque over limit"),
)
"""Metric, factor, digits and heading of each column of quantiles."""
SHOWN = 3
"""Parameters named in the table of what matters."""


def success_grid(summary: Summary) -> Grid:
    """Success rate and failures of each architecture."""
    modes = Counter[str]()
    for entry in summary["architectures"].values():
        modes.update(entry["modes"])
    failures = [mode for mode, _ in modes.most_common() if mode != SUCCESS]
    rows = []
    for name, entry in summary["architectures"].items():
        rate = "–" if entry["rate"] is None else f"{100 * entry['rate']:.1f} %"
        interval = f"{100 * entry['low']:.1f}–{100 * entry['high']:.1f} %"
        counts = [str(entry["modes"].get(mode, 0)) for mode in failures]
        saturated = "–" if entry["saturated"] is None else f"{100 * entry['saturated']:.0f} %"
        rows.append([f"`{name}`", str(entry["counted"]), rate, interval, *counts, saturated])
    headings = ["architecture", "flips", SUCCESS, "95 % interval (Wilson)", *failures, "a joint at its torque limit"]
    return Grid(headings, rows, right=headings[1:])


def pair_grid(summary: Summary) -> Grid:
    """Differences between architectures over the same trials; no rows with one architecture."""
    rows = []
    for pair in summary["pairs"]:
        names, points = f"`{pair['first']}` − `{pair['second']}`", f"{100 * pair['difference']:+.1f}"
        counts = [str(pair[name]) for name in ("trials", "first_only", "second_only")]
        interval = f"{100 * pair['low']:+.1f} to {100 * pair['high']:+.1f}"
        rows.append([names, counts[0], points, interval, *counts[1:], _p(pair["p_holm"])])
    headings = ["difference", "trials", "points", "95 % interval", "only the first", "only the second"]
    headings.append("p (McNemar, Holm)")
    return Grid(headings, rows, right=headings[1:])


def sensitivity_grid(summary: Summary) -> Grid:
    """The parameters that say most about success, position error and torque; those beyond chance only."""
    rows = []
    for name, targets in summary["sensitivity"].items():
        for target, words in TARGETS.items():
            known = [entry for entry in targets[target] if entry["explained"] is not None]
            beyond = [entry for entry in known if strength(entry) > summary["chance"]][:SHOWN]
            text = ", ".join(f"`{entry['parameter']}` {_strength(entry)}" for entry in beyond)
            rows.append([f"`{name}`", words, text or ("none" if known else "never varies, or too few flips")])
    words = "parameters, the strongest first: share of the rank variance (rank correlation)"
    title = f"what matters, beyond the {100 * summary['chance']:.0f} % that come about by chance"
    return Grid(["architecture", "of", words], rows, title)


def sobol_grid(summary: Summary) -> Grid:
    """Sobol indices of success; no rows unless the sampler allows them."""
    rows = [
        [f"`{name}`", f"`{entry['parameter']}`", f"{entry['first']:.2f}", f"{entry['total']:.2f}"]
        for name, indices in summary["sobol"].items()
        for entry in sorted(indices, key=lambda entry: -entry["total"])
    ]
    headings = ["architecture", "parameter", "first", "total"]
    return Grid(headings, rows, "Sobol indices of success", headings[2:])


def quantile_grid(summary: Summary) -> Grid:
    """Median and 95 % quantile of errors and torque, of all flips that flew."""
    rows = []
    for name, entry in summary["architectures"].items():
        cells = (_quantiles(entry["quantiles"][metric], factor, digits) for metric, factor, digits, _ in QUANTITIES)
        rows.append([f"`{name}`", *cells])
    headings = ["architecture", *(heading for *_, heading in QUANTITIES)]
    return Grid(headings, rows, "median (95 % quantile) of all flips that flew", headings[1:])


def section(summary: Summary, folder: str = "") -> str:
    """The analysis as Markdown, for a page whose pictures lie below `folder`."""
    uncounted = sum(entry["flips"] - entry["counted"] for entry in summary["architectures"].values())
    intro = (
        f"{summary['flips']} flips: {summary['trials']} trials drawn by `{summary['sampler']}` over"
        f" {', '.join(f'`{name}`' for name in summary['parameters'])}, the same for every architecture."
    )
    if uncounted:
        kinds = ", ".join(NOT_PHYSICS)
        intro += f" {uncounted} that ended by {kinds} say nothing about a controller and are not counted."
    prefix = f"{folder}/" if folder else ""
    pictures = [f"![{text}]({prefix}{name}.png)\n\n*{text}*" for name, text in FIGURES if name in summary["figures"]]
    tables = [success_grid, pair_grid, quantile_grid, sensitivity_grid, sobol_grid]
    parts = [intro, *(grid(summary).section() for grid in tables), *pictures]
    return "\n\n".join(part.strip("\n") for part in parts if part) + "\n"


def tuning_grid(tuning: Summary) -> Grid:
    """Default gains against tuned ones, on the trials of the search and on the held-out ones."""
    both = ("default", "tuned")
    rows = [
        [f"`{with_unit(name)}`", *(number(values[side]) for side in both)] for name, values in tuning["gains"].items()
    ]
    for part, words in (("search", "search"), ("held_out", "held out")):
        sides = [tuning[part][side] for side in both]
        rows.append([f"{SUCCESS}, {words} ({tuning[part]['trials']} trials)", *map(_rate, sides)])
        rows.append([f"{tuning['quantile_name']}, {words}", *(number(side["quantile"]) for side in sides)])
    rows.append(["what became of the others, held out", *(_failures(side["modes"]) for side in sides)])
    held = tuning["held_out"]["difference"]
    interval = f"({100 * held['low']:+.1f} to {100 * held['high']:+.1f})"
    text = f"{100 * held['difference']:+.1f} {interval}, p {_p(held['p'])}"
    rows.append(["tuned − default, held out [points]", "", text])
    headings = [f"`{tuning['architecture']}`", *both]
    return Grid(headings, rows, right=headings[1:])


def tuning_section(tuning: Summary) -> str:
    """The tuner's result as Markdown."""
    text = (
        f"{tuning['flips']} flips in the search, {tuning['candidates']} sets of gains, wanted is {tuning['objective']};"
        " the verdict is that of the held-out trials, which the search has not seen. In brackets: 95 % intervals,"
        " of rates Wilson's, of their difference Newcombe's for pairs; p is McNemar's. A quantile that falls on failed"
        " flips is –."
    )
    return f"{text}\n\n{tuning_grid(tuning).markdown()}"


def _strength(entry: Mapping[str, Any]) -> str:
    rho = "" if entry["rho"] is None else f" ({entry['rho']:+.2f})"
    return f"{100 * strength(entry):.0f} %{rho}"


def _quantiles(values: Mapping[str, float] | None, factor: float, digits: int) -> str:
    if values is None:
        return "–"
    return f"{factor * values['0.5']:.{digits}f} ({factor * values['0.95']:.{digits}f})"


def _failures(modes: Mapping[str, int]) -> str:
    failures = sorted((mode for mode in modes if mode != SUCCESS), key=lambda mode: -modes[mode])
    return ", ".join(f"{modes[mode]} {mode}" for mode in failures) or "–"


def _rate(side: Mapping[str, Any]) -> str:
    return f"{100 * side['rate']:.1f} % ({100 * side['low']:.1f}–{100 * side['high']:.1f})"


def _p(value: float) -> str:
    return "< 0.001" if value < 0.001 else f"{value:.3f}"
