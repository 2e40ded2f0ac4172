"""Any sampled diagram linearised by Drake's AutoDiffXd, whatever the number of its state groups."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd

from flipdiagram.arrays import Floats
from flipdiagram.compiled.linear import Linearization
from flipdiagram.compiled.structure import Structure, check_states, common_timing, flatten


def linearize_diagram(diagram: Any, context: Any | None = None) -> Linearization:
    """dx[k+1] = A dx[k] + B du[k], dy[k] = C dx[k] + D du[k] of a diagram about a context, exact to rounding.

    Drake's own `Linearize` takes one group of sampled states: with several, or with a block written in Python that has
    no other scalar, it may end the interpreter.  This does not: each block is asked first whether it converts.

    Args:
        diagram: a Diagram over float whose sampled blocks share one period, or a single such System; inputs and
            outputs are its vector ports.
        context: the point, inputs connected or fixed; by default the default context, inputs 0.

    Raises NotCompilable (an InputError), which names the block and the reason.
    """
    structure = flatten(diagram)
    check_states(structure)
    period, _ = common_timing(structure)
    for leaf in structure.leaves:
        leaf.converted("AutoDiffXd")
    of_float = diagram.CreateDefaultContext() if context is None else context
    moving = diagram.ToAutoDiffXd()
    own = moving.CreateDefaultContext()
    own.SetTimeStateAndParametersFrom(of_float)
    state = [of_float.get_discrete_state(k).CopyToVector() for k in range(of_float.num_discrete_state_groups())]
    given = [_value(diagram.get_input_port(port.index), of_float) for port in structure.inputs]
    point = np.concatenate([*state, *given])
    seeds = iter([AutoDiffXd(value, unit) for value, unit in zip(point, np.eye(point.size), strict=True)])
    for k, values in enumerate(state):
        own.SetDiscreteState(k, np.array([next(seeds) for _ in values]))
    for port, values in zip(structure.inputs, given, strict=True):
        moving.get_input_port(port.index).FixValue(own, np.array([next(seeds) for _ in values]))
    updated = moving.EvalUniquePeriodicDiscreteUpdate(own)
    after = _slopes([updated.get_vector(k).CopyToVector() for k in range(len(state))], point.size)
    seen = _slopes([moving.get_output_port(port.index).Eval(own) for port in structure.outputs], point.size)
    n = sum(map(len, state))
    names = (_states(structure), _elements(structure.inputs), _elements(structure.outputs))
    return Linearization(after[:, :n], after[:, n:], seen[:, :n], seen[:, n:], period, *names)


def _value(port: Any, context: Any) -> Floats:
    return np.array(port.Eval(context)) if port.HasValue(context) else np.zeros(port.size())


def _slopes(vectors: Sequence[Any], size: int) -> Floats:
    rows = [np.zeros(size) if not x.derivatives().size else x.derivatives() for vector in vectors for x in vector]
    return np.array(rows, dtype=float).reshape(-1, size)


def _states(structure: Structure) -> tuple[str, ...]:
    sizes = []
    for leaf in structure.leaves:
        context = leaf.system.CreateDefaultContext()
        sizes.append((leaf.name, context.num_total_states()))
    return tuple(f"{name}[{i}]" if size > 1 else name for name, size in sizes for i in range(size))


def _elements(ports: Sequence[Any]) -> tuple[str, ...]:
    return tuple(f"{p.name}[{i}]" if p.size > 1 else p.name for p in ports for i in range(p.size))
