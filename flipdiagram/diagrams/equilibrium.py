"""Where an endless hold ends: the arm at rest under its load, and every state of the controller where it stays."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, OutputPort, System

from flipdiagram.arrays import Floats
from flipdiagram.errors import NoEquilibriumError, first_line

AT_REST = 1e-7
"""Largest torque [N m] without a counterpart, and largest change of a state in one period, in the state's own unit."""
VALID = "valid is simulation.start: hold or switch-on, or a controller that can hold the arm"


@dataclass(frozen=True)
class Equilibrium:
    """Joint angles q (n,) [rad], and the discrete and continuous states of the boxes that have any, by name."""

    q: Floats
    states: Mapping[str, Floats]

    def put(self, boxes: Mapping[str, System], context: Context) -> None:
        """Set the states in a root Context."""
        for name, values in self.states.items():
            _set_state(boxes[name].GetMyMutableContextFromRoot(context), values)


def equilibrium(
    boxes: Mapping[str, System],
    tau: OutputPort,
    context: Context,
    stand: Callable[[Context, Floats], None],
    holding_torque: Callable[[Floats], Floats],
    q: Floats,
) -> Equilibrium:
    """Solve tau(q, w) = holding_torque(q), w[k+1] = w[k] for the joint angles q and the states w of the boxes.

    It asks nothing of the boxes but that their states lie in the Context, so it serves boxes of anybody.

    Args:
        boxes: those of the controller, by name.
        tau: what the controller sends (n,) [N m].
        context: of the whole diagram, with commands that hold the start; it is changed.
        stand: puts the arm at rest at angles q (n,) [rad] into the context, with sensors that have seen it for long.
        holding_torque: what holds the arm and its load still at q (n,) [N m].
        q: where the search starts (n,) [rad].

    Raises NoEquilibriumError where there is none: a joint that is too weak, a state that never comes to rest.
    """
    from scipy.optimize import root  # a tenth of a second, and a drawing does without

    mine = {name: box.GetMyMutableContextFromRoot(context) for name, box in boxes.items()}
    initial = {name: state for name, own in mine.items() if (state := _state(own)).size}
    sizes = [len(q), *(len(state) for state in initial.values())]
    splits = np.cumsum(sizes)[:-1]
    sender = tau.get_system().GetMyContextFromRoot(context)

    def residual(unknown: Floats) -> Floats:
        angles, *states = np.split(unknown, splits)
        stand(context, angles)
        for name, values in zip(initial, states, strict=True):
            _set_state(mine[name], values)
        moves = [_change(boxes[name], mine[name]) for name in initial]
        return np.concatenate([tau.Eval(sender) - holding_torque(angles), *moves])

    try:
        begin = np.concatenate([q, *initial.values()])
        found = root(residual, begin, tol=1e-13).x
        left = np.abs(residual(found))
        if not np.all(left <= AT_REST):  # Powell's method may stop where it begins: unknowns of unlike size, scaled
            found = root(residual, begin, tol=1e-13, options={"diag": 1 / np.maximum(np.abs(begin), 0.01)}).x
            left = np.abs(residual(found))
    except RuntimeError as error:  # a box with several periods, a singular pose
        raise no_equilibrium(first_line(error)) from None
    if not np.all(left <= AT_REST):
        names = np.repeat(["the arm", *initial], sizes)
        worst = str(names[int(np.argmax(np.nan_to_num(left, nan=np.inf)))])
        raise no_equilibrium(f"{worst} does not come to rest")
    angles, *states = np.split(found, splits)
    return Equilibrium(angles, dict(zip(initial, states, strict=True)))


def no_equilibrium(reason: str) -> NoEquilibriumError:
    """The error where a run cannot start at an equilibrium."""
    return NoEquilibriumError(f"no equilibrium to start from: {reason}; {VALID}")


def _state(context: Any) -> Floats:
    """The discrete groups and the continuous state, one after the other."""
    groups = [context.get_discrete_state(k).CopyToVector() for k in range(context.num_discrete_state_groups())]
    return np.concatenate([*groups, context.get_continuous_state_vector().CopyToVector()])


def _set_state(context: Any, values: Floats) -> None:
    first = 0
    for k in range(context.num_discrete_state_groups()):
        size = context.get_discrete_state(k).size()
        context.SetDiscreteState(k, values[first : first + size])
        first += size
    if first < len(values):
        context.SetContinuousState(values[first:])


def _change(box: System, context: Any) -> Floats:
    """How much each state changes in one period, or per second where it is continuous."""
    changes = [box.EvalTimeDerivatives(context).CopyToVector()]
    if context.num_discrete_state_groups():
        updated = box.EvalUniquePeriodicDiscreteUpdate(context)
        groups = range(context.num_discrete_state_groups())
        changes[:0] = [updated.value(k) - context.get_discrete_state(k).value() for k in groups]
    return np.concatenate(changes)
