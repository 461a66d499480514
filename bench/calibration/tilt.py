"""Attitude from specific force and tilt-compensated magnetic heading.

Body frame x forward, y right, z down; NED; ned_from_body = Rz(azimuth) Ry(pitch) Rx(roll).
Specific force of a module at rest and level is (0, 0, -1) g.

References
----------
.. [1] S. Y. Cho and C. G. Park, "A Calibration Technique for a Two-Axis Magnetic Compass in
   Telematics Devices", ETRI Journal 27(3), 2005, equations (17) and (21)-(24). Equation (24)
   is printed with a one-argument arctangent; the quadrant needs atan2(b, a). Equation (17)
   reads a roll of 100 deg as 80; with three axes atan2 does not.
.. [2] M. J. Caruso, "Applications of Magnetic Sensors for Low Cost Compass Systems", PLANS
   2000, equations (1)-(3). Its z axis points up, which `caruso_heading_deg` keeps; (1) mirrors
   the heading and is not used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from protocols.angles import wrap_360_deg

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def ned_from_body(
    azimuth_deg: ArrayLike, pitch_deg: ArrayLike, roll_deg: ArrayLike
) -> NDArray[np.float64]:
    """Return rotation matrices, shape (..., 3, 3), with v_ned = ned_from_body @ v_body.

    Parameters
    ----------
    azimuth_deg, pitch_deg, roll_deg : array-like, shape (...)
        Intrinsic z-y-x angles: clockwise from north, nose up, right side down.

    Examples
    --------
    >>> abs(ned_from_body(90.0, 0.0, 0.0)[:, 0]).round(12).tolist()  # nose to the east
    [0.0, 1.0, 0.0]
    """
    azimuth_rad, pitch_rad, roll_rad = np.broadcast_arrays(
        *(np.deg2rad(np.asarray(angle, float)) for angle in (azimuth_deg, pitch_deg, roll_deg))
    )
    sa, ca = np.sin(azimuth_rad), np.cos(azimuth_rad)
    sp, cp = np.sin(pitch_rad), np.cos(pitch_rad)
    sr, cr = np.sin(roll_rad), np.cos(roll_rad)
    rows = (
        (ca * cp, ca * sp * sr - sa * cr, ca * sp * cr + sa * sr),
        (sa * cp, sa * sp * sr + ca * cr, sa * sp * cr - ca * sr),
        (-sp, cp * sr, cp * cr),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def attitude_deg(accel_g: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (pitch_deg, roll_deg), each shape (...), from the specific force.

    pitch = atan2(fx, hypot(fy, fz)), roll = atan2(-fy, -fz) [1]_; the length of the force
    does not matter.

    Parameters
    ----------
    accel_g : array-like, shape (..., 3)
        Specific force in g, not gravity.

    Examples
    --------
    >>> pitch_deg, roll_deg = attitude_deg([0.5, 0.0, -0.75**0.5])
    >>> round(float(pitch_deg), 9), abs(round(float(roll_deg), 9))
    (30.0, 0.0)
    """
    force = np.asarray(accel_g, dtype=float)
    pitch_rad = np.arctan2(force[..., 0], np.hypot(force[..., 1], force[..., 2]))
    roll_rad = np.arctan2(-force[..., 1], -force[..., 2])
    return np.rad2deg(pitch_rad), np.rad2deg(roll_rad)


def two_axis_attitude_deg(accel_g: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (pitch_deg, roll_deg), each shape (...), from the x and y force alone [1]_ (17).

    pitch = arcsin(fx/g), roll = arcsin(-fy/(g cos(pitch))): the force must be gravity's alone
    and the tilt below 90 deg. A force beyond 1 g reads as 90 deg.

    Parameters
    ----------
    accel_g : array-like, shape (..., 2 or more)
        Specific force in g; only x and y count.

    Examples
    --------
    >>> pitch_deg, roll_deg = two_axis_attitude_deg([0.5, 0.0])
    >>> round(float(pitch_deg), 9), abs(round(float(roll_deg), 9))
    (30.0, 0.0)
    """
    force = np.asarray(accel_g, dtype=float)
    sine = np.clip(force[..., 0], -1.0, 1.0)
    across = np.sqrt(np.maximum(1.0 - sine**2, 1e-12))
    pitch_rad = np.arcsin(sine)
    roll_rad = np.arcsin(np.clip(-force[..., 1] / across, -1.0, 1.0))
    return np.rad2deg(pitch_rad), np.rad2deg(roll_rad)


def heading_deg(
    field_mg: ArrayLike, pitch_deg: ArrayLike, roll_deg: ArrayLike
) -> NDArray[np.float64]:
    """Return magnetic headings in [0, 360), shape (...), of fields at known attitude.

    With a and b of [1]_ (21): heading = atan2(b, a), the quadrant of (24) by atan2.

    Parameters
    ----------
    field_mg : array-like, shape (..., 3)
        Corrected field in the body frame; any unit.
    pitch_deg, roll_deg : array-like, shape (...)
        Attitude.

    Examples
    --------
    >>> heading_deg([0.0, -250.0, 433.0], 0.0, 0.0).item()  # north is on the left: east
    90.0
    """
    field = np.asarray(field_mg, dtype=float)
    pitch_rad = np.deg2rad(np.asarray(pitch_deg, dtype=float))
    roll_rad = np.deg2rad(np.asarray(roll_deg, dtype=float))
    x, y, z = field[..., 0], field[..., 1], field[..., 2]
    lateral = y * np.sin(roll_rad) + z * np.cos(roll_rad)
    a = x * np.cos(pitch_rad) + lateral * np.sin(pitch_rad)
    b = z * np.sin(roll_rad) - y * np.cos(roll_rad)
    return wrap_360_deg(np.rad2deg(np.arctan2(b, a)))


def tilt_compensated_heading_deg(field_mg: ArrayLike, accel_g: ArrayLike) -> NDArray[np.float64]:
    """Return magnetic headings in [0, 360), shape (...), from field and specific force.

    Parameters
    ----------
    field_mg, accel_g : array-like, shape (..., 3)
        Corrected field and corrected specific force, both in the body frame.

    Examples
    --------
    >>> body_from_ned = ned_from_body(123.0, 20.0, -35.0).T
    >>> field, force = body_from_ned @ [250.0, 0.0, 433.0], body_from_ned @ [0.0, 0.0, -1.0]
    >>> round(float(tilt_compensated_heading_deg(field, force)), 9)
    123.0
    """
    pitch_deg, roll_deg = attitude_deg(accel_g)
    return heading_deg(field_mg, pitch_deg, roll_deg)


def caruso_heading_deg(
    X: ArrayLike, Y: ArrayLike, Z: ArrayLike, theta_deg: ArrayLike, phi_deg: ArrayLike
) -> NDArray[np.float64]:
    """Return magnetic headings in [0, 360), shape (...), in Caruso's symbols [2]_ (2)-(3).

    His body is left-handed: x forward, y right, z *up*; theta is roll, phi is pitch, nose up and
    right side down positive. From the product's frame negate z, and nothing else: with both tilts
    negated too the heading is wrong by up to 180 deg. The quadrants of (3) are those of atan2.

    Parameters
    ----------
    X, Y, Z : array-like, shape (...)
        Field, Z positive up.
    theta_deg, phi_deg : array-like, shape (...)
        Roll and pitch.

    Examples
    --------
    >>> X, Y, Z = ned_from_body(123.0, 20.0, -35.0).T @ [250.0, 0.0, 433.0]
    >>> round(float(caruso_heading_deg(X, Y, -Z, theta_deg=-35.0, phi_deg=20.0)), 9)
    123.0
    """
    X, Y, Z = (np.asarray(value, dtype=float) for value in (X, Y, Z))
    theta, phi = np.deg2rad(theta_deg), np.deg2rad(phi_deg)
    X_h = X * np.cos(phi) + Y * np.sin(theta) * np.sin(phi) - Z * np.cos(theta) * np.sin(phi)
    Y_h = Y * np.cos(theta) + Z * np.sin(theta)
    return wrap_360_deg(np.rad2deg(np.arctan2(-Y_h, X_h)))


def cho_park_azimuth_deg(
    X: ArrayLike,
    Y: ArrayLike,
    Z: ArrayLike,
    theta_deg: ArrayLike,
    phi_deg: ArrayLike,
    gamma_deg: ArrayLike = 0.0,
) -> NDArray[np.float64]:
    """Return *true* azimuths in [0, 360), shape (...), in Cho & Park's symbols [1]_ (18), (21).

    Their body is the product's; theta is pitch and phi roll, the opposite letters of Caruso.
    gamma counts *west* declination positive: give minus the east declination.

    Parameters
    ----------
    X, Y, Z : array-like, shape (...)
        Normalised field; Z measured, or estimated by (10) (`two_axis.estimated_z_mg`).
    theta_deg, phi_deg : array-like, shape (...)
        Pitch and roll, (17).
    gamma_deg : array-like, shape (...)
        Declination, west positive; 0 leaves the azimuth magnetic, (24).

    Examples
    --------
    >>> X, Y, Z = ned_from_body(123.0, 20.0, -35.0).T @ [0.5, 0.0, 0.75**0.5]
    >>> round(float(cho_park_azimuth_deg(X, Y, Z, theta_deg=20.0, phi_deg=-35.0)), 9)
    123.0
    """
    X, Y, Z = (np.asarray(value, dtype=float) for value in (X, Y, Z))
    theta, phi = np.deg2rad(theta_deg), np.deg2rad(phi_deg)
    lateral = Y * np.sin(theta) * np.sin(phi) + Z * np.sin(theta) * np.cos(phi)
    a = X * np.cos(theta) + lateral
    b = -Y * np.cos(phi) + Z * np.sin(phi)
    return wrap_360_deg(np.rad2deg(np.arctan2(b, a)) - np.asarray(gamma_deg, dtype=float))
