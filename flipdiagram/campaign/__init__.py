"""Thousands of flips over what is uncertain: specified, flown, analysed, watched, tuned.

`specification_file`, `checks`, `specification`: what is asked.  `run`: it is flown, by `flips.driver`.  `dataset`,
`analysis`, `sensitivity`, `statistics`: what its file says.  `watch` and `tuner` on top.
"""
