"""Numbers about the sensor itself: noise, set/reset pair, axis senses, peaks, hysteresis.

All functions are pure: one READING a pose in, measurements without limits out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from bench.acceptance.measurement import Measurement
from bench.acceptance.site import expected_field_mg, expected_force_g
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.acceptance.site import SiteField
    from bench.pose import Pose

AXES: Final = ("x", "y", "z")
NEIGHBOUR: Final = (1, 0, 0)
"""Axis whose field enters the cross-axis term of x, y and z."""
EXCITED_MG: Final = 50.0
"""Smallest change of the station's field on an axis that a set/reset check can use."""
HK_CEILING_G: Final = 100.0
"""A larger anisotropy field cannot be told from none and is reported as this."""
SAME_HEADING_DEG: Final = 2.0


def evaluate_noise(step: str, readings: NDArray[np.void]) -> list[Measurement]:
    """Return noise_{x,y,z}: RMS over the dwells of the standard deviation of one reading, in mG."""
    noise_mg = np.sqrt(np.mean(readings["field_sd_mg"] ** 2, axis=0))
    return _by_axis("noise", noise_mg, step, "mG")


def evaluate_peaks(step: str, readings: NDArray[np.void]) -> list[Measurement]:
    """Return peak_reading: the largest set or reset reading of any sample and axis, in mG."""
    peaks_mg = readings["peak_mg"]
    pose, axis = np.unravel_index(int(np.argmax(peaks_mg)), peaks_mg.shape)
    note = f"axis {AXES[axis]} at position {int(readings['position'][pose])}"
    peak_mg = float(peaks_mg[pose, axis])
    return [Measurement(name="peak_reading", value=peak_mg, step=step, unit="mG", note=note)]


def evaluate_set_reset(step: str, readings: NDArray[np.void], site: SiteField) -> list[Measurement]:
    """Return amplitude, symmetry, bridge offset and Hk of each axis that the poses excite.

    - set_reset_amplitude (%): peak-to-peak of (set - reset)/2 over the poses against that
      of the station's field on the axis; a strap that does not flip the film gives none.
    - set_reset_symmetry (%): difference of the peak-to-peak of set and of reset readings
      over their mean.
    - bridge_offset (mG): (set + reset)/2 regressed on 1 and Hx Hy, its part at no field
      (Caruso (5)-(7) with the cross-axis term of the AMR bridge, V = S Hy/(1 + Hx/Hk)).
    - hk (G): anisotropy field from the same regression.

    Axes on which the station's field changes by less than `EXCITED_MG` are left out, except
    for the offset, which is then the mean.
    """
    expected_ptp_mg = np.ptp(expected_field_mg(readings, site), axis=0)
    found: list[Measurement] = []
    for index, axis in enumerate(AXES):
        excited = float(expected_ptp_mg[index]) >= EXCITED_MG
        if excited:
            ratios = _pair_ratios(readings, index, float(expected_ptp_mg[index]))
            for name, value in zip(("amplitude", "symmetry"), ratios, strict=True):
                found.append(_percent(f"set_reset_{name}_{axis}", value, step))
        offset_mg, hk_g = bridge_offset(readings, index)
        found.append(
            Measurement(name=f"bridge_offset_{axis}", value=offset_mg, step=step, unit="mG")
        )
        if hk_g is not None:
            found.append(Measurement(name=f"hk_{axis}", value=hk_g, step=step, unit="G"))
    return found


def _percent(name: str, value: float, step: str) -> Measurement:
    return Measurement(name=name, value=value, step=step, unit="%")


def _pair_ratios(readings: NDArray[np.void], index: int, expected_mg: float) -> tuple[float, float]:
    set_ptp_mg = float(np.ptp(readings["set_mg"][:, index]))
    reset_ptp_mg = float(np.ptp(readings["reset_mg"][:, index]))
    field_ptp_mg = float(np.ptp(readings["field_mg"][:, index]))
    mean_mg = (set_ptp_mg + reset_ptp_mg) / 2.0
    symmetry = 100.0 * abs(set_ptp_mg - reset_ptp_mg) / mean_mg if mean_mg > 0.0 else 100.0
    return 100.0 * field_ptp_mg / expected_mg, symmetry


def bridge_offset(readings: NDArray[np.void], index: int) -> tuple[float, float | None]:
    """Return (bridge offset in mG, Hk in G or None) of one axis.

    (set + reset)/2 = offset - H_own H_neighbour / Hk to first order in H/Hk; Hk is None where
    the product of the two fields changes by less than 5000 mG^2 over the poses.
    """
    offset_mg = readings["offset_mg"][:, index]
    field_mg = readings["field_mg"]
    product = field_mg[:, index] * field_mg[:, NEIGHBOUR[index]]
    if len(readings) < 4 or float(np.ptp(product)) < 5000.0:
        return float(np.mean(offset_mg)), None
    design = np.column_stack([np.ones(len(product)), product])
    (constant_mg, slope_per_mg), *_ = np.linalg.lstsq(design, offset_mg, rcond=None)
    floor_per_mg = 1.0 / (HK_CEILING_G * 1000.0)
    return float(constant_mg), 1.0e-3 / max(abs(float(slope_per_mg)), floor_per_mg)


def evaluate_senses(
    step: str, readings: NDArray[np.void], site: SiteField, *, acceleration: bool = True
) -> list[Measurement]:
    """Return axis_sense and accel_sense of each axis: the cosine between it and the body axis.

    Each axis's readings are regressed on the body field (or force) that the rig's attitude
    and the station's record give, and a constant; the sense is its own coefficient over the
    norm of all three: 1 for a true axis, 0 for a swapped or dead one, -1 for an inverted
    one. Where the poses do not excite three dimensions nothing is returned.
    """
    found = _senses("axis_sense", readings["field_mg"], expected_field_mg(readings, site), step)
    if acceleration:
        found += _senses("accel_sense", readings["accel_g"], expected_force_g(readings), step)
    return found


def _senses(
    name: str, measured: NDArray[np.float64], expected: NDArray[np.float64], step: str
) -> list[Measurement]:
    design = np.column_stack([expected, np.ones(len(expected))])
    scale = np.linalg.norm(design, axis=0)
    if len(design) < 4 or np.any(scale == 0.0) or np.linalg.cond(design / scale) > 1.0e3:
        return []
    gains = np.linalg.lstsq(design, measured, rcond=None)[0][:3].T
    norms = np.maximum(np.linalg.norm(gains, axis=1), 0.05)
    return _by_axis(name, np.diag(gains) / norms, step, "")


def evaluate_sweep(
    step: str, readings: NDArray[np.void], poses: Sequence[Pose]
) -> list[Measurement]:
    """Return hysteresis and return_to_start of a level sweep, and its peak reading.

    - hysteresis (mG): largest difference, on any axis, between clockwise and
      counter-clockwise readings at one heading.
    - return_to_start (mG): largest difference, on any axis, between the last reading at the
      first heading and the first one.

    They are in mG, since hard iron up to most of the horizontal field would stretch the same
    difference into any number of degrees.
    """
    direction = {pose.position: pose.direction for pose in poses}
    directions = np.array([direction.get(int(p), 0) for p in readings["position"]])
    found = evaluate_peaks(step, readings)
    hysteresis_mg = _hysteresis_mg(readings[directions > 0], readings[directions < 0])
    if hysteresis_mg is not None:
        found.append(Measurement(name="hysteresis", value=hysteresis_mg, step=step, unit="mG"))
    again = np.flatnonzero(_turn_deg(readings, readings[0]) < SAME_HEADING_DEG)
    if len(again) > 1:
        change_mg = readings["field_mg"][again[-1]] - readings["field_mg"][0]
        value_mg = float(np.max(np.abs(change_mg)))
        found.append(Measurement(name="return_to_start", value=value_mg, step=step, unit="mG"))
    return found


def _hysteresis_mg(up: NDArray[np.void], down: NDArray[np.void]) -> float | None:
    worst_mg = [
        float(np.max(np.abs(down["field_mg"][nearest] - reading["field_mg"])))
        for reading in up
        if len(down)
        for turn_deg in (_turn_deg(down, reading),)
        for nearest in (int(np.argmin(turn_deg)),)
        if turn_deg[nearest] < SAME_HEADING_DEG
    ]
    return max(worst_mg) if worst_mg else None


def _turn_deg(readings: NDArray[np.void], reading: np.void) -> NDArray[np.float64]:
    turn_deg = wrap_180_deg(readings["rig_azimuth_deg"] - reading["rig_azimuth_deg"])
    tilt_deg = np.abs(readings["rig_pitch_deg"] - reading["rig_pitch_deg"]) + np.abs(
        readings["rig_roll_deg"] - reading["rig_roll_deg"]
    )
    return np.asarray(np.abs(turn_deg) + tilt_deg, dtype=float)


def _by_axis(name: str, values: NDArray[np.float64], step: str, unit: str) -> list[Measurement]:
    return [
        Measurement(name=f"{name}_{axis}", value=float(value), step=step, unit=unit)
        for axis, value in zip(AXES, values, strict=True)
    ]
