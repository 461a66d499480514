"""One row a tick: what the module sent and where the rig was; and one row a pose.

`SAMPLE` is in physical units. A `READING` is the mean of the samples of one dwell at a
settled pose; headings are circular means.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from protocols.angles import circular_mean_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

COMPLETE: Final = 0b1111
"""Bits of `complete`: 1 set reading, 2 reset reading, 4 acceleration, 8 heading."""
MOVING: Final = -1
"""Value of `position` for samples outside a dwell."""

SAMPLE: Final = np.dtype(
    [
        ("t_s", "f8"),
        ("tick", "i4"),
        ("position", "i2"),
        ("group", "u1"),
        ("complete", "u1"),
        ("set_mg", "f8", 3),
        ("reset_mg", "f8", 3),
        ("accel_g", "f8", 3),
        ("heading_deg", "f8"),
        ("pitch_deg", "f8"),
        ("roll_deg", "f8"),
        ("quality", "u1"),
        ("flags", "u1"),
        ("rig_azimuth_deg", "f8"),
        ("rig_pitch_deg", "f8"),
        ("rig_roll_deg", "f8"),
        ("temperature_c", "f8"),
        ("reference_mg", "f8", 3),  # of the reference magnetometer, NaN where there is none
    ]
)

READING: Final = np.dtype(
    [
        ("position", "i2"),
        ("count", "i4"),
        ("t_s", "f8"),
        ("rig_azimuth_deg", "f8"),
        ("rig_pitch_deg", "f8"),
        ("rig_roll_deg", "f8"),
        ("set_mg", "f8", 3),
        ("reset_mg", "f8", 3),
        ("field_mg", "f8", 3),  # (set - reset)/2
        ("noise_mg", "f8", 3),  # standard deviation of single set and reset readings
        ("offset_mg", "f8", 3),  # (set + reset)/2
        ("peak_mg", "f8", 3),  # largest |set| or |reset| of any sample
        ("accel_g", "f8", 3),
        ("accel_sd_g", "f8", 3),
        ("heading_deg", "f8"),  # the module's own
        ("pitch_deg", "f8"),
        ("roll_deg", "f8"),
        ("temperature_c", "f8"),
        ("reference_mg", "f8", 3),
    ]
)


def reading_of(samples: NDArray[np.void]) -> NDArray[np.void]:
    """Return the READING, shape (), of the complete samples of one dwell.

    Parameters
    ----------
    samples : ndarray of SAMPLE, shape (n,), n >= 2
        Samples of one position; incomplete ones must have been left out.

    Raises
    ------
    ValueError
        If there are fewer than two samples or they are of several positions.
    """
    positions = np.unique(samples["position"])
    if len(samples) < 2 or len(positions) != 1:
        message = (
            "a reading needs at least two samples of one position; instead received "
            f"{len(samples)} samples of positions {positions.tolist()}"
        )
        raise ValueError(message)
    reading = np.zeros((), dtype=READING)
    field_mg = (samples["set_mg"] - samples["reset_mg"]) / 2.0
    reading["position"] = positions[0]
    reading["count"] = len(samples)
    reading["field_mg"] = field_mg.mean(axis=0)
    variances = [samples[name].var(axis=0, ddof=1) for name in ("set_mg", "reset_mg")]
    reading["noise_mg"] = np.sqrt((variances[0] + variances[1]) / 2.0)
    reading["offset_mg"] = ((samples["set_mg"] + samples["reset_mg"]) / 2.0).mean(axis=0)
    peaks = np.maximum(np.abs(samples["set_mg"]), np.abs(samples["reset_mg"]))
    reading["peak_mg"] = peaks.max(axis=0)
    reading["accel_sd_g"] = samples["accel_g"].std(axis=0, ddof=1)
    for name in ("t_s", "pitch_deg", "roll_deg", "rig_pitch_deg", "rig_roll_deg", "temperature_c"):
        reading[name] = samples[name].mean()
    for name in ("set_mg", "reset_mg", "accel_g", "reference_mg"):
        reading[name] = samples[name].mean(axis=0)
    for name in ("heading_deg", "rig_azimuth_deg"):
        reading[name] = circular_mean_deg(samples[name])
    return reading


def readings_of(samples: NDArray[np.void]) -> NDArray[np.void]:
    """Return one READING for each position in the samples, in order of position.

    Parameters
    ----------
    samples : ndarray of SAMPLE, shape (n,)
        Samples of a run; moving and incomplete ones are left out here.
    """
    usable = samples[(samples["position"] != MOVING) & (samples["complete"] == COMPLETE)]
    positions, counts = np.unique(usable["position"], return_counts=True)
    rows = [
        reading_of(usable[usable["position"] == position]) for position in positions[counts >= 2]
    ]
    return np.array(rows, dtype=READING)
