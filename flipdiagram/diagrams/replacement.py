"""A box of the user's own in the place of one of Fig. 4, or of all of them: which place, and whether its ports fit."""

from collections.abc import Collection, Mapping
from typing import Any

from pydrake.systems.framework import Diagram, DiagramBuilder, PortDataType

from flipdiagram.errors import InputError

Box = Any
"""A Drake System, or a function without arguments that makes one: a System serves one diagram only."""
WHOLE = "controller"
"""The place of all boxes between MPC and robot at once."""


def with_replaced(
    ours: Mapping[str, Any], replace: Mapping[str, Box], signals: Collection[str], architecture: str
) -> dict[str, Any]:
    """The boxes of an architecture, those in `replace` in the place of ours.

    A box must have every output port of the one it replaces, by name and size.  Its input ports may be any of the
    figure's `signals`, by name: it need not take all that the other took, and may take more.  Raises InputError
    naming box and port that do not fit.
    """
    boxes = dict(ours)
    for name, given in replace.items():
        if name not in ours:
            problem = f"replace: '{architecture}' has no box '{name}' to replace"
            raise InputError.of("replace", name, list(ours), problem)
        boxes[name] = fitting(name, given, _output_sizes(ours[name]), signals)
    return boxes


def fitting(name: str, given: Box, outputs: Mapping[str, int], signals: Collection[str]) -> Any:
    """The box itself, made if need be, that has these output ports, by their sizes, and takes no other signals.

    Raises InputError naming box and port that do not fit.
    """
    box = _system(name, given)
    sizes = _output_sizes(box)
    for port, size in outputs.items():
        if port not in sizes:
            raise misfit(name, f"no output port '{port}' but {', '.join(sizes) or 'none'}", f"{port} of size {size}")
        if sizes[port] != size:
            raise misfit(name, f"output port '{port}' of size {sizes[port]}", f"{size}")
    for i in range(box.num_input_ports()):
        if (port := box.get_input_port(i).get_name()) not in signals:
            raise misfit(name, f"input port '{port}', which is no signal", signals)
    return box


def misfit(name: str, has: str, valid: str | Collection[str], argument: str = "replace: ") -> InputError:
    """The error of a box that does not fit its place."""
    return InputError.of(name, has, valid, f"{argument}the box for '{name}' has {has}")


def build_diagram(builder: DiagramBuilder, replace: Mapping[str, Box] | None) -> Diagram:
    """What the builder holds; raises InputError where boxes of the user's own close an algebraic loop."""
    try:
        return builder.Build()
    except RuntimeError as error:
        if "algebraic loop" not in str(error) or not replace:
            raise
        reason = f"closes an algebraic loop: {str(error).splitlines()[0]}"
        raise InputError(f"replace: {', '.join(replace)} {reason}", field="replace", value=list(replace)) from None


def _system(name: str, given: Box) -> Any:
    box = given
    if isinstance(given, type) or (callable(given) and not hasattr(given, "num_input_ports")):
        box = given()
    if not hasattr(box, "num_input_ports"):
        raise InputError.of(name, given, "one, or what makes one", f"replace: '{name}' = {given!r} is no Drake System")
    return box


def _output_sizes(box: Any) -> dict[str, int]:
    ports = [box.get_output_port(i) for i in range(box.num_output_ports())]
    return {port.get_name(): port.size() for port in ports if port.get_data_type() == PortDataType.kVectorValued}
