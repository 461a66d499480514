from __future__ import annotations

import pytest

from bench.errors import ConfigError
from bench.pose import Attitude
from bench.travel import RIG_PROFILE, azimuth_path_deg, require_reachable, travel_time_s


@pytest.mark.parametrize(
    ("present", "heading", "direction", "path"),
    [
        (0.0, 350.0, None, (-10.0,)),
        (0.0, 350.0, 0, (-10.0,)),
        (0.0, 350.0, 1, (350.0,)),
        (0.0, 10.0, -1, (-350.0,)),
        (350.0, 0.0, 1, (360.0,)),
        (360.0, 345.0, -1, (345.0,)),
        (15.0, 15.0, 1, (15.0,)),
        (15.0, 15.0, -1, (15.0,)),
        (530.0, 550.0, None, (190.0,)),  # 550 is past the cable's end
        (530.0, 550.0, 1, (-185.0, -170.0)),  # unwinds and still arrives clockwise
        (-530.0, -550.0, -1, (185.0, 170.0)),
    ],
)
def test_the_path_winds_as_asked_and_never_past_the_cable(present, heading, direction, path):
    assert azimuth_path_deg(present, heading, direction) == pytest.approx(path)


def test_given_any_start_and_heading_then_the_last_leg_arrives_from_the_side_that_was_asked():
    limits = RIG_PROFILE["azimuth"]
    for present in range(-540, 541, 45):
        for heading in range(0, 360, 15):
            for direction in (1, -1):
                path = (present, *azimuth_path_deg(present, heading, direction))
                assert all(limits.low_deg <= azimuth <= limits.high_deg for azimuth in path)
                assert (path[-1] - heading) % 360.0 == pytest.approx(0.0)
                assert direction * (path[-1] - path[-2]) >= 0.0


def test_a_long_move_is_a_trapezoid_and_a_short_one_a_triangle():
    azimuth = RIG_PROFILE["azimuth"]

    assert azimuth.travel_time_s(180.0) == pytest.approx(180.0 / 90.0 + 0.5)
    assert azimuth.travel_time_s(-45.0) == pytest.approx(1.0)  # both forms meet here
    assert azimuth.travel_time_s(11.25) == pytest.approx(0.5)
    assert azimuth.travel_time_s(0.0) == 0.0


def test_the_slowest_axis_sets_the_time_of_a_move():
    level = Attitude(azimuth_deg=0.0)

    assert travel_time_s(level, Attitude(azimuth_deg=11.25)) == pytest.approx(0.5)
    tilted = Attitude(azimuth_deg=11.25, pitch_deg=30.0)
    assert travel_time_s(level, tilted) == pytest.approx(30.0 / 45.0 + 0.5)
    assert travel_time_s(level, Attitude(azimuth_deg=350.0), 1) > 4.0


def test_given_a_tilt_past_the_limits_then_config_error_names_axis_and_limits():
    require_reachable(Attitude(azimuth_deg=9000.0, pitch_deg=90.0, roll_deg=-90.0))

    with pytest.raises(ConfigError, match="roll must be between -90 and 90 deg; instead"):
        require_reachable(Attitude(azimuth_deg=0.0, roll_deg=91.0))
