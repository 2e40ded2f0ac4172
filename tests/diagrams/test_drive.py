"""What lies between controller and joints: delay and ripple of the torque, encoders on the motors' side."""

import numpy as np
import pytest
from ideal import IDEAL
from pydrake.systems.analysis import Simulator
from shared import ideal_plan

from flipdiagram.diagrams.drive import ripple_at_rest
from flipdiagram.diagrams.loop import build_loop
from flipdiagram.diagrams.sensing import encoder_resolution
from flipdiagram.drawing import draw
from flipdiagram.errors import InputError
from flipdiagram.robot.model_files import urdf_directory
from flipdiagram.robot.parts import arm_of

RATIOS = np.array([100.0, 224.0, 120.0, 120.0, 100.0, 81.48])
BOTH = {"drive.ripple": 0.02, "drive.delay": 0.003}


def edges(loop):
    return {
        (
            f"{out.get_name()}.{out.get_output_port(o).get_name()}",
            f"{into.get_name()}.{into.get_input_port(i).get_name()}",
        )
        for (into, i), (out, o) in loop.diagram.connection_map().items()
    }


def test_the_default_has_none_of_the_boxes():
    names = {system.get_name() for system in build_loop(IDEAL).diagram.GetSystems()}
    assert not names & {"torque_delay", "torque_ripple", "hold", "encoder"}


@pytest.mark.parametrize("step", [0.001, 0.0005])
def test_delay_and_ripple_stand_between_limit_and_joints_in_the_drawing_too(step):
    loop = build_loop(IDEAL.with_overrides(BOTH | {"simulation.step": step}), "pd+ff+dob")
    found = edges(loop)
    held = "torque_limit.tau" if step == 0.001 else "hold.y"
    assert {
        (held, "torque_delay.u"),
        ("torque_delay.y", "torque_ripple.tau"),
        ("joint_state.y0", "torque_ripple.q"),
        ("torque_ripple.tau_drive", "joint_torque.u0"),
        ("torque_limit.tau", "disturbance_observer.tau"),  # the observer knows of neither
    } <= found
    drawn = {(line.source[-1], line.target[-1]) for line in draw(loop).lines}
    assert {("torque_delay", "torque_ripple"), ("torque_ripple", "robot"), ("robot", "torque_ripple")} <= drawn


@pytest.mark.parametrize("step", [0.001, 0.0005])
def test_the_cell_takes_the_torque_of_so_many_periods_ago(step):
    fields = {"drive.delay": 0.003, "simulation.step": step, "simulation.start": "switch-on"}
    loop = build_loop(IDEAL.with_overrides(fields), "pd+ff+dob", record=True)
    context = loop.context(ideal_plan())
    simulator = Simulator(loop.diagram, context)
    taken = []
    for k in range(60):
        simulator.AdvanceTo(0.001 * k)
        taken.append(loop.cell.tau.Eval(loop.cell.tau.get_system().GetMyContextFromRoot(context)))
    sent = loop.logs["tau"].FindLog(context).data().T
    assert np.abs(sent[:50]).max() > 1.0
    np.testing.assert_allclose(taken[3:], sent[:57], atol=1e-9)
    np.testing.assert_array_equal(taken[:3], np.zeros((3, 6)))


def test_the_ripple_has_its_amplitude_and_two_cycles_per_turn_of_the_motor():
    loop = build_loop(IDEAL.with_overrides({"drive.ripple": 0.02}))
    box = loop.drive.boxes["torque_ripple"]
    rated = np.array([31.78, 71.19, 38.14, 11.42, 9.52, 7.76])
    turn = 2 * np.pi / RATIOS  # of the joint, in one turn of the motor
    for share, expected in ((0.0, 0.0), (1 / 8, 0.02), (1 / 4, 0.0), (3 / 8, -0.02), (1 / 2, 0.0)):
        np.testing.assert_allclose(ripple_at_rest(loop.scenario, loop.arm, share * turn), expected * rated, atol=1e-12)
    context = box.CreateDefaultContext()
    box.GetInputPort("tau").FixValue(context, rated)
    box.GetInputPort("q").FixValue(context, turn / 8)
    np.testing.assert_allclose(box.GetOutputPort("tau_drive").Eval(context), 1.02 * rated)


def test_a_run_starts_at_equilibrium_with_both():
    """The motors' ripple carries a part, and the delayed torque has been sent for long: nothing moves."""
    loop = build_loop(IDEAL.with_overrides(BOTH), "pd+dob")
    context = loop.context(ideal_plan())
    q = loop.equilibrium.q
    assert np.abs(ripple_at_rest(loop.scenario, loop.arm, q)).max() > 1e-3
    Simulator(loop.diagram, context).AdvanceTo(0.09)
    plant = loop.cell.plant
    now = plant.GetPositions(plant.GetMyContextFromRoot(context), loop.cell.parts.arm.arm)
    np.testing.assert_allclose(now, q, atol=1e-7)


def test_an_encoder_of_13_bits_on_the_motors_side_is_finer_by_the_gear():
    scenario = IDEAL.with_overrides({"sensors.encoder_bits": 13})
    resolution = encoder_resolution(scenario, arm_of(scenario))
    np.testing.assert_allclose(resolution, 2 * np.pi / 8192 / RATIOS)
    assert resolution[0] == pytest.approx(7.67e-6, rel=1e-3)
    loop = build_loop(scenario)
    encoder = loop.sensing.boxes["encoder"]
    np.testing.assert_array_equal(encoder.resolution, resolution)
    assert ("encoder.q_measured", "tool_kinematics.q") in edges(loop)


@pytest.mark.parametrize("field, value", [("drive.ripple", 0.01), ("sensors.encoder_bits", 13)])
def test_an_arm_without_gear_ratios_is_asked_for_them_in_one_line(tmp_path, field, value):
    text = "\n".join(
        line
        for line in (urdf_directory() / "mh3f.urdf").read_text(encoding="utf-8").splitlines()
        if "drake:gear_ratio" not in line
    )
    file = tmp_path / "arm.urdf"
    file.write_text(text, encoding="utf-8")
    scenario = IDEAL.with_overrides(
        {"arm.file": str(file), "arm.reflected_inertia": (0.07, 0.4, 0.1, 0.05, 0.03, 0.02), field: value}
    )
    with pytest.raises(
        InputError, match=rf"{field} needs the gear ratios of the arm; valid is arm.gear_ratios"
    ) as caught:
        build_loop(scenario)
    assert "\n" not in str(caught.value) and caught.value.exit_code == 2
    given = scenario.with_overrides({"arm.gear_ratios": tuple(RATIOS)})
    np.testing.assert_array_equal(arm_of(given).gear_ratios(field), RATIOS)
