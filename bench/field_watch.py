"""Whether the field at the station is still the one in which the run began.

The reference magnetometer stands still, so that any change of its reading is one of the field.
Its mean over the first quiet dwell of the run is the baseline; a dwell during which it leaves
the baseline is spoiled and not used. Where a station has no reference magnetometer, sentinel
poses take its place: the rig comes back to one pose, and the module's own raw field there is
compared with its first visit (`bench.steps.sentinel`).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from bench.errors import FieldChanged

if TYPE_CHECKING:
    from numpy.typing import NDArray

Source = Literal["reference", "sentinel"]

BLOCK_SAMPLES: Final = 10
"""A dwell is looked at in means of so many samples: 0.1 s, in which a vehicle hardly moves."""
SPOILED_PART: Final = 0.25
"""At most this part of a procedure's poses may be repeated."""
FEWEST_REPEATS: Final = 4
"""So many repeats are allowed to the shortest procedure."""


@dataclass(slots=True, kw_only=True)
class SpoiledPose:
    """A dwell that is not used, and the position of the dwell that took its place."""

    position: int
    step: str
    change_mg: float
    source: Source
    repeated_as: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SentinelVisit:
    """A visit to a sentinel pose and the change of the module's raw field there."""

    position: int
    step: str
    change_mg: float


class FieldWatch:
    """Keeps the baseline, and what was spoiled.

    Parameters
    ----------
    change_mg : float or None
        Change of the reference's reading on any axis that spoils a dwell; None where there is
        no reference magnetometer.
    poses : int
        Dwells that the procedure intends.

    Attributes
    ----------
    baseline_mg : ndarray, shape (3,), or None
        Reading of the reference magnetometer in the first quiet dwell, along its own axes.
    largest_change_mg, drift_mg : float or None
        Largest change of any dwell, spoiled ones too, and the change in the last good one.
    spoiled : list of SpoiledPose
    sentinels : list of SentinelVisit
    anchors : dict
        By sentinel pose, the module's raw field at its first visit in the run, shape (3,), mG.
    """

    def __init__(self, change_mg: float | None = None, poses: int = 0) -> None:
        self.change_mg = change_mg
        self.baseline_mg: NDArray[np.float64] | None = None
        self.largest_change_mg: float | None = None
        self.drift_mg: float | None = None
        self.spoiled: list[SpoiledPose] = []
        self.sentinels: list[SentinelVisit] = []
        self.anchors: dict[tuple[float, float, float], NDArray[np.float64]] = {}
        self._poses = poses

    @property
    def extra_poses(self) -> int:
        """Dwells beside those that the procedure intends."""
        return len(self.spoiled) + len(self.sentinels)

    def dwell_change_mg(self, reference_mg: NDArray[np.float64]) -> float | None:
        """Return the change in a dwell if it is spoiled by it, else None.

        Parameters
        ----------
        reference_mg : ndarray, shape (n, 3)
            Readings of the reference magnetometer; rows of not-a-number are left out.

        The change is the largest, on any axis, of the means of 0.1 s against the baseline: it
        holds the mean of the dwell and what changes within it. The first dwell whose means lie
        within `change_mg` of each other becomes the baseline.
        """
        if self.change_mg is None:
            return None
        blocks_mg = block_means(reference_mg)
        if not len(blocks_mg):
            return None
        if self.baseline_mg is None:
            change_mg = float(np.max(np.ptp(blocks_mg, axis=0)))
            if change_mg <= self.change_mg:
                self.baseline_mg = blocks_mg.mean(axis=0)
        else:
            change_mg = float(np.max(np.abs(blocks_mg - self.baseline_mg)))
        self._note(change_mg)
        if change_mg > self.change_mg:
            return change_mg
        self.drift_mg = float(np.max(np.abs(blocks_mg.mean(axis=0) - self.baseline_mg)))
        return None

    def is_quiet(self, reference_mg: NDArray[np.float64]) -> bool:
        """Whether readings, shape (n, 3), lie at the baseline, or within each other before it."""
        blocks_mg = block_means(reference_mg)
        if self.change_mg is None or not len(blocks_mg):
            return False
        if self.baseline_mg is None:
            return bool(np.max(np.ptp(blocks_mg, axis=0)) <= self.change_mg)
        return bool(np.max(np.abs(blocks_mg - self.baseline_mg)) <= self.change_mg)

    def visit_sentinel(
        self,
        pose: tuple[float, float, float],
        field_mg: NDArray[np.float64],
        *,
        position: int,
        step: str,
    ) -> float:
        """Note a visit to a sentinel pose; return the change since the first one, any axis, mG."""
        anchor_mg = self.anchors.setdefault(pose, np.array(field_mg, dtype=float))
        change_mg = float(np.max(np.abs(field_mg - anchor_mg)))
        self.sentinels.append(SentinelVisit(position=position, step=step, change_mg=change_mg))
        if self.change_mg is None:
            self._note(change_mg)
            self.drift_mg = change_mg
        return change_mg

    def spoil(self, position: int, step: str, change_mg: float, source: Source) -> SpoiledPose:
        """Note a spoiled dwell.

        Raises
        ------
        FieldChanged
            If too many poses of the procedure were spoiled.
        """
        entry = SpoiledPose(position=position, step=step, change_mg=change_mg, source=source)
        self.spoiled.append(entry)
        allowed = max(FEWEST_REPEATS, int(SPOILED_PART * self._poses))
        if len(self.spoiled) > allowed:
            message = (
                f"field at the station must let at most {allowed} of {self._poses} poses be "
                f"repeated; instead {len(self.spoiled)} were spoiled, the last by a change of "
                f"{change_mg:.2g} mG: keep vehicles and magnets away from the rig, then run again"
            )
            raise FieldChanged(message)
        return entry

    def entry(self) -> dict[str, Any]:
        """Return the section `field_watch` of the record."""
        source = "sentinel" if self.sentinels else "none"
        return {
            "source": "reference" if self.change_mg is not None else source,
            "baseline_mg": None if self.baseline_mg is None else self.baseline_mg.tolist(),
            "largest_change_mg": self.largest_change_mg,
            "drift_mg": self.drift_mg,
            "spoiled": [asdict(each) for each in self.spoiled],
            "sentinels": [asdict(each) for each in self.sentinels],
        }

    def _note(self, change_mg: float) -> None:
        self.largest_change_mg = max(self.largest_change_mg or 0.0, change_mg)


def block_means(readings: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return means over `BLOCK_SAMPLES` readings, shape (blocks, 3), of readings (n, 3).

    Readings that are not-a-number are left out; what is left over belongs to the last block.
    """
    known = readings[np.isfinite(readings).all(axis=1)]
    if not len(known):
        return np.zeros((0, 3))
    blocks = np.array_split(known, max(1, len(known) // BLOCK_SAMPLES))
    return np.array([block.mean(axis=0) for block in blocks])
