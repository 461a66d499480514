"""Rotations of 3-vectors in plain floats: in the simulator's tick numpy costs ten times as much.

A matrix is its nine elements row by row. `ned_from_body` times a body vector is a NED vector.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

Vector: TypeAlias = tuple[float, float, float]
Matrix: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]

IDENTITY: Final[Matrix] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def about_axis(axis: Vector, angle_deg: float) -> Matrix:
    """Return the rotation by `angle_deg` about a unit vector (Rodrigues), right-handed.

    >>> [round(element, 6) for element in about_axis((0.0, 0.0, 1.0), 90.0)]
    [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    """
    x, y, z = axis
    angle_rad = math.radians(angle_deg)
    c = math.cos(angle_rad)
    s = math.sin(angle_rad)
    v = 1.0 - c
    vx, vy, vz = v * x, v * y, v * z
    sx, sy, sz = s * x, s * y, s * z
    return (
        c + vx * x, vx * y - sz, vx * z + sy,
        vy * x + sz, c + vy * y, vy * z - sx,
        vz * x - sy, vz * y + sx, c + vz * z,
    )  # fmt: skip


def about_vertical(angle_deg: float) -> Matrix:
    """Return the rotation about the down axis: Rz, clockwise seen from above."""
    angle_rad = math.radians(angle_deg)
    c = math.cos(angle_rad)
    s = math.sin(angle_rad)
    return (c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)


def product(left: Matrix, right: Matrix) -> Matrix:
    """Return the matrix product left @ right."""
    a, b, c, d, e, f, g, h, i = left
    j, k, l, m, n, o, p, q, r = right  # noqa: E741
    return (
        a * j + b * m + c * p, a * k + b * n + c * q, a * l + b * o + c * r,
        d * j + e * m + f * p, d * k + e * n + f * q, d * l + e * o + f * r,
        g * j + h * m + i * p, g * k + h * n + i * q, g * l + h * o + i * r,
    )  # fmt: skip


def transpose(matrix: Matrix) -> Matrix:
    """Return the transposed matrix: of a rotation, its inverse."""
    a, b, c, d, e, f, g, h, i = matrix
    return (a, d, g, b, e, h, c, f, i)


def apply(matrix: Matrix, vector: Vector) -> Vector:
    """Return matrix @ vector."""
    a, b, c, d, e, f, g, h, i = matrix
    x, y, z = vector
    return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)


def apply_inverse(rotation: Matrix, vector: Vector) -> Vector:
    """Return rotation.T @ vector, as for a body vector from `ned_from_body`."""
    a, b, c, d, e, f, g, h, i = rotation
    x, y, z = vector
    return (a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z)


def ned_from_body(azimuth_deg: float, pitch_deg: float, roll_deg: float) -> Matrix:
    """Return Rz(azimuth) Ry(pitch) Rx(roll) of a perfect rig."""
    tilted = product(about_axis((0.0, 1.0, 0.0), pitch_deg), about_axis((1.0, 0.0, 0.0), roll_deg))
    return product(about_vertical(azimuth_deg), tilted)
