"""The maps of the pancake as tables, and where a second engine says otherwise."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flipdiagram.flips.outcome import MODES, SUCCESS
from flipdiagram.grid import Grid
from flipdiagram.simulation.lying import FOLDED, NEAR
from flipdiagram.studies.study import Summary


def tables(summary: Summary) -> list[Grid | str | None]:
    """What a terminal shows."""
    quick = "a quick run: a coarse mesh and few worlds" if summary["quick"] else None
    return [outcome_grid(summary), map_grid(summary), plan_grid(summary), *_second_engine(summary), quick]


def outcome_grid(summary: Summary) -> Grid:
    """How the flips of each architecture ended, how far they bent, how fast they were simulated.

    A flip may lie as it should in the end and fail all the same: the pancake left the blade before that had turned.
    """
    runs = summary["runs"]
    modes = [mode for mode in MODES if mode == SUCCESS or any(run["outcome"] == mode for run in runs)]
    rows = []
    for name in summary["architectures"]:
        mine = [run for run in runs if run["architecture"] == name]
        ended = Counter(run["outcome"] for run in mine)
        numbers = [_median(mine, "largest_deformation_energy_J", 1000, 1), _median(mine, "max_slip_m", 100, 1)]
        numbers += [_median(mine, "away_m", 100, 1), _median(mine, "real_time_factor", 1, 2)]
        lie = sum(run.get("turned_share", 0) >= 1 - FOLDED and run["away_m"] <= NEAR for run in mine)
        rows.append([f"`{name}`", str(len(mine)), *(str(ended[mode]) for mode in modes), str(lie), *numbers])
    medians = ["energy [mJ]", "slip [cm]", "from target [cm]", "real-time factor"]
    headings = ["architecture", "flips", *modes, "lie as wanted", *medians]
    return Grid(headings, rows, "how the flips ended; medians of energy of deformation, slip, …", headings[1:])


def map_grid(summary: Summary) -> Grid:
    """A row for each architecture, thickness and friction, a column for each Young's modulus."""
    runs, moduli = summary["runs"], axis(summary, "youngs_modulus_Pa")
    found = {(r["architecture"], r["thickness_m"], r["friction"], r["youngs_modulus_Pa"]): r["outcome"] for r in runs}
    rows = []
    for name, t, mu in dict.fromkeys(key[:3] for key in sorted(found, key=lambda k: (_rank(summary, k[0]), *k[1:3]))):
        place = [f"`{name}`", f"{1000 * t:g}", f"{mu:g}"]
        rows.append([*place, *(found[name, t, mu, E] for E in moduli)])
    headings = [f"E = {pascal(E)}" for E in moduli]
    return Grid(["architecture", "thickness [mm]", "friction", *headings], rows, "what became of each pancake", keys=3)


def plan_grid(summary: Summary) -> Grid:
    """Where the plan of each friction lands, which it shares with all moduli: little friction leaves it no choice."""
    target, rows = summary["scenario"]["task"]["target_y"], {}
    for run in summary["runs"]:
        if run.get("planned_touchdown_y_m") is not None:
            away = 100 * abs(run["planned_touchdown_y_m"] - target)
            numbers = [f"{away:.1f}", f"{run['planned_touchdown_angle_rad']:.2f}"]
            rows[run["thickness_m"], run["friction"]] = numbers
    headings = ["thickness [mm]", "friction", "from target [cm]", "angle [rad]"]
    lines = [[f"{1000 * t:g}", f"{mu:g}", *numbers] for (t, mu), numbers in sorted(rows.items())]
    return Grid(headings, lines, "where the plan lands the rigid object", headings, keys=2)


def axis(summary: Summary, name: str) -> list[float]:
    """The values of an axis of the map, the least first."""
    return sorted({run[name] for run in summary["runs"]})


def pascal(modulus: float) -> str:
    """'20 kPa'."""
    return f"{modulus / 1e6:g} MPa" if modulus >= 1e6 else f"{modulus / 1e3:g} kPa"


def _rank(summary: Summary, name: str) -> int:
    return int(summary["architectures"].index(name))


def _median(runs: Sequence[Mapping[str, Any]], name: str, factor: float, digits: int) -> str:
    values = [run[name] for run in runs if run.get(name) is not None]
    return f"{factor * float(np.median(values)):.{digits}f}" if values else "–"


def _second_engine(summary: Summary) -> list[Grid | str]:
    if "no_second_engine" in summary:
        return [f"no second engine: {summary['no_second_engine']}"]
    entry, rows = summary["agreement"], summary["second_engine"]
    counts = [
        ["turned over in Drake", str(entry["both"]), str(entry["only_drake"])],
        ["not in Drake", str(entry["only_mujoco"]), str(entry["neither"])],
    ]
    headings = ["", "turned over in MuJoCo", "not in MuJoCo"]
    said = f"MuJoCo says the same of {entry['same']} of {entry['flips']} flips"
    if entry["rate"] is not None:
        said += f", {100 * entry['rate']:.0f} % ({100 * entry['low']:.0f}–{100 * entry['high']:.0f} %)"
    lost = [row["mujoco"]["failure"] for row in rows if not row["judged"]]
    said += f"; {len(lost)} not judged, the first: {lost[0]}" if lost else ""
    differ = [row for row in rows if row["judged"] and row["drake"]["success"] != row["mujoco"]["success"]]
    return [Grid(headings, counts, right=headings[1:]), said, _medians(rows), _differing(differ)]


def _medians(rows: Sequence[Mapping[str, Any]]) -> Grid:
    """How far apart the engines are, over the flips that both turned over, and over the others."""
    both = [row["drake"]["success"] and row["mujoco"]["success"] for row in rows]
    lines = []
    for name, chosen in (("turned over in both", True), ("others", False)):
        of = [row["difference"] for row, won in zip(rows, both, strict=True) if won is chosen and row["judged"]]
        lines.append([name, str(len(of)), *(_spread(of, *shown) for shown in _DIFFERENCES.values())])
    return Grid(["flips", "number", *_DIFFERENCES], lines, "MuJoCo less Drake: median of the size (largest)")


_DIFFERENCES = {
    "touch-down [ms]": ("touchdown_time_s", 1000, 1),
    "its angle [rad]": ("touchdown_angle_rad", 1, 3),
    "final centre [mm]": ("final_centre_m", 1000, 1),
}


def _spread(of: Sequence[Mapping[str, Any]], name: str, factor: float, digits: int) -> str:
    values = [factor * abs(entry[name]) for entry in of if entry[name] is not None]
    return f"{np.median(values):.{digits}f} ({max(values):.{digits}f})" if values else "–"


def _differing(rows: Sequence[Mapping[str, Any]]) -> Grid:
    lines = []
    for row in rows:
        place = [f"`{row['architecture']}`", f"{1000 * row['thickness_m']:g}", f"{row['friction']:g}"]
        place.append(pascal(row["youngs_modulus_Pa"]))
        said = [row[engine]["failure"] or row[engine]["outcome"] for engine in ("drake", "mujoco")]
        lines.append([*place, *said, *(_spread([row["difference"]], *shown) for shown in _DIFFERENCES.values())])
    headings = ["architecture", "thickness [mm]", "friction", "E", "Drake", "MuJoCo", *_DIFFERENCES]
    return Grid(headings, lines, f"flips of which they do not say the same ({len(rows)})", keys=4)
