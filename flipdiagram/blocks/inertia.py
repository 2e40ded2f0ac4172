"""The box M_n of Fig. 4: from the acceleration asked for to a torque."""

from numpy.typing import ArrayLike

from flipdiagram.arrays import Array
from flipdiagram.blocks._checks import nominal_inertia, times_inertia
from flipdiagram.blocks.block import Block, convertible


def reference_torque(inertia: Array, qdd_ref: Array) -> Array:
    """tau_ref = M_n qdd_ref [N m], shape (n,); M_n [kg m^2] a diagonal (n,) or a matrix (n, n), qdd_ref [rad/s^2]."""
    return times_inertia(inertia, qdd_ref)


@convertible()
class NominalInertia(Block):
    """Nominal inertia of n channels: tau_ref = M_n qdd_ref (Fig. 4 of the paper).

    `inertia` M_n [kg m^2] (or [kg]) is a numeric parameter of the Context: the diagonal, shape (n,), or a symmetric
    positive definite matrix, shape (n, n), stored row by row.
    Input `qdd_ref` [rad/s^2], output `tau_ref` [N m]: shape (n,).
    """

    def __init__(self, inertia: ArrayLike) -> None:
        n = self.parameter("inertia", inertia, check=nominal_inertia)
        self.input("qdd_ref", n)
        self.output("tau_ref", n, reference_torque)
