"""Konvalin's Figs. 6-10: circle, hard iron, ellipse; and soft iron as printed and corrected."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.min_max import fit_min_max
from bench.calibration.soft_iron import fit_soft_iron, soft_iron_batch
from bench.reproduction.printed_formulas import PrintedFormula, printed_soft_iron
from bench.reproduction.setup import Setup
from bench.reproduction.skula_turn import (
    FIELD_SD_MG,
    Turn,
    errors_deg,
    largest_error_deg,
    noisy_turns,
)
from bench.reproduction.turns import calibration_data, turn

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData, Fit
    from bench.reproduction.laboratory import OpenLaboratory

SITE: Final = Setup()
HARD_IRON_MG: Final = (60.0, -90.0, 0.0)
AXIS_RATIO: Final = 4.0 / 3.0
"""Major over minor axis: 8.2 deg of heading error."""
FIG_9_DEG: Final = 30.0
"""Direction of the major axis in Figs. 9 and 10, from x towards y."""
OBLIQUE_DEG: Final = 110.0
"""Direction at which the errata say what (4) leaves."""
AXES_DEG: Final = (0.0, 20.0, 50.0, 90.0, OBLIQUE_DEG, 140.0, 160.0)
"""Directions that the positions meet, so that (4) fails by its sign alone."""
SKEWED: Final = (1.0, 0.12, 0.0, 0.02, 1.0, 0.0, 0.0, 0.0, 1.0)
"""Soft iron with an antisymmetric part."""
POSITIONS: Final = 36
TURNS: Final = 30
NOISE_MG: Final = 1.0
FAILED_DEG: Final = 5.0
"""A turn whose largest error is more has failed: an axis off by one position leaves 2.6."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Corrected:
    """Readings of a level turn and what a fit makes of them; shape (n, 2) each.

    Attributes
    ----------
    raw : Turn
        (set - reset)/2.
    corrected_mg : ndarray
        By the product.
    fit : Fit
        `min_max` or `soft_iron`.
    """

    raw: Turn
    corrected_mg: NDArray[np.float64]
    fit: Fit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SoftIronStudy:
    """Noisy turns of an ellipse, compensated by the printed and by the corrected formula.

    Attributes
    ----------
    axis_deg : ndarray, shape (axes,)
        Direction of the major axis.
    failed : ndarray, shape (axes,)
        Part of the turns that (4) as printed leaves with more than 5 deg, (7) corrected.
    largest_deg : dict of str to ndarray, shape (axes,)
        Largest heading error of any noisy turn judged on the same axis: raw, angle ((4) as
        printed), ratio ((7) as printed), printed (both), ours.
    azimuth_deg : ndarray, shape (n,)
        Of the mean turn with the major axis at 110 deg.
    errors_deg : dict of str to ndarray, shape (n,)
        Errors over it that the worst noisy turn leaves, by each way.
    """

    axis_deg: NDArray[np.float64]
    failed: NDArray[np.float64]
    largest_deg: dict[str, NDArray[np.float64]]
    azimuth_deg: NDArray[np.float64]
    errors_deg: dict[str, NDArray[np.float64]]


def ellipse(axis_deg: float) -> Setup:
    """Return a module whose soft iron makes an ellipse of `AXIS_RATIO` along a direction."""
    half, twice_rad = (AXIS_RATIO - 1.0) / (AXIS_RATIO + 1.0), np.deg2rad(2.0 * axis_deg)
    along, across = half * float(np.cos(twice_rad)), half * float(np.sin(twice_rad))
    soft_iron = (1.0 + along, across, 0.0, across, 1.0 - along, 0.0, 0.0, 0.0, 1.0)
    return replace(SITE, soft_iron=soft_iron)


def measured_circle(open_laboratory: OpenLaboratory, setup: Setup) -> Corrected:
    """Turn a module with at most hard iron and correct it by (1)-(2)."""
    return _corrected(open_laboratory, setup, fit_min_max)


def measured_ellipse(open_laboratory: OpenLaboratory, setup: Setup) -> Corrected:
    """Turn a module with soft iron and correct it by rotate, scale, rotate back."""
    return _corrected(open_laboratory, setup, fit_soft_iron)


def _corrected(
    open_laboratory: OpenLaboratory, setup: Setup, method: Callable[[CalibrationData], Fit]
) -> Corrected:
    with open_laboratory(setup) as laboratory:
        readings = laboratory.measure(turn(POSITIONS))
    fit = method(calibration_data(readings, setup))
    return Corrected(
        raw=Turn(azimuth_deg=readings["rig_azimuth_deg"], field_mg=readings["field_mg"][:, :2]),
        corrected_mg=fit.corrected_mg(readings["field_mg"])[:, :2],
        fit=fit,
    )


def skew_deg(found: Corrected) -> tuple[float, float]:
    """Return mean and standard deviation of the heading errors that a fit leaves on its turn."""
    identity = PrintedFormula(offset_mg=np.zeros(2), matrix=np.eye(2))
    judged = Turn(azimuth_deg=found.raw.azimuth_deg, field_mg=found.corrected_mg)
    left_deg = errors_deg(identity, judged)
    return float(left_deg.mean()), float(left_deg.std())


def stages_mg(found: Corrected) -> list[NDArray[np.float64]]:
    """Return readings (n, 2) as turned by (5)-(6), scaled by q/r, and turned back."""
    theta_rad = np.deg2rad(found.fit.extra["theta_deg"])
    cosine, sine = np.cos(theta_rad), np.sin(theta_rad)
    rotation = np.array([[cosine, sine], [-sine, cosine]])
    aligned = found.raw.field_mg @ rotation.T
    scaled = aligned / np.array([found.fit.extra["axis_ratio"], 1.0])
    return [aligned, scaled, scaled @ rotation]


def soft_iron_study(
    open_laboratory: OpenLaboratory, axes_deg: tuple[float, ...] = AXES_DEG
) -> SoftIronStudy:
    """Compensate noisy turns of ellipses of several directions by each formula.

    `axes_deg` must hold `OBLIQUE_DEG`.
    """
    failed, largest = [], []
    oblique: dict[str, NDArray[np.float64]] = {}
    oblique_azimuth_deg = np.zeros(0)
    for axis_deg in axes_deg:
        judged, ways = _noisy_ways(open_laboratory, ellipse(axis_deg))
        left = {name: largest_error_deg(way, judged) for name, way in ways.items()}
        failed.append((left["angle"] > FAILED_DEG).mean())
        largest.append({name: float(values.max()) for name, values in left.items()})
        if axis_deg == OBLIQUE_DEG:
            oblique = {
                name: errors_deg(way, judged)[left[name].argmax()] for name, way in ways.items()
            }
            oblique_azimuth_deg = judged.azimuth_deg
    return SoftIronStudy(
        axis_deg=np.array(axes_deg),
        failed=np.array(failed),
        largest_deg={name: np.array([one[name] for one in largest]) for name in largest[0]},
        azimuth_deg=oblique_azimuth_deg,
        errors_deg=oblique,
    )


def _noisy_ways(
    open_laboratory: OpenLaboratory, setup: Setup
) -> tuple[Turn, dict[str, PrintedFormula]]:
    """Return the mean of noisy turns, on which all are judged, and each formula's fits of them."""
    noisy = noisy_turns(open_laboratory, replace(setup, noise_mg=NOISE_MG), POSITIONS, TURNS)
    judged = Turn(azimuth_deg=noisy.azimuth_deg, field_mg=noisy.field_mg.mean(axis=0))
    return judged, _ways(noisy.field_mg)


def _ways(turns_mg: NDArray[np.float64]) -> dict[str, PrintedFormula]:
    """Return each formula's fits of turns (turns, n, 2).

    What divides by sigma = q/r where it should multiply is undone by its inverse: so one error
    of the printed form shows without the other.
    """
    printed, ours = printed_soft_iron(turns_mg), soft_iron_batch(turns_mg, FIELD_SD_MG)
    nothing = np.broadcast_to(np.eye(2), printed.matrix.shape)
    return {
        "raw": PrintedFormula(offset_mg=0.0 * printed.offset_mg, matrix=nothing),
        "angle": replace(printed, matrix=_inverse(printed.matrix)),
        "ratio": PrintedFormula(offset_mg=ours.offset_mg, matrix=_inverse(ours.matrix)),
        "printed": printed,
        "ours": PrintedFormula(offset_mg=ours.offset_mg, matrix=ours.matrix),
    }


def _inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.inv(matrix), dtype=float)
