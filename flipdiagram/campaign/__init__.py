"""Thousands of flips over what is uncertain: specified, run on processes or Dask, kept, analysed, watched, tuned.

`checks`, `specification`: what is asked.  `children`, `engines`, `cluster`, `running`, `conduct`: how it is run.
`opening`, `results`: where it is kept.  `dataset`, `analysis`, `sensitivity`, `statistics`: what it says.  `watch` and
`tuner` on top.  Nothing is imported here: worker processes import from this package what they need and no more.
"""
