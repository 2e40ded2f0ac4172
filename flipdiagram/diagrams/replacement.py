"""A box of the user's own in the place of one of Fig. 4: which place, and whether its ports fit."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

from pydrake.systems.framework import InputPort, OutputPort, PortDataType

from flipdiagram.errors import InputError

Box = Any
"""A Drake System, or a function without arguments that makes one: a System serves one diagram only."""


def chosen(
    ours: Mapping[str, Any], replace: Mapping[str, Box], signals: Collection[str], architecture: str
) -> dict[str, Any]:
    """The boxes of an architecture, those in `replace` in the place of ours.

    A box must have every output port of the one it replaces, by name and size.  Its input ports may be any of the
    figure's `signals`, by name: it need not take all that the other took, and may take more.  Raises InputError
    naming box and port that do not fit.
    """
    for name in replace:
        if name not in ours:
            raise InputError(f"replace: '{architecture}' has no box '{name}' to replace; choose from {', '.join(ours)}")
    boxes = dict(ours)
    for name, given in replace.items():
        box = _made(name, given)
        have, want = _outputs(box), _outputs(ours[name])
        for port, size in want.items():
            if port not in have:
                raise misfit(name, f"no output port '{port}' but {', '.join(have) or 'none'}", f"{port} of size {size}")
            if have[port] != size:
                raise misfit(name, f"output port '{port}' of size {have[port]}", f"{size}")
        for i in range(box.num_input_ports()):
            port_name = box.get_input_port(i).get_name()
            if port_name not in signals:
                raise misfit(name, f"input port '{port_name}', which is no signal", ", ".join(signals))
        boxes[name] = box
    return boxes


def misfit(name: str, has: str, valid: str) -> InputError:
    """The error of a box that does not fit its place."""
    return InputError(f"replace: the box for '{name}' has {has}; valid is {valid}")


def _made(name: str, given: Box) -> Any:
    box = given
    if isinstance(given, type) or (isinstance(given, Callable) and not hasattr(given, "num_input_ports")):  # type: ignore[arg-type]
        box = given()
    if not hasattr(box, "num_input_ports"):
        raise InputError(f"replace: '{name}' = {given!r} is no Drake System; valid is one, or what makes one")
    return box


def _outputs(box: Any) -> dict[str, int]:
    ports: list[OutputPort | InputPort] = [box.get_output_port(i) for i in range(box.num_output_ports())]
    return {port.get_name(): port.size() for port in ports if port.get_data_type() == PortDataType.kVectorValued}
