"""Motion of one axis: profile, settling, encoder, backlash, stall, end stops."""

from __future__ import annotations

import numpy as np
import pytest

from devices.mechanics import AxisMechanics, EncoderMap, draw_encoder

DT_S = 0.01


def azimuth(**changes: object) -> AxisMechanics:
    ratings = {"max_velocity_dps": 90.0, "max_acceleration_dps2": 180.0}
    return AxisMechanics("azimuth", **{**ratings, **changes})  # type: ignore[arg-type]


def travel(axis: AxisMechanics, limit_s: float = 60.0) -> float:
    """Step until the axis rests; return the seconds that it took."""
    for step in range(round(limit_s / DT_S)):
        if not axis.moving:
            return step * DT_S
        axis.step(DT_S)
    pytest.fail(f"{axis.name} still moves after {limit_s} s")


@pytest.mark.parametrize("target_deg", [0.001, 0.37, -15.0, 45.0, 123.456, -360.0])
def test_arrives_exactly(target_deg: float) -> None:
    axis = azimuth()
    axis.command(target_deg)
    travel(axis)

    assert axis.encoder_deg == pytest.approx(target_deg, abs=1e-9)
    assert axis.angle_deg == pytest.approx(target_deg, abs=1e-9)
    assert axis.following_error_deg == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("target_deg", "ramp_s"), [(15.0, 2 * np.sqrt(15 / 180)), (180.0, 0.5 + 180 / 90)]
)
def test_takes_the_time_of_the_trapezium_and_settles_in_0_3_s(
    target_deg: float, ramp_s: float
) -> None:
    axis = azimuth()
    axis.command(target_deg)

    assert ramp_s < travel(axis) < ramp_s + 0.34


def test_holds_velocity_and_acceleration() -> None:
    axis = azimuth()
    axis.command(200.0, 60.0, 100.0)
    velocities = [0.0]
    while axis.moving:
        axis.step(DT_S)
        velocities.append(axis.velocity_dps)

    assert max(velocities) == pytest.approx(60.0)
    assert min(velocities) >= 0.0
    assert np.abs(np.diff(velocities)).max() <= 100.0 * DT_S + 1e-9


def test_commands_above_the_rating_are_held_to_it() -> None:
    axis = azimuth()
    axis.command(300.0, 1e6, 1e6)
    velocities = []
    while axis.moving:
        axis.step(DT_S)
        velocities.append(axis.velocity_dps)

    assert max(velocities) == pytest.approx(90.0)


def test_new_target_in_motion_reverses_without_a_jump() -> None:
    axis = azimuth()
    axis.command(90.0)
    for _ in range(60):
        axis.step(DT_S)
    angles_deg = [axis.angle_deg]
    axis.command(-10.0)
    while axis.moving:
        axis.step(DT_S)
        angles_deg.append(axis.angle_deg)

    assert np.abs(np.diff(angles_deg)).max() < 90.0 * DT_S * 1.5
    assert axis.encoder_deg == pytest.approx(-10.0, abs=1e-9)


def test_load_rings_and_then_rests() -> None:
    axis = azimuth()
    axis.command(30.0)
    while not axis.velocity_dps:
        axis.step(DT_S)
    while axis.velocity_dps:
        axis.step(DT_S)
    ringing = []
    while axis.moving:
        axis.step(DT_S)
        ringing.append(axis.angle_deg - 30.0)

    assert 0.003 < max(np.abs(ringing)) < 0.05
    assert ringing[-1] == 0.0


def test_following_error_grows_with_speed() -> None:
    axis = azimuth()
    axis.command(180.0)
    errors_deg = []
    while axis.moving:
        axis.step(DT_S)
        errors_deg.append(axis.following_error_deg)

    assert max(errors_deg) == pytest.approx(90.0 * 0.004)


def test_stuck_axis_does_not_move_and_its_following_error_grows() -> None:
    axis = azimuth()
    axis.stall = 1.0
    axis.command(45.0)
    for _ in range(200):
        axis.step(DT_S)

    assert axis.angle_deg == 0.0
    assert axis.following_error_deg == pytest.approx(45.0)

    axis.quick_stop()
    travel(axis)
    assert axis.following_error_deg == 0.0


def test_small_loss_of_torque_is_not_seen() -> None:
    free, weak = azimuth(), azimuth()
    weak.stall = 0.05
    for axis in (free, weak):
        axis.command(120.0)
        travel(axis)

    assert weak.angle_deg == free.angle_deg


def test_half_stalled_axis_falls_behind() -> None:
    axis = azimuth()
    axis.stall = 0.5
    axis.command(180.0)
    for _ in range(150):
        axis.step(DT_S)

    assert axis.following_error_deg > 10.0


def test_end_stop_holds_the_load() -> None:
    axis = azimuth(travel_deg=(-92.0, 92.0))
    axis.command(120.0)
    for _ in range(300):
        axis.step(DT_S)

    assert axis.angle_deg == pytest.approx(92.0)
    assert axis.following_error_deg == pytest.approx(28.0)


def test_quick_stop_brakes_at_the_rating() -> None:
    axis = azimuth()
    axis.command(300.0)
    for _ in range(100):
        axis.step(DT_S)
    at_deg = axis.encoder_deg
    axis.quick_stop()
    travel(axis)

    assert axis.encoder_deg - at_deg == pytest.approx(90.0**2 / (2 * 180.0), abs=1.0)


def test_velocity_command_turns_until_told_otherwise() -> None:
    axis = azimuth()
    axis.command_velocity(-30.0)
    for _ in range(500):
        axis.step(DT_S)

    assert axis.velocity_dps == -30.0
    axis.command_velocity(0.0)
    travel(axis)
    assert axis.velocity_dps == 0.0


def test_encoder_shows_the_target_and_the_true_angle_carries_its_error() -> None:
    axis = azimuth(encoder=EncoderMap(harmonics=((1, 0.0, 0.05),)))
    axis.command(90.0)
    travel(axis)

    assert axis.encoder_deg == pytest.approx(90.0)
    assert axis.angle_deg == pytest.approx(89.95)


def test_backlash_depends_on_the_side() -> None:
    axis = azimuth(backlash_deg=0.01)
    axis.command(30.0)
    travel(axis)
    from_below_deg = axis.angle_deg
    axis.command(60.0)
    travel(axis)
    axis.command(30.0)
    travel(axis)

    assert axis.angle_deg - from_below_deg == pytest.approx(0.01)


def test_encoder_steps_are_a_thousandth_of_a_degree() -> None:
    axis = azimuth()
    axis.command(10.0)
    for _ in range(20):
        axis.step(DT_S)

    assert axis.encoder_deg * 1000.0 == pytest.approx(round(axis.encoder_deg * 1000.0), abs=1e-6)
    assert abs(axis.encoder_deg - axis.angle_deg) <= 0.0005 + 1e-12


def test_wakes_up_where_it_stands() -> None:
    axis = azimuth(start_deg=1.25)

    assert axis.encoder_deg == pytest.approx(1.25)
    assert not axis.moving


def test_drawn_encoders_have_0_02_deg() -> None:
    rng = np.random.default_rng(8)
    angles_deg = np.arange(0.0, 360.0, 7.3)
    errors_deg = [
        encoder.error_deg(float(angle_deg))
        for encoder in (draw_encoder(rng) for _ in range(300))
        for angle_deg in angles_deg
    ]

    assert np.std(errors_deg) == pytest.approx(0.02, rel=0.1)
    assert np.max(np.abs(errors_deg)) < 0.1
