"""One place turns raw readings into headings; what each order of compensation costs."""

from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.compensation import Order, compensated_heading_deg
from bench.calibration.fit import Cause, Fit
from bench.calibration.tilt import ned_from_body
from protocols.angles import wrap_180_deg

HEADINGS = np.arange(0.0, 360.0, 1.0)
HORIZONTAL_MG = 250.0
FIELD_NED = np.array([HORIZONTAL_MG, 0.0, HORIZONTAL_MG * 3.0**0.5])
STRENGTH_MG = 500.0
NO_IRON = np.zeros(3)
SOFT = np.array([[1.1, 0.03, -0.02], [0.05, 0.92, 0.04], [-0.03, 0.02, 1.05]])


def body(vector_ned: np.ndarray, pitch_deg: float, roll_deg: float) -> np.ndarray:
    return np.asarray(ned_from_body(HEADINGS, pitch_deg, roll_deg).transpose(0, 2, 1) @ vector_ned)


def fit_of(iron_mg: np.ndarray, soft: np.ndarray | None = None) -> Fit:
    matrix = np.eye(3) if soft is None else np.linalg.inv(soft)
    return Fit(method="known", offset_mg=iron_mg, matrix=matrix)


def worst_deg(
    order: Order,
    iron_mg: np.ndarray,
    pitch_deg: float,
    roll_deg: float,
    soft: np.ndarray | None = None,
) -> float:
    """Largest error of a module whose coefficients are known, compensated in an order."""
    sensor = np.eye(3) if soft is None else soft
    raw = body(FIELD_NED, pitch_deg, roll_deg) @ sensor.T + iron_mg
    found = compensated_heading_deg(
        fit_of(iron_mg, soft), raw, pitch_deg=pitch_deg, roll_deg=roll_deg, order=order
    )
    return float(np.abs(wrap_180_deg(found - HEADINGS)).max())


@pytest.mark.parametrize(("pitch", "roll"), [(0, 0), (25, -15), (30, 30), (-60, 40), (80, -120)])
def test_the_product_s_order_is_exact_at_every_attitude(pitch: float, roll: float) -> None:
    assert worst_deg(Order.BODY, np.array([120.0, -60.0, 90.0]), pitch, roll, SOFT) < 1e-9


@pytest.mark.parametrize(
    ("iron_mg", "left_deg"),
    [
        (0.2 * STRENGTH_MG * np.ones(3) / 3.0**0.5, 4.03),
        (0.2 * HORIZONTAL_MG * FIELD_NED / STRENGTH_MG, 4.4),
    ],
    ids=["0.2 of the field on the diagonal", "0.2 of the horizontal field along the field"],
)
def test_konvalin_s_order_leaves_four_degrees(iron_mg: np.ndarray, left_deg: float) -> None:
    """Body-fixed iron turns with the body: right for the tilt of the calibration only."""
    assert worst_deg(Order.TILT_FIRST, iron_mg, 25.0, -15.0) == pytest.approx(left_deg, abs=0.05)
    assert worst_deg(Order.TILT_FIRST, iron_mg, 0.0, 0.0) < 1e-9


def test_the_worst_direction_of_the_iron_leaves_eleven_degrees() -> None:
    """0.2 of the field: the largest singular value of what the tilt does to a body vector."""
    turned = (ned_from_body(0.0, 25.0, -15.0) - np.eye(3))[:2]
    _, size, rows = np.linalg.svd(turned)
    left = np.rad2deg(np.arcsin(0.2 * STRENGTH_MG * size[0] / HORIZONTAL_MG))
    found = worst_deg(Order.TILT_FIRST, 0.2 * STRENGTH_MG * rows[0], 25.0, -15.0)
    assert found == pytest.approx(left, abs=0.01)
    assert left == pytest.approx(11.6, abs=0.05)


@pytest.mark.parametrize(("pitch", "roll", "left_deg"), [(25.0, -15.0, 9.1), (30.0, 30.0, 23.9)])
def test_the_reverse_sequence_of_tilts_is_not_acceptable(
    pitch: float, roll: float, left_deg: float
) -> None:
    assert worst_deg(Order.TILT_REVERSED, NO_IRON, pitch, roll) == pytest.approx(left_deg, abs=0.1)
    assert worst_deg(Order.TILT_REVERSED, NO_IRON, pitch, 0.0) < 1e-9
    assert worst_deg(Order.TILT_REVERSED, NO_IRON, 0.0, roll) < 1e-9


def test_soft_iron_first_leaves_the_soft_iron_of_the_offset() -> None:
    """M raw - b instead of M (raw - b): an offset of (M - 1) b is left."""
    iron_mg = np.array([0.0, 100.0, 0.0])
    soft = np.diag([1.25, 0.8, 1.0])
    left_mg = 100.0 * (1.0 / 0.8 - 1.0)
    expected = np.rad2deg(np.arcsin(left_mg / HORIZONTAL_MG))
    assert worst_deg(Order.SOFT_FIRST, iron_mg, 0.0, 0.0, soft) == pytest.approx(expected, abs=0.01)
    assert worst_deg(Order.SOFT_FIRST, NO_IRON, 20.0, 30.0, soft) < 1e-9


def test_the_tilt_comes_from_the_force_before_the_angles_and_is_corrected() -> None:
    raw, force = body(FIELD_NED, 20.0, -10.0), body(np.array([0.0, 0.0, -1.0]), 20.0, -10.0)
    biased = force * [1.02, 0.97, 1.01] + [0.03, -0.02, 0.01]
    accelerometer = Fit(
        method="accelerometer",
        offset_mg=NO_IRON,
        matrix=np.eye(3),
        accel_offset_g=np.array([0.03, -0.02, 0.01]),
        accel_matrix=np.diag(1.0 / np.array([1.02, 0.97, 1.01])),
    )

    def worst(fit: Fit | None, accel_g: np.ndarray, tilt: Fit | None) -> float:
        found = compensated_heading_deg(fit, raw, accel_g, pitch_deg=70.0, tilt=tilt)
        return float(np.abs(wrap_180_deg(found - HEADINGS)).max())

    assert worst(None, force, None) < 1e-9
    assert worst(fit_of(NO_IRON), biased, None) > 2.0
    assert worst(fit_of(NO_IRON), biased, accelerometer) < 1e-9
    assert worst(accelerometer, biased, None) < 1e-9
    wrong = Fit(
        method="other",
        accel_offset_g=np.array([0.2, 0.0, 0.0]),
        accel_matrix=np.eye(3),
    )
    assert worst(accelerometer, biased, wrong) < 1e-9  # its own before a borrowed one


def test_readings_are_left_as_they_were() -> None:
    raw = body(FIELD_NED, 20.0, 10.0)
    kept = raw.copy()
    for order in Order:
        compensated_heading_deg(fit_of(NO_IRON, SOFT), raw, pitch_deg=20.0, order=order)
    compensated_heading_deg(two_axis_fit(), raw, pitch_deg=20.0, roll_deg=10.0)
    assert np.array_equal(raw, kept)


def two_axis_fit() -> Fit:
    matrix = np.eye(3)
    matrix[:2, :2] = np.linalg.inv(SOFT[:2, :2])
    return Fit(
        method="two_axis",
        offset_mg=np.array([40.0, -30.0, 0.0]),
        matrix=matrix,
        extended_dip_deg=60.0,
        extra={"horizontal_mg": HORIZONTAL_MG},
    )


@pytest.mark.parametrize("with_force", [False, True])
def test_two_axes_are_exact_below_60_degrees_whatever_z_reads(with_force: bool) -> None:
    rng = np.random.default_rng(1)
    tilt, towards = np.arccos(rng.uniform(0.5, 1.0, 500)), rng.uniform(0.0, 2.0 * np.pi, 500)
    down = np.column_stack(
        [-np.sin(tilt) * np.cos(towards), np.sin(tilt) * np.sin(towards), np.cos(tilt)]
    )
    pitch_deg = np.rad2deg(np.arcsin(-down[:, 0]))
    roll_deg = np.rad2deg(np.arctan2(down[:, 1], down[:, 2]))
    azimuth_deg = rng.uniform(0.0, 360.0, 500)
    rotations = ned_from_body(azimuth_deg, pitch_deg, roll_deg)
    field = np.einsum("nji,j->ni", rotations, FIELD_NED)
    raw = np.column_stack([field[:, :2] @ SOFT[:2, :2].T + [40.0, -30.0], rng.normal(0, 999, 500)])
    force = np.column_stack([-down[:, :2], rng.normal(0.0, 1.0, 500)])
    found = compensated_heading_deg(
        two_axis_fit(),
        raw,
        force if with_force else None,
        pitch_deg=pitch_deg,
        roll_deg=roll_deg,
    )
    assert np.abs(wrap_180_deg(found - azimuth_deg)).max() < 1e-9


def test_a_refused_fit_cannot_be_applied() -> None:
    with pytest.raises(ValueError, match="was refused"):
        compensated_heading_deg(Fit(method="x", cause=Cause.TOO_FEW), body(FIELD_NED, 0.0, 0.0))
