"""The rows of a horizon and the arm's motion along it, by loops that numba compiles: the same as NumPy's, sooner.

``linearisation`` holds it together; ``rows`` makes the constraints' rows, ``along`` follows the trajectory with the
arm, by the kinematics in ``chain`` and the Newton-Euler equations in ``dynamics``.  All import numba: import them only
where they are used.
"""
