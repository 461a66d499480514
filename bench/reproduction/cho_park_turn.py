"""Cho & Park's second experiment: a turn at a pitch of 30 deg, with and without the dip known.

Uncompensated (Fig. 6), with the dip of the latitude (Fig. 7) and with the estimated extended dip
angle (Fig. 8), which is also written to the module: its own heading is the last column.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.tilt import heading_deg, ned_from_body, two_axis_attitude_deg
from bench.calibration.two_axis import estimated_z_mg
from bench.pose import Attitude
from bench.reproduction.cho_park_table import HORIZONTAL_MG, SITE_DIP_DEG
from protocols.angles import wrap_180_deg
from protocols.uds import Coefficients

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from bench.calibration.fit import Fit
    from bench.reproduction.laboratory import Laboratory

PITCH_DEG: Final = 30.0
SEOUL_DIP_DEG: Final = 56.91
TURN_DEG: Final = np.arange(0.0, 360.0, 4.0)
FIELD_MG: Final = HORIZONTAL_MG / np.cos(np.deg2rad(SITE_DIP_DEG))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Compensated:
    """A turn with one dip angle taken for true; arrays of shape (n,).

    `z` is the estimate of the third axis over the field, `error_deg` that of the heading.
    """

    dip_deg: float
    z: NDArray[np.float64]
    error_deg: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Turn:
    """What the turn at pitch gave; arrays of shape (n,).

    Attributes
    ----------
    heading_deg, pitch_deg : ndarray
        True heading from the rig; pitch that the module measured.
    z : ndarray
        Measured along the extra axis, over the site's field.
    uncompensated_deg : ndarray
        Heading error of x and y taken for level.
    latitude, estimated : Compensated
        With the dip of Seoul's latitude, and with the estimated one.
    own_error_deg : ndarray
        Error of the heading that the module itself sends, with the estimated dip written to it.
    """

    heading_deg: NDArray[np.float64]
    pitch_deg: NDArray[np.float64]
    z: NDArray[np.float64]
    uncompensated_deg: NDArray[np.float64]
    latitude: Compensated
    estimated: Compensated
    own_error_deg: NDArray[np.float64]


def with_dip(normal: Fit, dip_deg: float) -> Fit:
    """Return the fit of the level turn with an extended dip angle: heading from two axes."""
    assert normal.field_mg is not None  # noqa: S101
    extra = {**normal.extra, "horizontal_mg": normal.field_mg}
    return replace(normal, method="two_axis", extended_dip_deg=dip_deg, extra=extra)


def turn_at_pitch(lab: Laboratory, normal: Fit, dip_deg: float) -> Turn:
    """Write the estimated dip to the module, turn it at a pitch of 30 deg and compare."""
    lab.module.diagnostics.write_coefficients(coefficients_of(with_dip(normal, dip_deg)))
    poses = [Attitude(azimuth_deg=float(a), pitch_deg=PITCH_DEG) for a in TURN_DEG]
    readings = lab.measure(poses)
    field_mg, accel_g = readings["field_mg"], readings["accel_g"]
    true_deg = readings["rig_azimuth_deg"]
    flat_deg = heading_deg(normal.corrected_mg(field_mg), 0.0, 0.0)
    return Turn(
        heading_deg=true_deg,
        pitch_deg=two_axis_attitude_deg(normal.corrected_g(accel_g))[0],
        z=field_mg[:, 2] / FIELD_MG,
        uncompensated_deg=wrap_180_deg(flat_deg - true_deg),
        latitude=_compensated(with_dip(normal, SEOUL_DIP_DEG), field_mg, accel_g, true_deg),
        estimated=_compensated(with_dip(normal, dip_deg), field_mg, accel_g, true_deg),
        own_error_deg=wrap_180_deg(readings["heading_deg"] - true_deg),
    )


def coefficients_of(fit: Fit) -> Coefficients:
    """Return a two-axis fit as the module keeps it.

    Raises
    ------
    ValueError
        If the fit was refused or is not for two axes.
    """
    values = (fit.offset_mg, fit.matrix, fit.accel_offset_g, fit.accel_matrix)
    flat = [tuple(float(v) for v in np.ravel(value)) for value in values if value is not None]
    if len(flat) != len(values) or fit.extended_dip_deg is None:
        message = f"fit must be one for two axes with accelerometers; instead received {fit.method}"
        raise ValueError(message)
    return Coefficients(
        version=1,
        mag_offset_mg=flat[0],
        mag_matrix=flat[1],
        accel_offset_g=flat[2],
        accel_matrix=flat[3],
        extended_dip_deg=fit.extended_dip_deg,
        horizontal_mg=fit.extra["horizontal_mg"],
    )


def exact_errors_deg(dip_deg: float | None) -> NDArray[np.float64]:
    """Return the noiseless heading error of the turn, a degree apart, shape (360,).

    With None nothing is compensated. The figures show it behind the measurement.
    """
    azimuth_deg = np.arange(360.0)
    field = _site_field(azimuth_deg)
    if dip_deg is None:
        return wrap_180_deg(heading_deg(field, 0.0, 0.0) - azimuth_deg)
    field[:, 2] = estimated_z_mg(field, PITCH_DEG, 0.0, horizontal_mg=1.0, dip_deg=dip_deg)
    return wrap_180_deg(heading_deg(field, PITCH_DEG, 0.0) - azimuth_deg)


def exact_z_error(dip_deg: float) -> NDArray[np.float64]:
    """Return the noiseless error of the estimated z over the field, shape (360,)."""
    field = _site_field(np.arange(360.0))
    z = estimated_z_mg(field, PITCH_DEG, 0.0, horizontal_mg=1.0, dip_deg=dip_deg)
    cosine, site = np.cos(np.deg2rad((dip_deg, SITE_DIP_DEG)))
    return np.asarray(z * cosine - field[:, 2] * site)


def _site_field(azimuth_deg: ArrayLike) -> NDArray[np.float64]:
    ned = np.array([1.0, 0.0, np.tan(np.deg2rad(SITE_DIP_DEG))])
    return np.asarray(ned @ ned_from_body(azimuth_deg, PITCH_DEG, 0.0))


def _compensated(
    fit: Fit,
    field_mg: NDArray[np.float64],
    accel_g: NDArray[np.float64],
    true_deg: NDArray[np.float64],
) -> Compensated:
    assert fit.extended_dip_deg is not None  # noqa: S101
    dip_deg, horizontal_mg = fit.extended_dip_deg, fit.extra["horizontal_mg"]
    pitch_deg, roll_deg = two_axis_attitude_deg(fit.corrected_g(accel_g))
    z_mg = estimated_z_mg(
        fit.corrected_mg(field_mg),
        pitch_deg,
        roll_deg,
        horizontal_mg=horizontal_mg,
        dip_deg=dip_deg,
    )
    found_deg = compensated_heading_deg(fit, field_mg, accel_g)
    return Compensated(
        dip_deg=dip_deg,
        z=z_mg * np.cos(np.deg2rad(dip_deg)) / horizontal_mg,  # (7): a field of length 1
        error_deg=wrap_180_deg(found_deg - true_deg),
    )
