"""A linear module on the rig, drawn from a seed: what the fits must recover."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.calibration.fit import CalibrationData
from bench.calibration.tilt import ned_from_body

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """A drawn module and the readings that it gave."""

    data: CalibrationData
    gain: NDArray[np.float64]
    offset_mg: NDArray[np.float64]
    accel_gain: NDArray[np.float64]
    accel_offset_g: NDArray[np.float64]


def eol_angles_deg() -> NDArray[np.float64]:
    """24 headings clockwise and 24 counter-clockwise level, 6 at each of four tilts."""
    level = [(heading, 0.0, 0.0) for heading in range(0, 360, 15)]
    tilted = [
        (heading + 15.0 * index, pitch, roll)
        for index, (pitch, roll) in enumerate(((30, 0), (-30, 0), (0, 30), (0, -30)))
        for heading in range(0, 360, 60)
    ]
    return np.array([*level, *reversed(level), *tilted], dtype=float)


def station_mg(
    azimuth_deg: float = 0.0, dip_deg: float = 60.0, horizontal_mg: float = 250.0
) -> NDArray[np.float64]:
    azimuth_rad = np.deg2rad(azimuth_deg)
    down = np.tan(np.deg2rad(dip_deg))
    return horizontal_mg * np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), down])


def base_tilt(north_deg: float, east_deg: float) -> NDArray[np.float64]:
    """Small rotation of the base about north, then east, written apart from the product's."""
    north, east = np.deg2rad([north_deg, east_deg])
    about_north = np.array(
        [[1, 0, 0], [0, np.cos(north), -np.sin(north)], [0, np.sin(north), np.cos(north)]]
    )
    about_east = np.array(
        [[np.cos(east), 0, np.sin(east)], [0, 1, 0], [-np.sin(east), 0, np.cos(east)]]
    )
    return about_east @ about_north


def draw(
    seed: int,
    angles_deg: NDArray[np.float64] | None = None,
    *,
    field_sd_mg: float = 0.35,
    accel_sd_g: float = 0.0005,
    rig_sd_deg: float = 0.02,
    azimuth_deg: float = 0.0,
    dip_deg: float = 60.0,
    north_deg: float = 0.0,
    east_deg: float = 0.0,
    soft: float = 0.1,
) -> Truth:
    """Draw a module and read it at given angles, those of the end of line without."""
    rng = np.random.default_rng(seed)
    angles_deg = eol_angles_deg() if angles_deg is None else angles_deg
    gain = np.eye(3) + rng.normal(0.0, soft, (3, 3))
    offset_mg = rng.normal(0.0, 80.0, 3)
    accel_gain = np.eye(3) + rng.normal(0.0, 0.015, (3, 3))
    accel_offset_g = rng.normal(0.0, 0.03, 3)
    actual_deg = angles_deg + rng.normal(0.0, rig_sd_deg, angles_deg.shape)
    ned = base_tilt(north_deg, east_deg) @ ned_from_body(*actual_deg.T)
    body_mg = np.einsum("nji,j->ni", ned, station_mg(azimuth_deg, dip_deg))
    body_g = np.einsum("nji,j->ni", ned, np.array([0.0, 0.0, -1.0]))
    noise_mg = rng.normal(0.0, field_sd_mg, body_mg.shape)
    noise_g = rng.normal(0.0, accel_sd_g, body_g.shape)
    data = CalibrationData(
        field_mg=body_mg @ gain.T + offset_mg + noise_mg,
        accel_g=body_g @ accel_gain.T + accel_offset_g + noise_g,
        azimuth_deg=angles_deg[:, 0],
        pitch_deg=angles_deg[:, 1],
        roll_deg=angles_deg[:, 2],
        field_sd_mg=max(field_sd_mg, 1e-3),
        accel_sd_g=max(accel_sd_g, 1e-6),
        rig_sd_deg=rig_sd_deg,
        station_field_mg=station_mg(),
    )
    return Truth(
        data=data,
        gain=gain,
        offset_mg=offset_mg,
        accel_gain=accel_gain,
        accel_offset_g=accel_offset_g,
    )


@pytest.fixture(scope="session")
def drawn() -> Callable[..., Truth]:
    """Return a function that draws a module and reads it at given angles."""
    return draw


@pytest.fixture
def eol_deg() -> NDArray[np.float64]:
    return eol_angles_deg()
