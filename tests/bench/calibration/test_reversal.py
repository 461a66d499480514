"""Reversal: the seat's truth is recovered within its uncertainty, and only what can be told is.

GIVEN a seat, a unit and encoders drawn at random WHEN the unit is read in several mountings THEN
the reversal tells index, level, iron and field azimuth, and says which of them it cannot.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.calibration.fit import CalibrationData
from bench.calibration.fixture import SeatFound
from bench.calibration.mountings import SEAT_FROM_UNIT, Mounting, nearest_mounting
from bench.calibration.reversal import ReversalCause, reversal
from bench.calibration.reversal_effects import BenchDoubts, effects, seating_axes
from bench.calibration.reversal_model import SeatState, mounted, seat_rotation, seat_rows
from bench.calibration.tilt import ned_from_body

MARKED, TURNED, OVER = Mounting.AS_MARKED, Mounting.TURNED, Mounting.TURNED_OVER
ALL = (MARKED, TURNED, OVER)
FIELD_MG = 250.0 * np.array([np.cos(0.01), np.sin(0.01), np.tan(np.pi / 3.0)])
TRUTH = {
    "index": 0.5, "pitch": 0.1, "roll": -0.07, "iron_x": 2.0, "iron_y": -1.5, "iron_z": 1.0,
    "field_azimuth": float(np.rad2deg(0.01)), "dip": 60.0,
}  # fmt: skip
RINGS = (
    (0.0, 0.0, 0.0),
    (45.0, 0.0, 0.0),
    (-45.0, 0.0, 0.0),
    (0.0, 45.0, 30.0),
    (0.0, -45.0, 30.0),
)
POSES = np.array(
    [(first + 60.0 * k, pitch, roll) for pitch, roll, first in RINGS for k in range(6)]
)
QUIET = BenchDoubts(
    one_cycle_deg=0.0, two_cycle_deg=0.0, fine_deg=0.0, squareness_deg=0.0, seating_deg=0.0,
    drift_mg=0.0, gradient_mg=0.0, strength=0.0,
)  # fmt: skip


class Encoders:
    """One draw of the errors of three encoders: the same whenever an angle comes back."""

    def __init__(self, rng: np.random.Generator, sd_deg: float) -> None:
        self._waves = rng.normal(0.0, sd_deg / np.sqrt(3.0), (3, 2, 2))
        self._fine: dict[tuple[int, float], float] = {}
        self._rng, self._sd_deg = rng, sd_deg

    def error_deg(self, shown_deg: np.ndarray) -> np.ndarray:
        error_deg = np.zeros_like(shown_deg)
        for axis in range(3):
            for order in (1, 2):
                phase_rad = np.deg2rad(order * shown_deg[:, axis])
                cosine, sine = self._waves[axis, order - 1]
                error_deg[:, axis] += cosine * np.cos(phase_rad) + sine * np.sin(phase_rad)
            for row, angle_deg in enumerate(shown_deg[:, axis]):
                drawn = self._rng.normal(0.0, self._sd_deg / np.sqrt(3.0))
                error_deg[row, axis] += self._fine.setdefault((axis, float(angle_deg)), drawn)
        return error_deg


def readings_of(rng, names, *, noise=1.0, encoder_deg=0.02, seating_deg=0.01, poses=POSES):
    """Return what one unit reads in mountings of the seat of `TRUTH`."""
    gain = np.eye(3) + rng.normal(0.0, 0.06, (3, 3))
    accel_gain = np.eye(3) + rng.normal(0.0, 0.01, (3, 3))
    offset, accel_offset = rng.normal(0.0, 100.0, 3), rng.normal(0.0, 0.03, 3)
    seat = seat_rotation(TRUTH["index"], TRUTH["pitch"], TRUTH["roll"])
    iron = np.array([TRUTH["iron_x"], TRUTH["iron_y"], TRUTH["iron_z"]])
    encoders = Encoders(rng, encoder_deg)
    found = []
    for name in names:
        turns = ned_from_body(*(poses + encoders.error_deg(poses)).T)
        held = SEAT_FROM_UNIT[name] @ seat_rotation(*rng.normal(0.0, seating_deg, 3))
        field = (np.einsum("nji,j->ni", turns, FIELD_MG) @ seat + iron) @ held
        force = -turns[:, 2, :] @ seat @ held
        found.append((name, CalibrationData(
            field_mg=field @ gain.T + offset + noise * rng.normal(0.0, 0.35, field.shape),
            accel_g=force @ accel_gain.T + accel_offset
            + noise * rng.normal(0.0, 0.0004, force.shape),
            azimuth_deg=poses[:, 0], pitch_deg=poses[:, 1], roll_deg=poses[:, 2],
            field_sd_mg=0.35, accel_sd_g=0.0004,
            station_field_mg=np.array([250.0, 0.0, 250.0 * np.tan(np.pi / 3.0)]),
        )))  # fmt: skip
    return found


def told(found):
    x, y, z = found.iron_mg
    return {
        "index": found.index_deg, "pitch": found.pitch_deg, "roll": found.roll_deg, "iron_x": x,
        "iron_y": y, "iron_z": z, "field_azimuth": found.field_azimuth_deg, "dip": found.dip_deg,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("names", "observed"),
    [
        ((MARKED, TURNED), {"pitch", "roll", "iron_x", "iron_y"}),
        ((MARKED, OVER), {"pitch", "index", "iron_y", "iron_z"}),
        ((TURNED, OVER), {"index", "roll", "iron_x", "iron_z"}),
        (ALL, {"index", "pitch", "roll", "iron_x", "iron_y", "iron_z"}),
    ],
)
def test_each_pair_of_mountings_tells_what_is_across_its_turn_and_nothing_else(names, observed):
    former = SeatFound(index_deg=0.4, pitch_deg=0.02, roll_deg=0.03, iron_mg=(0.5, 0.25, -0.125))
    held = {
        "index": 0.4, "pitch": 0.02, "roll": 0.03, "iron_x": 0.5, "iron_y": 0.25, "iron_z": -0.125,
    }  # fmt: skip

    found = reversal(readings_of(np.random.default_rng(5), names), former=former)

    assert not found.refused
    assert set(found.observed) == observed
    assert set(found.u) == observed | {"field_azimuth", "dip"}
    for name in held.keys() - observed:
        assert told(found)[name] == pytest.approx(held[name], abs=1e-3)
    for name in found.u:
        assert abs(told(found)[name] - TRUTH[name]) < 2.0 * found.u[name], name


def test_the_truth_lies_within_the_uncertainty_in_95_of_100_cases():
    rng = np.random.default_rng(11)
    inside = []
    for _ in range(25):
        found = reversal(readings_of(rng, ALL))
        inside += [abs(told(found)[name] - TRUTH[name]) <= found.u[name] for name in found.u]

    assert len(inside) == 200
    assert np.mean(inside) > 0.92


def test_perfect_readings_give_the_truth_itself():
    quiet = readings_of(np.random.default_rng(2), ALL, noise=0.0, encoder_deg=0.0, seating_deg=0.0)

    found = reversal(quiet, doubts=QUIET)

    assert told(found) == pytest.approx(TRUTH, abs=1e-5)
    assert found.chi2_reduced < 1e-9
    assert found.seating_deg == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_the_order_of_the_mountings_does_not_matter():
    parts = readings_of(np.random.default_rng(3), ALL)

    found, other = reversal(parts), reversal(parts[::-1])

    for name in found.u:
        assert told(other)[name] == pytest.approx(told(found)[name], abs=0.02 * found.u[name])


def test_more_mountings_average_the_seating_but_not_the_encoder():
    rng = np.random.default_rng(4)
    once, thrice = reversal(readings_of(rng, ALL)), reversal(readings_of(rng, ALL * 3))

    assert thrice.budget["index"]["seating"] < 0.7 * once.budget["index"]["seating"]
    assert thrice.budget["roll"]["encoder"] > 0.9 * once.budget["roll"]["encoder"]
    assert thrice.u["index"] < once.u["index"]


def test_the_parts_of_the_budget_add_to_the_uncertainty_as_powers():
    found = reversal(readings_of(np.random.default_rng(6), ALL))

    for name, parts in found.budget.items():
        assert np.sqrt(sum(part**2 for part in parts.values())) == pytest.approx(found.u[name])


def test_a_unit_that_sits_badly_in_one_mounting_is_seen():
    parts = readings_of(np.random.default_rng(7), (*ALL, MARKED), seating_deg=0.0)
    name, data = parts[3]
    leaning = seat_rotation(0.0, 0.5, 0.0)
    parts[3] = (
        name,
        replace(data, field_mg=data.field_mg @ leaning, accel_g=data.accel_g @ leaning),
    )

    found = reversal(parts)

    assert found.refused or max(found.seating_deg) > 0.05


def test_one_mounting_is_refused_and_says_why():
    (part,) = readings_of(np.random.default_rng(8), (MARKED,))

    found = reversal([part, part])

    assert found.cause is ReversalCause.TOO_FEW_MOUNTINGS
    assert "at least two different mountings" in found.message


def test_a_unit_that_was_not_turned_is_found_out():
    parts = readings_of(np.random.default_rng(9), (MARKED, MARKED))

    found = reversal([parts[0], (TURNED, parts[1][1])])

    assert found.cause is ReversalCause.WRONG_MOUNTING
    assert found.message.startswith("the unit must sit turned; instead its readings say as marked")


def test_level_poses_give_no_calibration_and_no_reversal():
    level = np.array([(60.0 * k, 0.0, 0.0) for k in range(6)])
    parts = readings_of(np.random.default_rng(10), ALL, poses=level)

    found = reversal(parts)

    assert found.cause is ReversalCause.NO_FIT
    assert found.message.startswith("mounting as_marked: tilt_too_small")


def test_without_acceleration_there_is_no_reversal():
    parts = readings_of(np.random.default_rng(10), ALL)

    found = reversal([(name, replace(data, accel_g=None)) for name, data in parts])

    assert found.cause is ReversalCause.NO_FIT
    assert "a reversal needs acceleration" in found.message


def test_a_field_that_changes_between_the_mountings_is_refused():
    parts = readings_of(np.random.default_rng(12), ALL)
    name, data = parts[1]
    turns = ned_from_body(*POSES.T)
    moved = np.einsum("nji,j->ni", turns, [8.0, 8.0, 0.0]) @ SEAT_FROM_UNIT[name]
    parts[1] = (name, replace(data, field_mg=data.field_mg + moved))

    found = reversal(parts)

    assert found.cause is ReversalCause.RESIDUAL_TOO_LARGE
    assert "the mountings contradict each other" in found.message


def test_a_disturbed_pose_is_left_out_and_counted():
    parts = readings_of(np.random.default_rng(13), ALL)
    name, data = parts[0]
    spoiled = data.field_mg.copy()
    spoiled[7] += [15.0, -10.0, 5.0]
    parts[0] = (name, replace(data, field_mg=spoiled))

    found = reversal(parts)

    assert found.left_out == 1
    assert abs(found.index_deg - TRUTH["index"]) < 2.0 * found.u["index"]


def test_each_mounting_is_its_own_inverse_and_known_again():
    for name, turn in SEAT_FROM_UNIT.items():
        assert turn @ turn == pytest.approx(np.eye(3))
        assert nearest_mounting(turn @ seat_rotation(3.0, -2.0, 1.0))[0] is name


@pytest.fixture
def state():
    rng = np.random.default_rng(20)
    return SeatState(
        gain=np.eye(3) + rng.normal(0.0, 0.05, (3, 3)), offset_mg=rng.normal(0.0, 50.0, 3),
        accel_gain=np.eye(3) + rng.normal(0.0, 0.01, (3, 3)),
        accel_offset_g=rng.normal(0.0, 0.03, 3), azimuth_rad=0.05, dip_rad=1.0, north_rad=0.0,
        east_rad=0.0, inner_from_seat=seat_rotation(0.6, -0.3, 0.2),
        iron_mg=np.array([1.0, -2.0, 0.5]),
    )  # fmt: skip


def test_the_derivatives_are_those_of_the_model(state):
    data = mounted(readings_of(np.random.default_rng(21), ALL), 500.0)
    jacobian = seat_rows(state, data).jacobian

    for column in range(jacobian.shape[2]):
        step = np.zeros(jacobian.shape[2])
        step[column] = 1e-5
        ends = [seat_rows(state.stepped(sign * step), data).modelled for sign in (1.0, -1.0)]
        assert (ends[0] - ends[1]) / 2e-5 == pytest.approx(jacobian[:, :, column], abs=2e-4), column


def test_a_seats_turn_is_read_back_as_index_pitch_and_roll(state):
    assert state.seat_deg() == pytest.approx((0.6, -0.3, 0.2))


def test_the_seating_effect_is_the_change_of_the_readings_by_that_turn(state):
    data = mounted(readings_of(np.random.default_rng(22), ALL), 500.0)
    rows = seat_rows(state, data)
    effect = effects(state, rows, data, BenchDoubts())
    column = effect.columns[:, seating_axes(effect, 3)[1, 2]].reshape(-1, 6)

    turned = seat_rotation(0.01, 0.0, 0.0)
    changed = np.hstack(
        [
            rows.field_unit_mg @ turned @ state.gain.T + state.offset_mg,
            rows.force_unit_g @ turned @ state.accel_gain.T + state.accel_offset_g,
        ]
    )
    there = data.mounting == 1
    assert column[~there] == pytest.approx(0.0)
    assert column[there] == pytest.approx((changed - rows.modelled)[there], abs=1e-5)


def test_a_drift_between_mountings_is_a_field_of_the_rig_for_one_mounting(state):
    data = mounted(readings_of(np.random.default_rng(23), ALL), 500.0)
    rows = seat_rows(state, data)
    effect = effects(state, rows, data, BenchDoubts(drift_mg=0.05))
    first_north = effect.of("field")[:, 0].reshape(-1, 6)

    there = data.mounting == 0
    north_mg = data.poses.turned(np.array([0.05, 0.0, 0.0]))
    assert first_north[~there] == pytest.approx(0.0)
    assert first_north[there, :3] == pytest.approx(
        np.einsum("nij,nj->ni", rows.to_field, north_mg)[there]
    )
    assert first_north[:, 3:] == pytest.approx(0.0)


def test_iron_is_known_no_better_than_the_strength_of_the_field():
    parts = readings_of(np.random.default_rng(24), ALL)
    known, doubted = (
        reversal(parts, doubts=replace(QUIET, strength=strength)) for strength in (0.0, 0.1)
    )

    for axis, name in enumerate(("iron_x", "iron_y", "iron_z")):
        added_mg = 2.0 * 0.1 * known.iron_mg[axis]
        assert doubted.u[name] == pytest.approx(np.hypot(known.u[name], added_mg), rel=1e-6)
    assert doubted.u["index"] == pytest.approx(known.u["index"])
