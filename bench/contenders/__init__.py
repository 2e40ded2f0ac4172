"""The same loop elsewhere: a file each, with `NAME`, `PACKAGE` (of its distribution, or None) and `prepare`.

`prepare(numbers, omega, ticks, log)` gives a `Stepper` (bench.one_dof) for the channels `omega` [rad/s]: what it does
before is not timed, what the stepper does is.
"""

MODULES = ("hand_written", "simulator", "bdsim_loop", "pathsim_loop", "control_loop", "jaxonomy_loop")
