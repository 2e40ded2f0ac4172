"""The claims C1–C14 and the realisations of the observer as tables for a terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from flipdiagram.files import write_atomically
from flipdiagram.grid import Grid
from flipdiagram.studies.frequency.claims import TEXTS, Claim
from flipdiagram.studies.frequency.periodicity import Verdict
from flipdiagram.studies.frequency.realisations import best
from flipdiagram.studies.frequency.run import FrequencyResult


def claims_table(result: FrequencyResult) -> Table:
    """One row per claim: what the paper says, whether it holds, and the numbers measured."""
    settings = result.measured.settings
    title = (
        f"m = {settings.mass:g} kg, k_p = {settings.k_p:g}, k_v = {settings.k_v:g}, g_dis = {settings.g_dis:g} rad/s;"
        f" observer with m_n/m = {settings.nominal_mass_ratio:g}; {settings.friction_model} friction"
    )
    table = Table(title=title, title_justify="left")
    for heading in ("", "figure", "claim", "holds", "measured"):
        table.add_column(heading, no_wrap=heading in ("", "figure", "holds"))
    for claim in result.claims:
        holds = "[green]yes[/]" if claim.holds else "[red]no[/]"
        table.add_row(claim.id, FIGURES[claim.id], TEXTS[claim.id], holds, numbers(claim))
    return table


def realisation_table(result: FrequencyResult) -> Table:
    """One row per realisation of the observer, one column per claim, x where it holds."""
    chosen = best(result.rows)
    table = Table(title=f"realisations of the observer; most claims hold with {chosen.name}", title_justify="left")
    table.add_column("realisation", no_wrap=True)
    for name in TEXTS:
        table.add_column(name, justify="center", no_wrap=True)
    table.add_column("hold", justify="right")
    for row in result.rows:
        marks = ["[green]x[/]" if claim.holds else "[red]·[/]" for claim in row.claims]
        table.add_row(row.name + (" (some unstable)" if row.unstable else ""), *marks, str(row.count))
    return table


def write_markdown(result: FrequencyResult, out: Path) -> Path:
    """Both tables as Markdown in `out`/claims.md, as the README shows them."""
    lines = ["| | figure | claim | holds | measured |", "| --- | --- | --- | --- | --- |"]
    for claim in result.claims:
        holds = "yes" if claim.holds else "no"
        lines.append(f"| {claim.id} | {FIGURES[claim.id]} | {TEXTS[claim.id]} | {holds} | {numbers(claim)} |")
    text = "\n".join(lines) + "\n"
    if result.rows:
        text += "\n" + realisations_grid([row.as_dict() for row in result.rows]).markdown()
    text += "\n" + steadiness(result) + "\n"
    return write_atomically(out / "claims.md", text)


def steadiness(result: FrequencyResult) -> str:
    """How many responses missed the criterion of steadiness, by how much, and what they do instead, in a line."""
    found, tolerance = result.unsteady, result.measured.study.tolerance
    if not found:
        return f"Successive windows agree within {tolerance:g} for every response."
    count = Counter(entry["verdict"] for entry in found)
    doing = "; ".join(f"{count[name]} {text}" for name, text in VERDICTS.items() if count[name])
    spread, fundamental = (max(entry[key] for entry in found) for key in ("spread", "spread_of_fundamental"))
    return (
        f"Successive windows agree within {tolerance:g} for every response but {len(found)}, which differ by up to"
        f" {spread:.2g}, in the fundamental by up to {fundamental:.2g}: {doing} (summary.json lists them)."
    )


def realisations_grid(rows: Sequence[Mapping[str, Any]]) -> Grid:
    """The realisations of the observer from a summary: how many claims hold, and which do not."""
    texts = []
    for row in rows:
        failed = ", ".join(name for name, holds in row["holds"].items() if not holds) or "none"
        note = " (some loops unstable)" if row["unstable"] else ""
        texts.append([row["name"] + note, str(sum(row["holds"].values())), failed])
    headings = ["realisation of the observer", "claims that hold", "claims that do not"]
    return Grid(headings, texts, right=headings[1:2])


def numbers(claim: Claim) -> str:
    """What was measured for a claim, in a line."""
    if "unstable" in claim.measured:
        return str(claim.measured["unstable"])
    return _SENTENCES[claim.id](claim.measured)


def _n(value: float | None) -> str:
    return "beyond the range" if value is None else f"{value:.4g}"


def _row(values: list[float | None]) -> str:
    return " → ".join(_n(value) for value in values)


def _moved(m: dict[str, Any]) -> str:
    if "too_few_g_dis" in m:
        return f"ω = {m['omega_rad_s']:g}: too few stable g_dis"
    both = ", ".join(f"{name} {_row(m[f'{name}_N'])} N" for name in ("pd+dob", "pd+ff+dob"))
    return f"ω = {m['omega_rad_s']:g}, g_dis {_row(m['g_dis_rad_s'])} rad/s: {both}"


def _friction(m: dict[str, Any]) -> str:
    each = ", ".join(f"{name} {_n(gain['with_friction'])}" for name, gain in m["gain_at_lowest"].items())
    return f"gain at {m['omega_rad_s']:g} rad/s: {each}; {_n(m['gain_at_lowest']['pd']['without'])} without friction"


VERDICTS: dict[Verdict, str] = {
    "periodic": "settled and periodic once a period is a whole number of ticks",
    "subharmonic": "repeating only after several windows",
    "settling": "still settling (raise frequency.most_windows)",
    "not periodic": "not periodic",
}
"""What each verdict means, in the words of `steadiness`."""
FIGURES = dict(zip(TEXTS, "5 5 5 6 7 7 8a 8b 8b 9a 9c 9a-c 10 10".split(), strict=True))
_SENTENCES = {
    "C1": lambda m: f"gain {_n(m['gain_at_lowest'])} at the lowest ω, -3 dB at {_n(m['bandwidth_rad_s'])} rad/s",
    "C2": lambda m: f"-3 dB {_n(m['pd_rad_s'])} → {_n(m['pd+dob_rad_s'])} rad/s",
    "C3": lambda m: f"-3 dB {_n(m['pd+ff_rad_s'])}, with DOB {_n(m['pd+ff+dob_rad_s'])} ({m['highest_rad_s']:g} rad/s)",
    "C4": _friction,
    "C5": lambda m: (
        f"{_n(m['pd_at_lowest_m'])} → {_n(m['pd+dob_at_lowest_m'])} m at the lowest ω;"
        f" × {_n(m['largest_ratio_above_g_dis'])} at {_n(m['at_rad_s'])} rad/s"
    ),
    "C6": lambda m: (
        f"{_n(m['pd+ff_at_lowest_m'])} m, with DOB {_n(m['pd+ff+dob_at_lowest_m'])} m;"
        f" at {_n(m['high_rad_s'])} rad/s {_n(m['pd+ff_at_high_m'])} m, PD {_n(m['pd_at_high_m'])} m"
    ),
    "C7": lambda m: f"lag below 10° up to {_row(m['band_rad_s'])} rad/s for g_dis {_row(m['g_dis_rad_s'])}",
    "C8": lambda m: (
        f"{_n(m['pd_rad_s'])} → {_n(m['pd+ff_rad_s'])}, with DOB"
        f" {_n(m['pd+dob_rad_s'])} → {_n(m['pd+ff+dob_rad_s'])} rad/s"
    ),
    "C9": lambda m: f"{_n(57.29578 * m['lead_rad'])}° at {_n(m['at_rad_s'])} rad/s",
    "C10": _moved,
    "C11": _moved,
    "C12": lambda m: (
        "torque with FF / without, at most: "
        + ", ".join(f"{_n(ratio)} at {omega}" for omega, ratio in m["largest_ratio_by_omega_rad_s"].items())
        + f" rad/s; smaller only below √(2 k_p) = {_n(m['smaller_below_rad_s'])} rad/s"
    ),
    "C13": lambda m: f"× {_row(m['largest_ratio_to_pd'])} of PD's at most, for g_dis {_row(m['g_dis_rad_s'])} rad/s",
    "C14": lambda m: f"largest relative difference {_n(m['largest_relative_difference'])}",
}
