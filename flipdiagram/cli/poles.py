"""`flipdiagram diagram --poles`: the poles of a loop about its rest, as a table and as a picture."""

import argparse
from pathlib import Path
from typing import Any

from flipdiagram.cli.commands import show
from flipdiagram.compiled.linearize import linearize_diagram
from flipdiagram.diagrams.joint_loop import build_joint_loop
from flipdiagram.diagrams.one_dof import build_controller, build_open
from flipdiagram.errors import InputError
from flipdiagram.files import atomic_path
from flipdiagram.grid import Grid
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.theory.poles import Pole, listed

SUFFIXES = (".svg", ".png")
HEADINGS = ("pole z", "|z|", "ω [rad/s]", "damping", "count")


def poles(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Print the poles of an architecture's loop, and draw them where --out names a file.

    Raises InputError for an ending that is no picture, or a loop that cannot be linearised.
    """
    out: Path | None = arguments.out
    if out is not None and out.suffix.lower() not in SUFFIXES:
        raise InputError.of("--out", str(out), "a file that ends in .svg or .png", f"--out = '{out}' is no picture")
    architecture = arguments.architecture
    if arguments.one_dof:
        loop = build_open(build_controller(architecture, scenario.one_dof), scenario.one_dof)
        linear, about = linearize_diagram(loop), "1-DOF loop without friction"
    else:
        # as the kinematics are: what is wanted of a tool off its command changes with the joints
        linear = build_joint_loop(scenario, architecture, arm=arm_of(scenario)).linearize()
        about = "arm at its start"
    found = listed(linear.poles(), linear.dt)
    title = f"Poles of {architecture}, {about}, sampled every {1e3 * linear.dt:g} ms"
    parts: list[Grid | str] = [Grid(HEADINGS, [_row(pole) for pole in found], title, right=HEADINGS), _verdict(found)]
    if out is not None:
        from flipdiagram.figures.poles import draw_poles

        with atomic_path(out) as temporary:
            draw_poles(found, architecture, title).savefig(temporary, format=out.suffix[1:].lower(), dpi=150)
        parts.append(f"{out} written")
    show(arguments, parts, {"title": title, "period_s": linear.dt, "poles": [_data(pole) for pole in found]})


def _data(pole: Pole) -> dict[str, Any]:
    numbers = {"real": pole.z.real, "imaginary": pole.z.imag, "omega_rad_s": pole.omega, "damping": pole.damping}
    return numbers | {"count": pole.count, "stable": pole.stable}


def _row(pole: Pole) -> list[str]:
    z = f"{pole.z.real:.5f}" + (f" ± {pole.z.imag:.5f}j" if pole.z.imag else "")
    if pole.omega is None:
        return ["0", "0", "gone after one sample", "–", str(pole.count)]
    damping = "–" if pole.damping is None else f"{pole.damping:.3f}"
    return [z, f"{abs(pole.z):.5f}", f"{pole.omega:.4g}", damping, str(pole.count)]


def _verdict(found: list[Pole]) -> str:
    growing = sum(pole.count * (2 if pole.z.imag else 1) for pole in found if not pole.stable)
    if growing:
        return f"Unstable: {growing} of its poles do not decay."
    return f"Stable: the slowest pole decays by {100 * (1 - abs(found[0].z)):.2g} % in a sample."
