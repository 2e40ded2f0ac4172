"""How a placement is judged, on a recording made up."""

import numpy as np
import pytest
import synthetic

from flipdiagram.simulation.placement import measure_placement, placed

SLID = 0.018


def judged(y=0.10, tilt=0.0, speed=0.1, strike=0):
    """The object comes down with a speed and lies at y with a tilt; the blade touches the table for some samples."""
    data = synthetic.recording("pd+ff+dob").copy(deep=True)
    pose, force = data["block_pose"].values, data["contact_force"]
    landed = int(np.argmax(np.linalg.norm(force.sel(pair="table-block").values, axis=-1) > 0))
    pose[landed - 2 : landed, 5] = 0.1
    pose[landed - 2 : landed, 6] = [0.3 + speed * 1e-3, 0.3]
    pose[-1] = [np.cos(tilt / 2), np.sin(tilt / 2), 0, 0, 0.5, y, 0.205]
    pair = list(data["pair"].values).index("table-blade")
    force.values[800 : 800 + strike, pair, 2] = np.arange(1, strike + 1)
    force.values[100:110, pair, 2] = 99.0  # before the motion: of no concern
    return measure_placement(placed(data, np.full(data.sizes["time"], -SLID), 0.10))


@pytest.mark.parametrize(
    ("changes", "failure"),
    [
        ({}, None),
        ({"y": 0.1199}, None),
        ({"y": 0.1201}, "lies 2.0 cm from the target"),
        ({"y": 0.05}, "lies 5.0 cm from the target"),
        ({"tilt": 0.3}, "lies tilted by 0.30 rad"),
        ({"speed": 0.29}, None),
        ({"speed": 0.31}, "came down with 0.31 m/s"),
        ({"strike": 7}, "struck the table at 0.500 s with 7 N"),
        ({"strike": 7, "tilt": 0.3}, "struck the table at 0.500 s with 7 N, lies tilted by 0.30 rad"),
    ],
    ids=str,
)
def test_a_placement_is_judged_by_place_tilt_speed_and_a_clear_table(changes, failure):
    found = judged(**changes)
    assert (found.success, found.failure) == (failure is None, failure)
    assert found.planned_slide_m == SLID


def test_a_strike_is_measured():
    found = judged(strike=7)
    assert (found.strike_time_s, found.strike_force_N) == (pytest.approx(0.5), 7.0)
    assert found.strike_duration_s == pytest.approx(0.007)
    calm = judged()
    assert (calm.strike_time_s, calm.strike_duration_s, calm.strike_force_N) == (None, 0.0, 0.0)
