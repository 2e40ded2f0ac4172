"""The default context of a loop: where the arm rests before it moves, known before the cell and its boxes are made."""

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.systems.framework import DiagramBuilder

from flipdiagram.arrays import Floats
from flipdiagram.blocks.mpc import CHANNELS, COMMANDS
from flipdiagram.diagrams.controller import add_controller
from flipdiagram.diagrams.drive import ripple_at_rest
from flipdiagram.diagrams.equilibrium import Equilibrium, equilibrium
from flipdiagram.diagrams.start import Start
from flipdiagram.errors import NoEquilibriumError
from flipdiagram.robot.arm import ArmModel
from flipdiagram.scenario.scenario import Scenario


class Resting:
    """Joint angles q (n,) [rad] at rest, the observer's state and the torque sent there, `observed`, `tau` (n,) [N m].

    They are those of the start pose, and 0, unless `at_rest` finds an `equilibrium`: of our own boxes, as they stand in
    the figure, with commands that hold the start and sensors without error.
    """

    equilibrium: Equilibrium | None = None

    def __init__(self, scenario: Scenario, architecture: str, arm: ArmModel, start: Start) -> None:
        self._of, self._start = (scenario, architecture, arm, start.q), start
        self.q, self.observed, self.tau = start.q, np.zeros(arm.n_joints), np.zeros(arm.n_joints)

    def at_rest(self, holding_torque: Callable[[Floats], Floats]) -> Floats | None:
        """A `handle.Rest`: None where there is no equilibrium, which `Loop.equilibrium` gives the reason of."""
        scenario, _, arm, q_start = self._of
        builder, n = DiagramBuilder(), arm.n_joints
        sizes = {**dict.fromkeys(COMMANDS, CHANNELS), "q": n, "qd": n}
        boxes = add_controller(builder, *self._of, sizes)
        diagram = builder.Build()
        context = diagram.CreateDefaultContext()

        def fix(**values: Any) -> None:
            for name, value in values.items():
                diagram.GetInputPort(name).FixValue(context, value)

        def torque(q: Floats) -> Floats:
            return holding_torque(q) - ripple_at_rest(scenario, arm, q)

        still = np.zeros(CHANNELS)
        fix(x_cmd=self._start.pose, v_cmd=still, a_cmd=still, qd=np.zeros(n))
        tau = boxes.signals["tau"]
        try:
            rest = self.equilibrium = equilibrium(boxes.systems, tau, context, lambda _, q: fix(q=q), torque, q_start)
        except NoEquilibriumError:
            return None
        self.q, self.tau = rest.q, torque(rest.q)
        self.observed = rest.states.get("disturbance_observer", self.observed)
        return self.q
