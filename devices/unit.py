"""One compass module as it left production: its parameters, drawn from serial and seed."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from devices.accelerometer import Accelerometer
from devices.bridge import ACROSS, RANGE_MG, BridgeParameters, Strap
from devices.field import EarthField
from devices.magnetics import Magnetics
from devices.rotation import Matrix, Vector, about_axis, product
from protocols.compass import PART_THREE_AXIS, PART_TWO_AXIS

NOISE_MG: Final = 0.085
"""Noise of one reading (Caruso, Table 1: 85 uG in 10 Hz)."""
PINK_SHARE: Final = 0.5
"""Part of that noise which is 1/f: set and reset reading share it, their difference does not."""
PEAK_MG: Final = 705.0
"""Largest set or reset reading of a good unit, at every heading and up to 35 deg of tilt."""
PEAK_TILT_DEG: Final = 35.0

_OFFSET_MG: Final = 50.0
_CUBIC_PER_MG2: Final = 0.2 / 400.0**3
_HYSTERESIS_MG: Final = 0.16
_REPEATABILITY_MG: Final = 0.32
_BIAS_G: Final = 0.030
_STREAM: Final = 0xC0
_PARAMETERS: Final = 1
_TWO_AXIS_PARAMETERS: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class _Iron:
    """How far iron and mounting of good units go.

    `stretch` and `shear` bound the parts of the soft iron's matrix, `hard_share` is the range of
    hard iron over the horizontal field, `misalignment_deg` the standard deviation of each of
    three angles of either sensor.
    """

    stretch: float
    shear: float
    hard_share: tuple[float, float]
    misalignment_deg: float


_THREE_AXIS_IRON: Final = _Iron(
    stretch=0.12,
    shear=0.08,
    hard_share=(0.3, 0.8),
    misalignment_deg=0.6,  # 1 deg for the sensor as a whole
)
_TWO_AXIS_IRON: Final = _Iron(
    stretch=0.03, shear=0.005, hard_share=(0.2, 0.5), misalignment_deg=0.2
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ModuleUnit:
    """Parameters of one module.

    Attributes
    ----------
    bridges : three BridgeParameters
        The x, y and z bridge.
    part : str
        Part number: CB-AMR3 makes its heading of three axes, CB-AMR2 of two. Both have all the
        sensors; the firmware of the two-axis part uses z of the field to check its estimate only,
        and z of the force not at all.
    bits, range_mg : int, float
        Resolution of the magnetometer's converter over +-range_mg.
    noise_mg : float
        Standard deviation of one set or reset reading, before the converter.
    ambient_c, self_heating_c, heating_s : float
        Temperature at power-on, its rise in the end, and the time constant of the rise.
    accel_wander_g : float
        Random walk of the accelerometer's zero, standard deviation after 100 s.
    supply_v : float
        Supply voltage that the module measures.
    """

    serial: str
    seed: int
    bridges: tuple[BridgeParameters, BridgeParameters, BridgeParameters]
    magnetics: Magnetics
    accelerometer: Accelerometer
    part: str = PART_THREE_AXIS
    strap: Strap = Strap()
    bits: int = 14
    range_mg: float = RANGE_MG
    noise_mg: float = NOISE_MG
    ambient_c: float = 25.0
    self_heating_c: float = 0.4
    heating_s: float = 500.0
    accel_wander_g: float = 0.0003
    supply_v: float = 5.0

    @property
    def mag_mg_per_count(self) -> float:
        """Scale of the magnetometer's counts, mG."""
        return 2.0 * self.range_mg / 2.0**self.bits

    @property
    def accel_g_per_count(self) -> float:
        """Scale of the accelerometer's counts, g: 16 bits over +-2 g."""
        return 4.0 / 2.0**16

    def temperature_c(self, t_s: float) -> float:
        """Return the module's temperature some time after power-on."""
        return self.ambient_c + self.self_heating_c * (1.0 - math.exp(-t_s / self.heating_s))


def unit_stream(serial: str, seed: int, purpose: int) -> np.random.Generator:
    """Return the random generator of a unit for one purpose (1 parameters, 2 noise, ...)."""
    return np.random.default_rng((_STREAM, seed, zlib.crc32(serial.encode()), purpose))


def draw_unit(
    serial: str,
    seed: int,
    *,
    site: EarthField | None = None,
    bits: int = 14,
    part: str = PART_THREE_AXIS,
) -> ModuleUnit:
    """Return a good unit: within its data sheets and within its converter's range.

    Hard iron that would drive a reading past `PEAK_MG` at the site is trimmed, as a factory
    does by moving or degaussing the part.

    The two-axis part comes of a stream of its own and has little iron, because its method needs
    that: what x and y see of the field's z (vertical soft iron and a bridge that leans, together
    c) changes with the tilt, and two axes cannot tell it from a tilt. After the best calibration
    c = 0.02 leaves up to 0.83 deg at a roll of 30 deg, and 0.05 leaves 2.08. c of these units is
    0.006 in the median; their best calibration leaves 0.4 deg at 30 deg of tilt (median of the
    largest errors; 0.9 in the worst of 200 units), and the paper's own 0.7 (1.6).

    Parameters
    ----------
    serial : str
        Serial number; another serial is another unit.
    seed : int
        Seed of the production lot, at least 0.
    site : EarthField, optional
        Field in which the unit is meant to work; 250 mG and 60 deg by default.
    bits : int
        Resolution of its converter.
    part : str
        Part number.
    """
    two_axis = part == PART_TWO_AXIS
    rng = unit_stream(serial, seed, _TWO_AXIS_PARAMETERS if two_axis else _PARAMETERS)
    iron = _TWO_AXIS_IRON if two_axis else _THREE_AXIS_IRON
    common_tempco_per_c = rng.normal(-0.003, 0.0002)
    x, y, z = (_draw_bridge(rng, common_tempco_per_c) for _ in range(3))
    unit = ModuleUnit(
        serial=serial,
        seed=seed,
        bridges=(x, y, z),
        magnetics=_draw_magnetics(rng, site or EarthField(), iron),
        accelerometer=_draw_accelerometer(rng, iron.misalignment_deg),
        part=part,
        bits=bits,
        ambient_c=float(rng.uniform(22.0, 26.0)),
        supply_v=float(rng.uniform(4.9, 5.1)),
    )
    return _within_range(unit, site or EarthField())


def peak_reading_mg(unit: ModuleUnit, site: EarthField, tilt_deg: float = PEAK_TILT_DEG) -> float:
    """Return the largest noiseless set or reset reading at every heading and up to a tilt."""
    down_rad = np.deg2rad(np.linspace(0.0, tilt_deg, 6))[:, None]
    lean_rad = np.deg2rad(np.arange(0.0, 360.0, 15.0))[None, :]
    gravity = np.stack(
        np.broadcast_arrays(
            np.sin(down_rad) * np.cos(lean_rad),
            np.sin(down_rad) * np.sin(lean_rad),
            np.cos(down_rad),
        ),
        axis=-1,
    ).reshape(-1, 3)
    level = np.cross(gravity, [0.0, 1.0, 0.0])
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    other = np.cross(gravity, level)
    turn_rad = np.deg2rad(np.arange(0.0, 360.0, 5.0))[:, None, None]
    down_mg = site.ned_mg[2]
    field_mg = (
        site.horizontal_mg * (np.cos(turn_rad) * level + np.sin(turn_rad) * other)
        + down_mg * gravity
    )
    iron = unit.magnetics
    sensor_mg = field_mg.reshape(-1, 3) @ np.reshape(iron.soft_iron, (3, 3)).T + np.asarray(
        iron.hard_iron_mg
    )
    peak_mg = 0.0
    for axis, bridge in enumerate(unit.bridges):
        across_mg = np.abs(sensor_mg[:, ACROSS[axis]])
        reading_mg = (
            bridge.sensitivity * np.abs(sensor_mg[:, axis]) / (1.0 - across_mg / bridge.hk_mg)
        )
        peak_mg = max(peak_mg, float(reading_mg.max()) + abs(bridge.offset_mg))
    return peak_mg


def _within_range(unit: ModuleUnit, site: EarthField) -> ModuleUnit:
    while peak_reading_mg(unit, site) > PEAK_MG:
        iron = unit.magnetics
        x, y, z = iron.hard_iron_mg
        x, y, z = 0.95 * x, 0.95 * y, 0.9 * z
        if math.hypot(x, y, z) < 1.0:
            # nothing left to trim: the field alone is too strong for the converter
            break
        unit = replace(unit, magnetics=replace(iron, hard_iron_mg=(x, y, z)))
    return unit


def _draw_bridge(rng: np.random.Generator, common_tempco_per_c: float) -> BridgeParameters:
    return BridgeParameters(
        sensitivity=float(np.clip(rng.normal(1.0, 0.015), 0.95, 1.05)),
        sensitivity_tempco_per_c=float(common_tempco_per_c + rng.normal(0.0, 0.0001)),
        offset_mg=float(rng.uniform(-_OFFSET_MG, _OFFSET_MG)),
        offset_tempco_mg_per_c=float(rng.normal(0.0, 0.3)),
        hk_mg=float(rng.normal(8000.0, 300.0)),
        cubic_per_mg2=float(rng.uniform(-1.0, 1.0)) * _CUBIC_PER_MG2,
        hysteresis_mg=float(rng.uniform(0.7, 1.3)) * _HYSTERESIS_MG,
        repeatability_mg=_REPEATABILITY_MG,
    )


def _draw_magnetics(rng: np.random.Generator, site: EarthField, iron: _Iron) -> Magnetics:
    stretch = rng.uniform(-iron.stretch, iron.stretch, 3)
    shear = rng.uniform(-iron.shear, iron.shear, 3)
    soft: Matrix = (
        1.0 + float(stretch[0]), float(shear[0]), float(shear[1]),
        float(shear[0]), 1.0 + float(stretch[1]), float(shear[2]),
        float(shear[1]), float(shear[2]), 1.0 + 0.5 * float(stretch[2]),
    )  # fmt: skip
    share = rng.uniform(*iron.hard_share)
    towards_rad = rng.uniform(0.0, 2.0 * math.pi)
    hard_mg: Vector = (
        float(site.horizontal_mg * share * math.cos(towards_rad)),
        float(site.horizontal_mg * share * math.sin(towards_rad)),
        float(rng.uniform(-60.0, 60.0)),
    )
    turned = _draw_misalignment(rng, iron.misalignment_deg)
    return Magnetics(soft_iron=product(turned, soft), hard_iron_mg=hard_mg)


def _draw_accelerometer(rng: np.random.Generator, misalignment_deg: float) -> Accelerometer:
    bias_g = np.clip(rng.normal(0.0, _BIAS_G, 3), -2.5 * _BIAS_G, 2.5 * _BIAS_G)
    scale = 1.0 + rng.normal(0.0, 0.005, 3)
    turned = _draw_misalignment(rng, misalignment_deg)
    squareness = rng.normal(0.0, 0.003, 3)
    skewed: Matrix = (
        float(scale[0]), float(squareness[0]), float(squareness[1]),
        0.0, float(scale[1]), float(squareness[2]),
        0.0, 0.0, float(scale[2]),
    )  # fmt: skip
    # 0.2 % of +-2 g is 4 mg at the end of scale, from a x^2 and b x^3 together
    bend = rng.uniform(-1.0, 1.0, (2, 3)) * np.array([[0.5 * 0.004 / 4.0], [0.5 * 0.004 / 8.0]])
    return Accelerometer(
        matrix=product(skewed, turned),
        bias_g=_vector(bias_g),
        drift_g_per_c=_vector(rng.uniform(-0.002, 0.002, 3)),
        quadratic_per_g=_vector(bend[0]),
        cubic_per_g2=_vector(bend[1]),
    )


def _draw_misalignment(rng: np.random.Generator, misalignment_deg: float) -> Matrix:
    x_deg, y_deg, z_deg = (float(angle) for angle in rng.normal(0.0, misalignment_deg, 3))
    size_deg = math.sqrt(x_deg * x_deg + y_deg * y_deg + z_deg * z_deg)
    return about_axis((x_deg / size_deg, y_deg / size_deg, z_deg / size_deg), size_deg)


def _vector(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Vector:
    x, y, z = (float(value) for value in values)
    return (x, y, z)
