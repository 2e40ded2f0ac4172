"""The accessor `flip` of recordings: figures, metrics, scenario, export."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import pandas as pd  # type: ignore[import-untyped]  # pandas-stubs may be missing
import xarray as xr
from matplotlib.axes import Axes

from flipdiagram.errors import InputError
from flipdiagram.results import frame, plots
from flipdiagram.results.signals import check_recording
from flipdiagram.scenario import scenario
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation import metrics
from flipdiagram.simulation.metrics import FlipMetrics


@xr.register_dataset_accessor("flip")
class FlipAccessor:
    """What one can do with a recording; every method raises InputError where the Dataset is none."""

    def __init__(self, data: xr.Dataset) -> None:
        self._data = data

    def plot(
        self, signal: str = "x", ax: Axes | Sequence[Axes] | None = None, *, window: tuple[float, float] | None = None
    ) -> Axes | Sequence[Axes]:
        """A signal over time, its command (`<signal>_cmd`) beside it where there is one, a panel a component.

        signal: 'x', 'tau', 'sliding_angle', …, or one component, 'x_y', 'tau_S'.  ax: the panels to draw into, else
        a new Figure.  window: from and until [s], by default the motion.  Release and touch-down are marked.
        Returns the Axes, a list where there are several.  InputError for an unknown signal or too few axes.
        """
        return plots.plot_signal(check_recording(self._data), signal, ax, window)

    def path(self, ax: Axes | None = None) -> Axes:
        """The path of the control point in the y–z plane [m], its command, and the block's centre in flight."""
        return plots.plot_path(check_recording(self._data), ax)

    def margins(self, axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
        """Cone use [1], centre of pressure [mm], normal force [N], slip [mm] while carried, planned and realised."""
        return plots.plot_margins(check_recording(self._data), axes)

    def metrics(self) -> FlipMetrics:
        """What `flipdiagram flip` measures of the recording."""
        return metrics.measure(check_recording(self._data))

    @property
    def scenario(self) -> Scenario:
        """The scenario that was simulated; InputError where the Dataset keeps none or another version's."""
        text = self._data.attrs.get("scenario")
        if not text:
            raise InputError("this Dataset keeps no scenario; valid is a recording with attribute 'scenario'")
        return scenario.from_yaml(str(text), "scenario of the recording")

    def to_frame(self) -> pd.DataFrame:
        """One row a sample, index time [s], columns `x_y`, `tau_S`, …; their units in attrs["units"]."""
        return frame.to_frame(check_recording(self._data))

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write CSV with a header 'time [s],x_y [m],…'; returns the path.  InputError where it cannot write."""
        return frame.to_csv(check_recording(self._data), path)

    def to_parquet(self, path: str | os.PathLike[str]) -> Path:
        """Write Parquet that `pandas.read_parquet` reads back with units; returns the path.

        InputError where it cannot write, and where pyarrow is missing: pip install 'flipdiagram[parquet]'.
        """
        return frame.to_parquet(check_recording(self._data), path)
