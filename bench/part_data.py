"""Section `unit` of a limits file: what data sheets say of the part, and no single run can see."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator

from bench.quantity import Acceleration, AccelerationPerDegree, Milligauss
from bench.typed_yaml import FileModel
from bench.uncertainty.unit_data import UnitData


class PartData(FileModel):
    """Type B data of the part; with them the uncertainty of its heading errors is computed."""

    repeatability: Milligauss
    """Standard deviation of the field read at a pose that is reached anew, each axis."""
    hysteresis: Milligauss
    """Half width of the play between rising and falling field, each axis."""
    converter: Milligauss
    """One count of the magnetometer's converter."""
    accelerometer_tempco: AccelerationPerDegree
    """Largest change of the accelerometer's zero with temperature, either sign."""
    accelerometer_wander: Acceleration
    """Random walk of the accelerometer's zero: standard deviation after 100 s."""
    source: str = ""
    """Where the figures come from."""

    @model_validator(mode="after")
    def _is_possible(self) -> Self:
        for name in type(self).model_fields:
            value = getattr(self, name)
            if isinstance(value, float) and value < 0.0:
                message = f"{name} must not be negative; instead received {value:g}"
                raise ValueError(message)
        return self

    def data(self) -> UnitData:
        """Return what the budget takes."""
        return UnitData(
            repeatability_mg=self.repeatability,
            hysteresis_mg=self.hysteresis,
            converter_mg=self.converter,
            accel_tempco_g_per_c=self.accelerometer_tempco,
            accel_wander_g=self.accelerometer_wander,
        )
