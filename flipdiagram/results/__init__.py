"""Results for use in scripts and notebooks: `import flipdiagram.results` gives recordings the accessor `flip`.

    from flipdiagram.results import compare, info, open_result

    recording = open_result("out/turnover/pd+ff+dob.nc")   # an xarray.Dataset
    recording.flip.plot("v")                               # Matplotlib axes
    recording.flip.to_csv("flip.csv")                      # or to_parquet, to_frame
    compare("out/turnover/pd+dob.nc", recording)           # shows itself in a notebook

A bad input ends in a one-line InputError.
"""

from flipdiagram.results.accessor import FlipAccessor
from flipdiagram.results.comparing import compare
from flipdiagram.results.comparison import Comparison, SignalDifference
from flipdiagram.results.differences import Change
from flipdiagram.results.info import info
from flipdiagram.results.opening import open_campaign, open_result
from flipdiagram.results.running import run_study

__all__ = [
    "Change",
    "Comparison",
    "FlipAccessor",
    "SignalDifference",
    "compare",
    "info",
    "open_campaign",
    "open_result",
    "run_study",
]
