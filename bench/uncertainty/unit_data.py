"""What is known of a part from its data sheets, and no single run can see: its type B data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitData:
    """Type B data of a part; they stand in the section `unit` of its limits file.

    Attributes
    ----------
    repeatability_mg : float
        Standard deviation of the field read at a pose that is reached anew, each axis.
    hysteresis_mg : float
        Half width of the play between rising and falling field, each axis.
    converter_mg : float
        One count of the magnetometer's converter.
    accel_tempco_g_per_c : float
        Largest change of the accelerometer's zero with temperature, either sign.
    accel_wander_g : float
        Random walk of the accelerometer's zero, standard deviation after 100 s.
    """

    repeatability_mg: float = 0.0
    hysteresis_mg: float = 0.0
    converter_mg: float = 0.0
    accel_tempco_g_per_c: float = 0.0
    accel_wander_g: float = 0.0
