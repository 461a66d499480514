"""Numbers about the sensor itself: noise, set/reset pair, axis senses, peaks, hysteresis.

All functions are pure: one READING a pose in, measurements without limits out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.acceptance.measurement import Measurement
from bench.acceptance.site import expected_field_mg, expected_force_g
from bench.calibration.set_reset import SMALLEST, set_reset_batch
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.acceptance.site import SiteField
    from bench.pose import Pose

AXES: Final = ("x", "y", "z")
EXCITED_MG: Final = 50.0
"""Smallest change of the station's field on an axis that a set/reset check can use."""
HK_CEILING_G: Final = 100.0
"""A larger anisotropy field cannot be told from none and is reported as this."""
WHOLLY_ASYMMETRIC: Final = 200.0
"""Asymmetry of an axis that the strap does not flip at all, in percent."""
PAIR_UNITS: Final = {
    "set_reset_amplitude": "%",
    "set_reset_symmetry": "%",
    "bridge_offset": "mG",
    "hk": "G",
}
SAME_HEADING_DEG: Final = 2.0


def evaluate_noise(step: str, readings: NDArray[np.void]) -> list[Measurement]:
    """Return noise_{x,y,z}: RMS over the dwells of the standard deviation of one reading, in mG.

    Of single set and reset readings, as the data sheet counts it: half their difference has
    less than 0.7 of it.
    """
    noise_mg = np.sqrt(np.mean(readings["noise_mg"] ** 2, axis=0))
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
    - set_reset_symmetry (%): difference of the slopes of set and of reset readings over the
      field on the axis, over their mean.
    - bridge_offset (mG) and hk (G), see `pair_offsets`.

    They come kind by kind, so that a dead strap is seen in its own axis's amplitude before
    it is seen in a neighbour's Hk. Axes on which the station's field changes by less than
    `EXCITED_MG` are left out, except for the offset, which is then the mean.
    """
    expected_ptp_mg = np.ptp(expected_field_mg(readings, site), axis=0)
    swing_mg = np.ptp(readings["field_mg"], axis=0)
    by_kind: dict[str, list[tuple[str, float | None]]] = {
        "set_reset_amplitude": [],
        "set_reset_symmetry": [],
        "bridge_offset": [],
        "hk": [],
    }
    pairs = pair_offsets(readings)
    for index, axis in enumerate(AXES):
        pair = pairs[index]
        if expected_ptp_mg[index] >= EXCITED_MG:
            amplitude = 100.0 * float(swing_mg[index] / expected_ptp_mg[index])
            symmetry = pair.asymmetry_percent if amplitude > 5.0 else WHOLLY_ASYMMETRIC
            by_kind["set_reset_amplitude"].append((axis, amplitude))
            by_kind["set_reset_symmetry"].append((axis, symmetry))
        by_kind["bridge_offset"].append((axis, pair.offset_mg))
        by_kind["hk"].append((axis, pair.hk_g))
    return [
        Measurement(name=f"{kind}_{axis}", value=value, step=step, unit=PAIR_UNITS[kind])
        for kind, values in by_kind.items()
        for axis, value in values
        if value is not None
    ]


@dataclass(frozen=True, slots=True)
class PairOffset:
    """What (set + reset)/2 of one axis tells; None where the poses do not excite it."""

    offset_mg: float
    hk_g: float | None
    asymmetry_percent: float | None


def pair_offsets(readings: NDArray[np.void]) -> tuple[PairOffset, ...]:
    """Return bridge offset, Hk and set/reset asymmetry of x, y and z.

    Half the sum of the pairs holds the cross-axis term, several mG in the Earth's field, and
    the asymmetry: `calibration.set_reset` takes them apart (Caruso (5)-(7) leave them out).
    Hk and asymmetry are None where the poses do not excite them; a larger Hk than 100 G is
    reported as that.
    """
    if len(readings) < SMALLEST:
        means_mg = readings["offset_mg"].mean(axis=0)
        return tuple(PairOffset(float(mean_mg), None, None) for mean_mg in means_mg)
    fits = set_reset_batch(readings["field_mg"], readings["offset_mg"])
    slope_per_g = np.maximum(np.abs(fits.cross_per_mg) * 1000.0, 1.0 / HK_CEILING_G)
    asymmetry_percent = np.minimum(200.0 * np.abs(fits.asymmetry), WHOLLY_ASYMMETRIC)
    return tuple(
        PairOffset(
            float(fits.bridge_offset_mg[axis]),
            1.0 / float(slope_per_g[axis]) if fits.cross_fitted[axis] else None,
            float(asymmetry_percent[axis]) if fits.gain_fitted[axis] else None,
        )
        for axis in range(len(AXES))
    )


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
        found += _senses(
            "accel_sense", readings["accel_g"], expected_force_g(readings, site.seat), step
        )
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
