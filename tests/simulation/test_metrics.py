"""Metrics against recordings whose answers are known beforehand."""

import numpy as np
import pytest
import synthetic
from scipy.spatial.transform import Rotation

from flipdiagram.simulation import metrics


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
    landed = metrics.touchdown(data)
    first = np.argmax(np.linalg.norm(data["contact_force"].values[:, 1], axis=1) > 0)
    assert landed.time_s == data["time"].values[first]
    assert (landed.y_m, landed.z_m) == tuple(data["block_pose"].values[first, 5:])
    assert landed.theta_rad == pytest.approx(np.pi)


def test_contact_with_the_table_before_the_motion_does_not_count(data):
    data["contact_force"].values[:, 1] = 0
    data["contact_force"].values[:10, 1] = 1.0
    assert metrics.touchdown(data) is None
    assert metrics.judge(data) == (False, "never reached the table")


def test_a_block_carried_beyond_half_a_turn_and_landed_upside_down_is_a_success(data):
    assert data["x"].values[metrics.release_index(data), 2] > np.pi / 2
    assert metrics.judge(data) == (True, None)


@pytest.mark.parametrize(("angle", "verdict"), [(1.5, False), (1.6, True), (4.7, True), (4.75, False)])
def test_the_angle_at_touchdown_decides_between_a_quarter_and_three_quarters_of_a_turn(data, angle, verdict):
    landed = metrics.touchdown(data)
    lying = data["time"].values >= landed.time_s
    data["block_pose"].values[lying, :4] = synthetic.quaternion(np.full(lying.sum(), angle))
    # the turn must be continuous to be told from one that goes the other way round
    flying = (data["time"].values > synthetic.RELEASE) & ~lying
    data["block_pose"].values[flying, :4] = synthetic.quaternion(np.linspace(1.8, angle, flying.sum()))
    success, failure = metrics.judge(data)
    assert success is verdict
    assert failure == (None if verdict else f"landed at {angle:.2f} rad")


def test_a_block_lost_before_a_quarter_turn_is_dropped_whatever_its_angle():
    success, failure = metrics.judge(synthetic.recording("pd"))
    assert not success
    assert failure == f"dropped at {synthetic.DROP['pd'] - 0.001:.3f} s"


def test_a_blade_that_hit_the_table_before_is_named_first():
    data = synthetic.recording("pd").copy(deep=True)
    k = int(np.searchsorted(data["time"].values, 0.1))
    data["contact_force"].values[k, 2] = [0, 0, 5.0]
    assert metrics.judge(data)[1].startswith("blade hit the table at 0.100 s, dropped at")


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
    assert data["time"].values[metrics.release_index(data)] == pytest.approx(0.602)


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
