"""The accessor `flip` of recordings: figures, metrics, scenario, export."""

import json
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd  # type: ignore[import-untyped]  # pandas-stubs may be missing
import xarray as xr
from matplotlib.axes import Axes

from flipdiagram.errors import InputError
from flipdiagram.figures.deformation import plot_deformation
from flipdiagram.files import atomic_path
from flipdiagram.results import plots
from flipdiagram.results.signals import components
from flipdiagram.scenario import scenario
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.simulation.metrics import FlipMetrics
from flipdiagram.simulation.placement import PlaceMetrics, measure_by_kind
from flipdiagram.simulation.recording_files import check_recording


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

    def margins(self, ax: Sequence[Axes] | None = None) -> Sequence[Axes]:
        """Cone use [1], centre of pressure [mm], normal force [N], slip [mm] while carried, planned and realised."""
        return plots.plot_margins(check_recording(self._data), ax)

    def deformation(self, ax: Sequence[Axes] | None = None) -> Sequence[Axes]:
        """How a pancake bent, in six panels: energy [mJ], contact with blade and table [cm²], overhang [%] over time,
        and its section along the middle, the outline [m] and the deflection [mm], from release to landing.

        InputError where the recording is of a rigid block.
        """
        data = check_recording(self._data)
        return plot_deformation({data.attrs["architecture"]: data}, ax)

    def metrics(self) -> FlipMetrics | PlaceMetrics:
        """What `flipdiagram flip` measures of the recording, or `flipdiagram place` where that recorded it."""
        return measure_by_kind(check_recording(self._data))

    @property
    def scenario(self) -> Scenario:
        """The scenario that was simulated; InputError where the Dataset keeps none or another version's."""
        text = self._data.attrs.get("scenario")
        if not text:
            valid = "a recording with attribute 'scenario'"
            raise InputError(f"this Dataset keeps no scenario; valid is {valid}", field="scenario", valid=valid)
        return scenario.from_yaml(str(text), "scenario of the recording")

    def to_frame(self) -> pd.DataFrame:
        """One row a sample, index time [s], columns `x_y`, `tau_S`, …; their units in attrs["units"].

        The recording's own attributes stand beside them.
        """
        data = check_recording(self._data)
        parts = components(data)
        index = pd.Index(data["time"].values, name="time")
        frame = pd.DataFrame({part.name: part.values for part in parts}, index=index)
        frame.attrs = {str(name): np.asarray(value).tolist() for name, value in data.attrs.items()}
        frame.attrs["units"] = {"time": "s"} | {part.name: part.attrs["units"] for part in parts}
        return frame

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write CSV, whole or not at all: a header 'time [s],x_y [m],…', then a row a sample; nan is an empty cell.

        Numbers have as many digits as it takes to read them back exactly.  Returns the path.  InputError where it
        cannot write.
        """
        frame = self.to_frame()
        headings = [f"{name} [{frame.attrs['units'][name]}]" for name in frame.columns]
        with atomic_path(path) as temporary:
            frame.to_csv(temporary, header=headings, index_label="time [s]", lineterminator="\n")
        return Path(path)

    def to_parquet(self, path: str | os.PathLike[str]) -> Path:
        """Write Parquet, whole or not at all; `pandas.read_parquet` gives `to_frame` back, units included.

        Each column's field metadata has its 'units' too, for readers other than pandas.  Returns the path.  InputError
        where it cannot write, and where pyarrow is missing: pip install 'flipdiagram[parquet]'.
        """
        frame = self.to_frame()
        try:
            import pyarrow as pa  # type: ignore[import-untyped]  # has no type information
            from pyarrow import parquet
        except ImportError:
            install = "pip install 'flipdiagram[parquet]'"
            message = f"Parquet needs pyarrow, which is not installed; install it with: {install}"
            raise InputError(message, field="pyarrow", valid=install) from None
        table = pa.Table.from_pandas(frame).select(["time", *frame.columns])  # else the index comes last
        units = frame.attrs["units"]
        fields = [table.schema.field(name).with_metadata({"units": units[name]}) for name in table.column_names]
        # where pandas looks for the attributes of a frame
        metadata = {**table.schema.metadata, b"PANDAS_ATTRS": json.dumps(frame.attrs).encode()}
        with atomic_path(path) as temporary:
            parquet.write_table(table.cast(pa.schema(fields, metadata=metadata)), temporary)
        return Path(path)
