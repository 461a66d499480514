"""Claims of Konvalin's paper that fail as printed, each beside what the product does; exact data.

| paper | printed | used |
|---|---|---|
| (4) | theta = arcsin(y1/r) | the whole ellipse |
| (7) | x divided by sigma = q/r | the major axis divided by r/q |
| order | tilt, hard iron | hard iron in the body, tilt |
| rotate, scale, rotate back | removes soft iron | leaves the antisymmetric part |

The reverse sequence, bank for roll and level turns: test_calibration_errata, test_tilt_errata.
"""

from __future__ import annotations

import numpy as np
import pytest

from bench.calibration.compensation import Order, compensated_heading_deg
from bench.calibration.fit import CalibrationData, Fit
from bench.calibration.soft_iron import fit_soft_iron
from bench.calibration.tilt import heading_deg, ned_from_body
from bench.reproduction.konvalin_iron import ellipse
from bench.reproduction.printed_formulas import printed_soft_iron
from protocols.angles import wrap_180_deg

AZIMUTH = np.arange(0.0, 360.0, 1.0)
FIELD_NED = np.array([250.0, 0.0, 250.0 * 3.0**0.5])
NOISE_MG = 0.5


def turned(axis_deg: float) -> np.ndarray:
    """Readings of an ellipse with r/q = 4/3, which errs by 8.2 deg."""
    soft_iron = np.reshape(ellipse(axis_deg).soft_iron, (3, 3))
    level = ned_from_body(AZIMUTH, 0.0, 0.0).transpose(0, 2, 1) @ FIELD_NED
    return level @ soft_iron.T


def worst_deg(field_mg: np.ndarray, azimuth_deg: np.ndarray = AZIMUTH) -> float:
    return float(np.abs(wrap_180_deg(heading_deg(field_mg, 0.0, 0.0) - azimuth_deg)).max())


def corrected(field_mg: np.ndarray, offset_mg: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    return np.insert((field_mg[:, :2] - offset_mg) @ matrix.T, 2, 0.0, axis=1)


def test_arcsin_loses_the_sign_of_x_for_half_of_noisy_turns() -> None:
    """Major axis at 110 deg: 11.8 of 8.2 deg are left where the farthest reading has x1 < 0."""
    clean = turned(110.0)
    assert worst_deg(clean) == pytest.approx(8.2, abs=0.02)
    rng = np.random.default_rng(4)
    noisy = clean + NOISE_MG * rng.standard_normal((200, *clean.shape))
    printed = printed_soft_iron(noisy[..., :2])
    # (7) the right way round, so that (4) errs alone.
    matrices = np.linalg.inv(printed.matrix)
    left = np.array(
        [
            worst_deg(corrected(clean, offset, matrix))
            for offset, matrix in zip(printed.offset_mg, matrices, strict=True)
        ]
    )
    failed = left > worst_deg(clean)
    assert failed.mean() == pytest.approx(0.5, abs=0.12)
    assert np.median(left[failed]) == pytest.approx(11.8, abs=0.3)
    assert np.median(left[~failed]) < 1.0
    fits = [fit_soft_iron(CalibrationData(field_mg=turn)) for turn in noisy[:10]]
    assert max(worst_deg(fit.corrected_mg(clean)) for fit in fits) < 0.1


def test_arcsin_mirrors_the_axis_and_the_ellipse_fit_does_not() -> None:
    clean = turned(110.0)
    beyond = clean.copy()
    beyond[AZIMUTH == 250.0, :2] *= 1.0001  # the end of the axis at 110 deg, x1 < 0
    printed = printed_soft_iron(beyond[:, :2])
    mirrored = np.linalg.inv(printed.matrix)
    left = worst_deg(corrected(clean, printed.offset_mg, mirrored))
    assert left == pytest.approx(11.8, abs=0.1)
    fit = fit_soft_iron(CalibrationData(field_mg=beyond))
    assert fit.extra["theta_deg"] == pytest.approx(110.0, abs=0.01)
    assert worst_deg(fit.corrected_mg(clean)) < 0.01


@pytest.mark.parametrize("axis_deg", [0.0, 30.0, 70.0])
def test_sigma_of_minor_over_major_stretches_the_ellipse_further(axis_deg: float) -> None:
    """Axes of which (4) is right when the farthest reading has x1 > 0."""
    clean = turned(axis_deg)
    clean[np.isclose(AZIMUTH, (360.0 - axis_deg) % 360.0), :2] *= 1.000001
    printed = printed_soft_iron(clean[:, :2])
    left = worst_deg(corrected(clean, printed.offset_mg, printed.matrix))
    assert left == pytest.approx(16.3, abs=0.05)
    fit = fit_soft_iron(CalibrationData(field_mg=clean))
    assert fit.extra["axis_ratio"] == pytest.approx(4.0 / 3.0, abs=1e-4)
    assert worst_deg(fit.corrected_mg(clean)) < 0.01


def test_rotate_scale_rotate_leaves_the_antisymmetric_part_as_a_constant() -> None:
    """Soft iron of 0.12 and 0.02 off the diagonal: 2.8 deg on every heading."""
    skewed = np.array([[1.0, 0.12, 0.0], [0.02, 1.0, 0.0], [0.0, 0.0, 1.0]])
    raw = ned_from_body(AZIMUTH, 0.0, 0.0).transpose(0, 2, 1) @ FIELD_NED @ skewed.T
    fit = fit_soft_iron(CalibrationData(field_mg=raw))
    errors = wrap_180_deg(heading_deg(fit.corrected_mg(raw), 0.0, 0.0) - AZIMUTH)
    assert errors.mean() == pytest.approx(2.8, abs=0.1)
    assert np.ptp(errors) < 1e-6
    assert worst_deg(raw) > 6.0


def test_offsets_subtracted_after_tilt_leave_4_4_deg_and_before_it_none() -> None:
    """Hard iron of 0.2 of the field along (0.6, -0.4, -0.3) at pitch 25, roll -15."""
    direction = np.array([0.6, -0.4, -0.3])
    iron = 0.2 * np.linalg.norm(FIELD_NED) * direction / np.linalg.norm(direction)
    fit = Fit(method="known", offset_mg=iron, matrix=np.eye(3))
    body_from_ned = ned_from_body(AZIMUTH, 25.0, -15.0).transpose(0, 2, 1)
    raw, force = body_from_ned @ FIELD_NED + iron, body_from_ned @ [0.0, 0.0, -1.0]

    def left_deg(order: Order) -> float:
        found = compensated_heading_deg(fit, raw, force, order=order)
        return float(np.abs(wrap_180_deg(found - AZIMUTH)).max())

    assert left_deg(Order.TILT_FIRST) == pytest.approx(4.4, abs=0.05)
    assert left_deg(Order.TILT_REVERSED) == pytest.approx(9.1, abs=0.1)
    assert left_deg(Order.BODY) < 1e-9


def test_tilt_first_is_right_for_the_tilt_at_which_its_offsets_were_found() -> None:
    iron = np.array([60.0, -40.0, 30.0])
    tilt = ned_from_body(0.0, 25.0, -15.0)
    fit = Fit(method="known", offset_mg=tilt @ iron, matrix=np.eye(3))

    def left_deg(pitch_deg: float, roll_deg: float) -> float:
        raw = ned_from_body(AZIMUTH, pitch_deg, roll_deg).transpose(0, 2, 1) @ FIELD_NED + iron
        found = compensated_heading_deg(
            fit, raw, pitch_deg=pitch_deg, roll_deg=roll_deg, order=Order.TILT_FIRST
        )
        return float(np.abs(wrap_180_deg(found - AZIMUTH)).max())

    assert left_deg(25.0, -15.0) < 1e-9
    assert left_deg(0.0, 0.0) > 3.0
