"""The claims C1–C14 and the realisations of the observer as tables."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from flipdiagram.grid import Grid, verdict
from flipdiagram.studies.frequency.claims import TEXTS
from flipdiagram.studies.frequency.periodicity import Verdict
from flipdiagram.studies.study import Summary


def tables(summary: Summary) -> list[Grid | str | None]:
    """What a terminal shows."""
    rows = summary.get("realisations")
    holding = holding_grid(rows, summary["best_realisation"]) if rows else None
    quick = "a quick run: fewer frequencies, no table of realisations" if summary["quick"] else None
    return [claims_grid(summary), holding, steadiness(summary), quick]


def claims_grid(summary: Summary) -> Grid:
    """One row per claim: what the paper says, whether it holds, and the numbers measured."""
    settings = summary["scenario"]["one_dof"]
    title = (
        f"m = {settings['mass']:g} kg, k_p = {settings['k_p']:g}, k_v = {settings['k_v']:g},"
        f" g_dis = {settings['g_dis']:g} rad/s; observer with m_n/m = {settings['nominal_mass_ratio']:g};"
        f" {settings['friction_model']} friction"
    )
    rows = [
        [claim["id"], FIGURES[claim["id"]], TEXTS[claim["id"]], verdict(claim["holds"]), numbers(claim)]
        for claim in summary["claims"]
    ]
    return Grid(["", "figure", "claim", "holds", "measured"], rows, title, whole=["", "figure", "holds"])


def holding_grid(rows: Sequence[Mapping[str, Any]], best: str) -> Grid:
    """One row per realisation of the observer, one column per claim, x where it holds."""
    title = f"realisations of the observer; most claims hold with {best}"
    texts = []
    for row in rows:
        marks = ["x" if row["holds"][name] else "·" for name in TEXTS]
        texts.append([row["name"] + (" (some unstable)" if row["unstable"] else ""), *marks, str(row["holding"])])
    headings = ["realisation", *TEXTS, "hold"]
    return Grid(headings, texts, title, ["hold"], centred=list(TEXTS), whole=headings[:-1], good=("x",), bad=("·",))


def markdown(summary: Summary) -> str:
    """Claims, realisations and steadiness as Markdown, as the README shows them."""
    parts = [claims_grid(summary).markdown()]
    if "realisations" in summary:
        parts.append(realisations_grid(summary["realisations"]).markdown())
    return "\n".join([*parts, steadiness(summary) + "\n"])


def steadiness(summary: Summary) -> str:
    """How many responses missed the criterion of steadiness, by how much, and what they do instead, in a line."""
    unsteady, tolerance = summary["measurement"]["unsteady"], summary["measurement"]["tolerance"]
    if not unsteady:
        return f"Successive windows agree within {tolerance:g} for every response."
    count = Counter(entry["verdict"] for entry in unsteady)
    doing = "; ".join(f"{count[name]} {text}" for name, text in VERDICTS.items() if count[name])
    spread, fundamental = (max(entry[key] for entry in unsteady) for key in ("spread", "spread_of_fundamental"))
    return (
        f"Successive windows agree within {tolerance:g} for every response but {len(unsteady)}, which differ by up to"
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


def numbers(claim: Mapping[str, Any]) -> str:
    """What was measured for a claim of summary.json, in a line."""
    measured = claim["measured"]
    return str(measured["unstable"]) if "unstable" in measured else _SENTENCES[claim["id"]](measured)


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
