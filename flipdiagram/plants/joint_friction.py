"""The friction of the joints that a scenario asks for, stable at its step."""

import numpy as np
from pydrake.systems.framework import LeafSystem

from flipdiagram.arrays import Floats
from flipdiagram.blocks.friction import JointFriction, stable_transition_velocity
from flipdiagram.blocks.sticking import ElastoPlasticFriction, presliding_damping, stable_presliding
from flipdiagram.errors import InputError, rounded_up
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.gears import least_inertia, rotor_inertia
from flipdiagram.scenario.scenario import Scenario


def joint_friction(scenario: Scenario, arm: ArmModel) -> LeafSystem:
    """The friction box of the scenario, its levels as fractions of each joint's rated torque.

    Raises InputError where the friction would chatter: it acts explicitly, so its slope at rest is limited by the
    joint's inertia and the step: M at the arm's home pose, or where gears give way the rotor's alone.
    """
    level, step = scenario.joint_friction, scenario.simulation.step
    coulomb, viscous = level.coulomb * arm.tau_rated, level.viscous * arm.tau_rated
    elastic, M = scenario.joints.model == "elastic", arm.mass_matrix(arm.home)
    if level.model == "tanh":
        inertia = rotor_inertia(arm) if elastic else np.diag(M)
        needed = stable_transition_velocity(coulomb, inertia, step)
        _require(needed, "transition_velocity", level.transition_velocity, "rad/s", arm)
        return JointFriction(coulomb, viscous, np.full(arm.n_joints, level.transition_velocity))
    breakaway, presliding = np.full(arm.n_joints, level.breakaway), np.full(arm.n_joints, level.presliding)
    inertia = rotor_inertia(arm) if elastic else least_inertia(M)
    if np.any(step * viscous >= inertia):
        limit = float(np.min(inertia / (step * arm.tau_rated)))
        field = "joint_friction.viscous"
        message = f"scenario field '{field}' = {level.viscous} is unstable at this step; valid is below {limit:.4g}"
        raise InputError(message, field=field, value=level.viscous, valid=limit)
    needed = stable_presliding(breakaway * coulomb, viscous, inertia, step)
    _require(needed, "presliding", level.presliding, "rad", arm)
    damping = presliding_damping(breakaway * coulomb, presliding, inertia)
    stribeck = np.full(arm.n_joints, level.stribeck_velocity)
    return ElastoPlasticFriction(coulomb, breakaway, viscous, stribeck, presliding, damping, step)


def _require(needed: Floats, field: str, value: float, unit: str, arm: ArmModel) -> None:
    if np.all(needed <= value):
        return
    worst, path = int(np.argmax(needed)), f"joint_friction.{field}"
    if rotor_inertia(arm)[worst] == 0:  # the links alone: an arm whose file does not say what its drives weigh
        path, valid = "arm.reflected_inertia", f"one above 0 for each of {' '.join(arm.joint_names)} [kg m2]"
        message = (
            f"neither arm.file nor {path} has the inertia of rotor and gear of joint {arm.joint_names[worst]}, without"
            f" which its friction makes it chatter; valid is {valid}; `flipdiagram arm check` suggests some"
        )
        raise InputError(message, field=path, valid=valid)
    message = (
        f"scenario field '{path}' = {value} {unit} makes joint {arm.joint_names[worst]} chatter at this step and"
        f" level; valid is at least {rounded_up(needed[worst])} {unit}"
    )
    raise InputError(message, field=path, value=value, valid=needed[worst])
