"""jaxonomy: the loop jitted, all channels at once by vmap."""

from __future__ import annotations

import dataclasses
from importlib import import_module
from typing import Any

import numpy as np

from bench.one_dof import Array, Numbers, Stepper

NAME, PACKAGE = "jaxonomy (jit, vmap)", "jaxonomy"


def prepare(numbers: Numbers, omega: Array, ticks: int, log: bool) -> Stepper:
    """Jitted and run once before; the timed call starts from contexts that are ready, and waits for its result."""
    jaxonomy, jax = import_module("jaxonomy"), import_module("jax")
    simulation = import_module("jaxonomy.simulation")
    diagram, command, plant = _diagram(jaxonomy, numbers)
    T = numbers.settings.step
    base = diagram.create_context()
    options = simulation.SimulatorOptions(
        math_backend="jax", max_major_steps=ticks + 2, enable_autodiff=False, return_context=True
    )
    solver = import_module("jaxonomy.backend").ODESolver(diagram, options=options.ode_options)
    simulator = simulation.Simulator(diagram, ode_solver=solver, options=options)

    def start(w: Any) -> Any:
        sub = base[command.system_id]
        sub = dataclasses.replace(sub, parameters={**sub.parameters, "omega": w})
        return base.with_subcontext(command.system_id, sub)

    def advance(context: Any, end: Any) -> Any:
        return simulator.advance_to(end, context).context

    contexts = jax.jit(jax.vmap(start))(np.asarray(omega))
    move = jax.jit(jax.vmap(advance, in_axes=(0, None)))

    def position(context: Any) -> Array:
        return np.asarray(context[plant.system_id].discrete_state)[:, 0]

    def run() -> Array:  # to half a tick beyond the last update: on a tick, rounding would decide
        if not log:
            return position(move(contexts, (ticks - 0.5) * T))[:, None]
        rows, context = [np.zeros(omega.size)], contexts
        for k in range(ticks):
            context = move(context, (k + 0.5) * T)
            rows.append(position(context))
        return np.array(rows).T

    run()
    return run


def _diagram(jaxonomy: Any, numbers: Numbers) -> tuple[Any, Any, Any]:
    library, jnp = import_module("jaxonomy.library"), import_module("jax.numpy")
    s = numbers.settings
    A, B = numbers.plant
    builder = jaxonomy.DiagramBuilder()

    class Command(jaxonomy.LeafSystem):  # type: ignore[misc, name-defined]
        def __init__(self) -> None:
            super().__init__(name="command")
            self.declare_dynamic_parameter("omega", 1.0)
            for wave in (
                lambda t, w: -jnp.sin(w * t),
                lambda t, w: -w * jnp.cos(w * t),
                lambda t, w: w * w * jnp.sin(w * t),
            ):
                self.declare_output_port(lambda time, state, omega, wave=wave: wave(time, omega), requires_inputs=False)

    class Held(jaxonomy.LeafSystem):  # type: ignore[misc, name-defined]
        """x <- A x + B u, the output is x."""

        def __init__(self, name: str, A: Any, B: Any) -> None:
            super().__init__(name=name)
            A, B = np.asarray(A), np.asarray(B)
            self.declare_input_port()
            self.declare_discrete_state(default_value=np.zeros(len(A)))
            self.declare_periodic_update(
                lambda time, state, u, **_: A @ state.discrete_state + B[:, 0] * u, period=s.step, offset=0.0
            )
            for i in range(len(A)):
                self.declare_output_port(
                    lambda time, state, *_, i=i, **__: state.discrete_state[i],
                    requires_inputs=False,
                    prerequisites_of_calc=[import_module("jaxonomy.framework").DependencyTicket.xd],
                )

    add = builder.add
    command = add(Command())
    plant = add(Held("plant", A, B))
    observer = add(Held("observer", [[numbers.decay]], [[1 - numbers.decay]]))
    e_x, e_v, a_ref, force = (add(library.Adder(len(signs), operators=signs)) for signs in ("+-", "+-", "+++", "++-"))
    total, inside = add(library.Adder(2)), add(library.Adder(2))
    k_p, k_v, inertia, damping = (
        add(library.Gain(value)) for value in (s.k_p, s.k_v, s.mass, s.g_dis * numbers.nominal)
    )
    weight = add(library.Constant(s.mass * numbers.gravity))
    x, v = plant.output_ports
    x_cmd, v_cmd, a_cmd = command.output_ports
    for source, block, port in (
        (x_cmd, e_x, 0),
        (x, e_x, 1),
        (v_cmd, e_v, 0),
        (v, e_v, 1),
        (e_x, k_p, 0),
        (e_v, k_v, 0),
        (k_p, a_ref, 0),
        (k_v, a_ref, 1),
        (a_cmd, a_ref, 2),
        (a_ref, inertia, 0),
        (v, damping, 0),
        (inertia, force, 0),
        (observer, force, 1),
        (damping, force, 2),
        (force, total, 0),
        (weight, total, 1),
        (total, plant, 0),
        (force, inside, 0),
        (damping, inside, 1),
        (inside, observer, 0),
    ):
        builder.connect(source.output_ports[0] if hasattr(source, "output_ports") else source, block.input_ports[port])
    return builder.build(), command, plant
