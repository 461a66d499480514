"""What a paper's experiment is made of: site, module and rig, perfect unless it says otherwise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

Triple: TypeAlias = tuple[float, float, float]
"""One value for each of x, y and z."""

IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """Site, module and rig of one experiment.

    Attributes
    ----------
    part : str
        Part number of the module: CB-AMR3 has three axes, CB-AMR2 is Cho & Park's.
    horizontal_mg, dip_deg, declination_deg : float
        Field of the site.
    hard_iron_mg, soft_iron : floats
        Iron that turns with the module: sensor field = soft_iron @ body field + hard_iron_mg.
    sensitivity, sensitivity_tempco_per_c, offset_mg, offset_tempco_mg_per_c : Triple
        Gain (nominal 1) and offset of each bridge, and their change with temperature from 25 C.
    hk_mg : float
        Anisotropy field of the films; infinite switches the cross-axis term off.
    cubic_per_mg2 : Triple
        Cubic nonlinearity of each bridge.
    hysteresis_mg, repeatability_mg, noise_mg : float
        Half width of the play, standard deviation of a pose reached anew, of one reading.
    bits, range_mg : int, float
        Converter: resolution over +-range_mg.
    temperature_c : float
        Temperature of the module, constant.
    accel_bias_g, accel_noise_g : Triple, float
        Errors of the accelerometer.
    acceleration_level_g : Triple
        Acceleration of the vehicle along forward, right and down of its levelled frame (which
        turns with the azimuth only); the accelerometer reads it with gravity.
    azimuth_error_deg : float
        What the rig's azimuth encoder shows too much.
    azimuth_acceleration_dps2 : float
        Of the azimuth's moves, at most 180. The seat rings after a stop, by 0.03 deg at 180 and
        in proportion below, which shakes out hysteresis; a gentle rig leaves it.
    seed : int
        Seed of every noise.
    """

    part: str = "CB-AMR3"
    horizontal_mg: float = 250.0
    dip_deg: float = 60.0
    declination_deg: float = 0.0
    hard_iron_mg: Triple = (0.0, 0.0, 0.0)
    soft_iron: tuple[float, ...] = IDENTITY
    sensitivity: Triple = (1.0, 1.0, 1.0)
    sensitivity_tempco_per_c: Triple = (0.0, 0.0, 0.0)
    offset_mg: Triple = (0.0, 0.0, 0.0)
    offset_tempco_mg_per_c: Triple = (0.0, 0.0, 0.0)
    hk_mg: float = math.inf
    cubic_per_mg2: Triple = (0.0, 0.0, 0.0)
    hysteresis_mg: float = 0.0
    repeatability_mg: float = 0.0
    noise_mg: float = 0.0
    bits: int = 16
    range_mg: float = 800.0
    temperature_c: float = 25.0
    accel_bias_g: Triple = (0.0, 0.0, 0.0)
    accel_noise_g: float = 0.0
    acceleration_level_g: Triple = (0.0, 0.0, 0.0)
    azimuth_error_deg: float = 0.0
    azimuth_acceleration_dps2: float = 180.0
    seed: int = 1
