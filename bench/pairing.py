"""On real adapters: how much older a module's sample is than the rig's angle beside it.

Module and drives run on clocks of their own; a row of the sample log holds the cycle and the
angle that was received last before it. At a settled pose their distance in time does not
matter. In motion it shows: a level turn reads x = a + c cos(psi) + s sin(psi) whatever the
iron, and at the angular rate r a sample that is tau older than its angle reads

    x = a + c cos(psi) + s sin(psi) + r tau (c sin(psi) - s cos(psi)).

Clockwise and counter-clockwise turns together make tau observable beside a phase of the
installation; it is a least-squares estimate over all level moves, kept as normal equations.
Hysteresis looks like a latency of its half width over field and rate: 0.3 mG at 250 mG and
90 deg/s are 0.8 ms.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from bench.samples import COMPLETE, MOVING

if TYPE_CHECKING:
    from numpy.typing import NDArray

PAIRED_WITHIN_NS: Final = 100_000_000
"""Farther apart in time, a cycle and the rig's angle are no pair and not judged."""
LEVEL_DEG: Final = 1.0
"""Pitch and roll within which a turn counts as level."""
SLOWEST_DPS: Final = 10.0
"""Slower moves say nothing about time."""
LONGEST_STEP_S: Final = 0.05
"""Rows farther apart give no rate."""
FEWEST_ROWS: Final = 100
"""In each direction; with less there is no estimate."""

_TERMS: Final = 5


class LatencyEstimate:
    """Takes blocks of samples and tells the latency between module and rig.

    Attributes
    ----------
    clockwise, counter_clockwise : int
        Moving rows that were used.
    """

    def __init__(self) -> None:
        self.clockwise = 0
        self.counter_clockwise = 0
        self._normal = np.zeros((_TERMS, _TERMS))
        self._right = np.zeros((_TERMS, 2))
        self._squares = np.zeros(2)

    def __call__(self, samples: NDArray[np.void]) -> None:
        """Use a block, ndarray of SAMPLE, shape (n,)."""
        if len(samples) < 3:
            return
        azimuth_deg = samples["rig_azimuth_deg"]
        step_s = samples["t_s"][2:] - samples["t_s"][:-2]
        with np.errstate(divide="ignore", invalid="ignore"):
            rate_dps = (azimuth_deg[2:] - azimuth_deg[:-2]) / step_s
        rows = samples[1:-1]
        level = np.maximum(abs(rows["rig_pitch_deg"]), abs(rows["rig_roll_deg"])) < LEVEL_DEG
        usable = (rows["position"] == MOVING) & (rows["complete"] == COMPLETE) & level
        usable &= (step_s > 0.0) & (step_s < LONGEST_STEP_S) & (abs(rate_dps) > SLOWEST_DPS)
        if usable.any():
            self._add(rows[usable], np.radians(rate_dps[usable]))

    def _add(self, rows: NDArray[np.void], rate_rad_s: NDArray[Any]) -> None:
        psi_rad = np.radians(rows["rig_azimuth_deg"])
        cosine, sine = np.cos(psi_rad), np.sin(psi_rad)
        design = np.column_stack(
            [np.ones(len(rows)), cosine, sine, rate_rad_s * sine, rate_rad_s * cosine]
        )
        field_mg = (rows["set_mg"][:, :2] - rows["reset_mg"][:, :2]).astype(np.float64) / 2.0
        self._normal += design.T @ design
        self._right += design.T @ field_mg
        self._squares += (field_mg**2).sum(axis=0)
        self.clockwise += int((rate_rad_s > 0.0).sum())
        self.counter_clockwise += int((rate_rad_s < 0.0).sum())

    @property
    def latency_s(self) -> tuple[float, float] | None:
        """Age of a sample against its angle and its standard deviation, or None if unknown."""
        if min(self.clockwise, self.counter_clockwise) < FEWEST_ROWS:
            return None
        solution, *_ = np.linalg.lstsq(self._normal, self._right, rcond=None)
        inverse = np.linalg.pinv(self._normal)
        count = self.clockwise + self.counter_clockwise
        weighted = weight = 0.0
        for axis in (0, 1):
            _, c, s, late_c, late_s = solution[:, axis]
            misfit = max(self._squares[axis] - solution[:, axis] @ self._right[:, axis], 0.0)
            direction = np.array([0.0, 0.0, 0.0, c, -s]) / (c * c + s * s)
            variance = misfit / count * float(direction @ inverse @ direction) + 1e-18
            weighted += (c * late_c - s * late_s) / (c * c + s * s) / variance
            weight += 1.0 / variance
        return float(weighted / weight), float(weight**-0.5)

    def entry(self) -> dict[str, float | int | None]:
        """Return the record's entry; the latency is null where too little has moved."""
        estimate = self.latency_s
        return {
            "latency_s": None if estimate is None else estimate[0],
            "latency_sd_s": None if estimate is None else estimate[1],
            "clockwise_rows": self.clockwise,
            "counter_clockwise_rows": self.counter_clockwise,
        }
