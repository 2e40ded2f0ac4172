"""A running campaign seen from another process: a table, refreshed until it ends; once where nobody watches."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from flipdiagram.campaign.statistics import wilson
from flipdiagram.flips.outcome import MODES, NOT_PHYSICS, SUCCESS
from flipdiagram.flips.store_file import is_running, open_to_read
from flipdiagram.grid import Grid

if TYPE_CHECKING:
    from rich.console import Console

REFRESH = 1.0
"""Seconds between two looks."""


def status_grid(path: str | Path) -> tuple[Grid, bool]:
    """How far a campaign is, and whether it has all its flips; raises InputError for a file of something else."""
    path = Path(path)
    with open_to_read(path) as results:
        specification, counts, pace = results.specification or {}, results.counts(), results.pace()
    names = specification["architectures"]
    trials = int(specification["trials"])
    by_name = {name: {o: count for a, o, count in counts if a == name} for name in names}
    failures = [mode for mode in MODES if mode != SUCCESS and any(mode in modes for modes in by_name.values())]
    rows = []
    for name in names:
        modes = by_name[name]
        done = sum(modes.values())
        counted = done - sum(modes.get(mode, 0) for mode in NOT_PHYSICS)
        low, high = wilson(modes.get(SUCCESS, 0), counted)
        rate = f"{100 * modes.get(SUCCESS, 0) / counted:.0f} % ({100 * low:.0f}–{100 * high:.0f})" if counted else "–"
        rows.append([f"`{name}`", f"{done}/{trials}", rate, *(str(modes.get(mode, 0)) for mode in failures)])
    total, done = trials * len(names), sum(count for _, _, count in counts)
    headings = ["architecture", "flips", "turned over", *failures]
    title = f"{path.name}: {_pace(total, done, pace, is_running(path))}"
    return Grid(headings, rows, title, headings[1:]), done >= total


def _pace(total: int, done: int, pace: tuple[int, float, float], running: bool) -> str:
    count, seconds, latest = pace
    text = f"{done} of {total} flips"
    if done >= total:
        return f"{text}, finished {time.strftime('%Y-%m-%d %H:%M', time.localtime(latest))}"
    if not running:
        return f"{text}, not running: --resume goes on"
    if count > 1 and seconds > 0:
        rate = (count - 1) / seconds
        left = int((total - done) / rate)
        text += f", {60 * rate:.0f} a minute, {left // 3600}:{left // 60 % 60:02d}:{left % 60:02d} left"
    return text


def watch(path: str | Path, screen: Console) -> None:
    """Show a campaign on a terminal until all its flips are there or nothing runs; once into a file or pipe."""
    from rich.live import Live

    grid, done = status_grid(path)
    if not screen.is_terminal:
        screen.print(grid.rich())
        return
    with Live(grid.rich(), console=screen, auto_refresh=False) as live:
        while not done and is_running(Path(path)):
            time.sleep(REFRESH)
            grid, done = status_grid(path)
            live.update(grid.rich(), refresh=True)
        live.update(status_grid(path)[0].rich(), refresh=True)
