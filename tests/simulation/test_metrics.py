"""Metrics against recordings whose answers are known beforehand."""

import numpy as np
import pytest
import synthetic
from scipy.spatial.transform import Rotation

from flipdiagram.simulation import events, metrics, verdict


@pytest.fixture
def data():
    return synthetic.recording("pd+ff+dob").copy(deep=True)


def shifted(data, signal, by):
    """The recording with `signal` equal to its command delayed by a whole number of samples."""
    command = data[f"{signal}_cmd"].values
    later = np.concatenate([np.repeat(command[:1], by, axis=0), command[: len(command) - by]])
    data[signal].values[:] = later
    return data


def test_rmse_of_a_constant_error_is_its_length(data):
    data["x"].values[:] = data["x_cmd"].values + [0.003, -0.004, 0.1]
    assert metrics.rmse(data, "x", "x_cmd", ["y", "z"]) == pytest.approx(0.005)
    assert metrics.rmse(data, "x", "x_cmd", ["theta"]) == pytest.approx(0.1)


def test_rmse_counts_the_motion_only(data):
    data["x"].values[:] = data["x_cmd"].values
    outside = (data["time"].values < -1e-9) | (data["time"].values > synthetic.MOTION + 1e-9)
    data["x"].values[outside] += 1.0
    assert metrics.rmse(data, "x", "x_cmd", ["y", "z"]) == 0


@pytest.mark.parametrize("samples", [0, 4, 11])
def test_velocity_delay_is_the_shift(data, samples):
    assert metrics.velocity_delay(shifted(data, "v", samples)) == pytest.approx(samples * 1e-3, abs=2e-4)


def test_velocity_lead_is_negative(data):
    command = data["v_cmd"].values
    data["v"].values[:-5] = command[5:]
    assert metrics.velocity_delay(data) == pytest.approx(-5e-3, abs=2e-4)


def test_endpoint_vibration_of_a_sinusoid_is_its_amplitude_over_root_two(data):
    time = data["time"].values
    data["v"].values[:] = 0
    data["v"].values[:, 0] = 0.02 * np.sin(2 * np.pi * 50 * time)
    assert metrics.endpoint_vibration(data) == pytest.approx(0.02 / np.sqrt(2), rel=0.01)


def test_max_torque_is_taken_from_the_motion(data):
    data["tau"].values[:] = 1.0
    data["tau"].values[:, 1] = -3.0
    data["tau"].values[0] = 100.0  # in the hold phase
    np.testing.assert_array_equal(metrics.max_torque(data), [1, 3, 1, 1, 1, 1])


def test_torque_at_its_limit_counts_from_the_start_until_the_block_leaves_or_the_blade_hits(data):
    del data["tau"].attrs["limit"]
    assert np.isnan(metrics.saturated(data))  # a recording that does not say its limits
    data["tau"].attrs["limit"] = [10.0, 20.0, 30.0, 40.0, 50.0, 60.0]
    time, tau = data["time"].values, data["tau"].values
    tau[:] = 0.0
    assert metrics.saturated(data) == 0.0
    tau[time < 0, 0] = 10.0  # before the motion
    tau[time > synthetic.RELEASE + 0.002, 0] = -10.0  # after the release
    assert metrics.saturated(data) == 0.0
    tau[(time > 0.0995) & (time < 0.1195), 1] = -20.0
    tau[(time > 0.2995) & (time < 0.3095), 1] = 19.99
    tau[(time > 0.1995) & (time < 0.2145), 2] = 30.0
    tau[(time > 0.1) & (time < 0.4), 3] = 39.9  # near it
    assert metrics.saturated(data) == pytest.approx(0.030)  # of the joint with the longest, in all
    data["contact_force"].loc[{"pair": "table-blade"}].values[time > 0.2] = 1.0
    assert metrics.saturated(data) == pytest.approx(0.020)
    assert metrics.measure(data).saturated_s == pytest.approx(0.020)


def test_touchdown_is_the_first_contact_with_the_table(data):
    landed = events.touchdown(data)
    first = np.argmax(np.linalg.norm(data["contact_force"].values[:, 1], axis=1) > 0)
    assert landed.time_s == data["time"].values[first]
    assert (landed.y_m, landed.z_m) == tuple(data["block_pose"].values[first, 5:])
    assert landed.theta_rad == pytest.approx(np.pi)


def test_contact_with_the_table_before_the_motion_does_not_count(data):
    data["contact_force"].values[:, 1] = 0
    data["contact_force"].values[:10, 1] = 1.0
    assert events.touchdown(data) is None
    assert verdict.judge(data) == (False, "never reached the table")


def test_a_block_carried_beyond_half_a_turn_and_landed_upside_down_is_a_success(data):
    assert data["x"].values[events.release_index(data), 2] > np.pi / 2
    assert verdict.judge(data) == (True, None)


@pytest.mark.parametrize(("angle", "turned_over"), [(1.5, False), (1.6, True), (4.7, True), (4.75, False)])
def test_the_angle_at_touchdown_decides_between_a_quarter_and_three_quarters_of_a_turn(data, angle, turned_over):
    landed = events.touchdown(data)
    lying = data["time"].values >= landed.time_s
    data["block_pose"].values[lying, :4] = synthetic.quaternion(np.full(lying.sum(), angle))
    # the turn must be continuous to be told from one that goes the other way round
    flying = (data["time"].values > synthetic.RELEASE) & ~lying
    data["block_pose"].values[flying, :4] = synthetic.quaternion(np.linspace(1.8, angle, flying.sum()))
    success, failure = verdict.judge(data)
    assert success is turned_over
    assert failure == (None if turned_over else f"landed at {angle:.2f} rad")


def test_a_block_lost_before_a_quarter_turn_is_dropped_whatever_its_angle():
    success, failure = verdict.judge(synthetic.recording("pd"))
    assert not success
    assert failure == f"tipped, dropped at {synthetic.DROP['pd'] - 0.001:.3f} s"


def test_a_blade_that_hit_the_table_before_is_named_first():
    data = synthetic.recording("pd").copy(deep=True)
    k = int(np.searchsorted(data["time"].values, 0.1))
    data["contact_force"].values[k, 2] = [0, 0, 5.0]
    assert verdict.judge(data)[1].startswith("struck the table at 0.100 s, dropped at")


def slide(data, begin, way, seconds=0.05):
    """The block moves along s by `way` [m], its friction used up from `begin` [s] on."""
    time, tool = data["time"].values, data["tool_pose"].values
    moved = way * np.clip((time - begin) / seconds, 0.0, 1.0)
    along = Rotation.from_quat(tool[:, :4], scalar_first=True)
    data["block_pose"].values[:, 4:] += along.apply(moved[:, None] * [0.0, 1.0, 0.0])
    touch = (time >= begin) & (np.abs(data["contact_force"].values[:, 0]).sum(axis=1) > 0)
    exhausted = along.apply([0.0, np.tan(data.attrs["friction_angle_rad"]), 1.0])
    data["contact_force"].values[touch, 0] = exhausted[touch]


@pytest.mark.parametrize(
    ("begin", "way", "failure"),
    [
        (0.05, 0.02, "slid at the start from 0.050 s"),
        (0.16, 0.02, "slid later from 0.160 s"),
        (0.05, 0.009, "tipped"),  # that is not far enough to lose a block
    ],
)
def test_a_slide_is_dated_by_when_the_friction_was_used_up(begin, way, failure):
    data = synthetic.recording("pd+ff").copy(deep=True)
    slide(data, begin, way, 0.03)
    lost = synthetic.DROP["pd+ff"] - 0.001
    assert verdict.judge(data) == (False, f"{failure}, dropped at {lost:.3f} s")
    assert verdict.cause_of(verdict.judge(data)[1]) == failure.partition(" from")[0]


def test_a_strike_is_the_cause_whatever_slid_before_and_a_slide_only_without_one():
    """The block that slid, stuck and was still there when the blade struck had not slid off."""
    data = synthetic.recording("pd+ff").copy(deep=True)
    slide(data, 0.05, 0.02, 0.1)  # 10 mm at 0.1 s, at rest again at 0.15 s
    assert verdict.cause_of(verdict.judge(data)[1]) == "slid at the start"
    time = data["time"].values
    for strike in (0.09, 0.16):
        struck = data.copy(deep=True)
        struck["contact_force"].values[int(np.searchsorted(time, strike)), 2] = [0, 0, 5.0]
        assert verdict.judge(struck)[1].startswith(f"struck the table at {strike:.3f} s, dropped")
    after = data.copy(deep=True)  # the block is gone already
    after["contact_force"].values[int(np.searchsorted(time, 0.25)), 2] = [0, 0, 5.0]
    assert verdict.cause_of(verdict.judge(after)[1]) == "slid at the start"


def test_of_a_torque_limit_and_a_slide_the_first_is_the_cause():
    data = synthetic.recording("pd+ff").copy(deep=True)
    slide(data, 0.05, 0.02, 0.1)
    time = data["time"].values
    weak = data.copy(deep=True)
    weak["tau"].attrs["limit"] = [10.0] * 6
    weak["tau"].values[:] = 0.0
    weak["tau"].values[(time > 0.0605) & (time < 0.0855), 2] = -10.0
    assert verdict.judge(weak)[1].startswith("torque limit from 0.061 s, dropped")
    weak["tau"].values[(time > 0.0755), 2] = 0.0  # too short a time to matter
    assert verdict.cause_of(verdict.judge(weak)[1]) == "slid at the start"


def test_a_block_that_turns_against_the_blade_has_tipped():
    data = synthetic.recording("pd+ff").copy(deep=True)
    turn = 0.3 * np.clip((data["time"].values - 0.1) / 0.05, 0.0, 1.0)
    pose = data["block_pose"].values
    turned = Rotation.from_rotvec(turn[:, None] * [1.0, 0.0, 0.0]) * Rotation.from_quat(pose[:, :4], scalar_first=True)
    pose[:, :4] = turned.as_quat(scalar_first=True)
    assert verdict.judge(data)[1].startswith("tipped from 0.1")


def test_errors_are_those_of_the_true_and_of_the_measured_tool(data):
    data["x"].values[:], data["x_meas"].values[:] = data["x_cmd"].values, data["x_cmd"].values + [0.003, 0.004, 0]
    data["tau"].values[:], data["tau_cmd"].values[:] = 1.0, 1.0
    after = data["time"].values > synthetic.MOTION + 0.1  # the stop, which asks for more than the drives have
    data["tau_cmd"].values[after] = -7.0
    measured = metrics.measure(data)
    assert (measured.position_rmse_m, measured.position_rmse_meas_m) == pytest.approx((0.0, 0.005), abs=1e-12)
    assert measured.max_torque_Nm == [1.0] * 6 and measured.max_torque_cmd_Nm == [7.0] * 6


def test_slip_and_lift_are_measured_in_the_tools_frame(data):
    start = np.searchsorted(data["time"].values, 0.0)
    k = int(np.searchsorted(data["time"].values, 0.2))
    tool, block = data["tool_pose"].values, data["block_pose"].values
    turned = Rotation.from_quat(tool[:, :4], scalar_first=True)
    block[:, 4:] = tool[:, 4:] + turned.apply([0.0, 0.0, 0.005])  # as it lies on the blade
    before = metrics.slip_and_lift(data)
    block[k, 4:] += turned[k].apply([0.0, 0.007, 0.002])
    slip, lift = metrics.slip_and_lift(data)
    assert before == pytest.approx((0, 0), abs=1e-9)
    assert (slip, lift) == pytest.approx((0.007, 0.002), abs=1e-9)
    assert start < k


def test_contact_after_release_counts_touches_once_the_block_is_free(data):
    assert metrics.contact_after_release(data) == 0
    k = int(np.searchsorted(data["time"].values, 0.6))
    data["contact_force"].values[k : k + 3, 0] = [0, 0.1, 0]
    assert metrics.contact_after_release(data) == pytest.approx(0.003)
    # the last contact before touch-down is then the release
    assert data["time"].values[events.release_index(data)] == pytest.approx(0.602)


def test_measure_gives_the_contracts_entries(data):
    entries = metrics.measure(data).as_dict()
    assert list(entries["touchdown"]) == ["time_s", "y_m", "z_m", "theta_rad"]
    assert {
        "architecture",
        "start_y_m",
        "success",
        "touchdown",
        "position_rmse_m",
        "angle_rmse_rad",
        "acceleration_rmse_m_s2",
        "max_torque_Nm",
        "max_slip_m",
        "max_lift_off_m",
        "velocity_delay_s",
        "endpoint_vibration_m_s",
    } <= set(entries)
    assert len(entries["max_torque_Nm"]) == 6
