"""Going through the poses of a step, and repeating those that a change of the field spoiled.

With a reference magnetometer each dwell is judged by itself: a spoiled one is repeated on the
spot as soon as the field is back. With sentinel poses, all poses since the last good visit to
the sentinel are repeated. A spoiled dwell keeps its position in samples and record and is not
used; its repetition has a position of its own.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.errors import BusFault, FieldChanged, ModuleSilent
from bench.field_watch import BLOCK_SAMPLES, block_means
from bench.pairing import PAIRED_WITHIN_NS
from bench.pose import Pose
from bench.samples import reading_of
from protocols.sync import TICK_S

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.field_watch import Source, SpoiledPose
    from bench.run_context import RunContext
    from bench.steps.sentinel import Sentinel
    from bench.steps.step import PlannedPose

QUIET_S: Final = 2.0
"""The reference must stay at its baseline for so long before a pose is repeated."""
LONGEST_WAIT_S: Final = 120.0
"""A field that is not back after so long has changed for good."""
SENTINEL_PAUSE_S: Final = 10.0
"""Time between two visits to a sentinel pose at which the field has changed."""


class PoseVisits:
    """One way through poses.

    Parameters
    ----------
    context : RunContext
    sentinel : Sentinel, optional
        Where to come back to; without a reference magnetometer, or where it says always.
    """

    def __init__(self, context: RunContext, sentinel: Sentinel | None = None) -> None:
        self._context = context
        self._watch = context.field_watch
        needed = sentinel is not None and (sentinel.always or context.reference is None)
        self._sentinel = sentinel if needed else None
        self._replaced: dict[int, SpoiledPose] = {}

    def go(self, planned: Sequence[PlannedPose]) -> list[NDArray[np.void]]:
        """Visit poses and return their complete samples, one ndarray of SAMPLE for each, in order.

        Raises
        ------
        RigFault, ModuleSilent
            If a pose is not reached or the module stops sending.
        FieldChanged
            If the field does not come back, or spoils too many poses.
        """
        kept: dict[int, NDArray[np.void]] = {}
        due = list(range(len(planned)))
        since: list[int] = []
        if due and not self._at_sentinel():
            self._until_sentinel_good([], kept)
        while due:
            index = due.pop(0)
            kept[index] = self._dwell(planned[index], index)
            since.append(index)
            if self._sentinel is not None and (len(since) == self._sentinel.every or not due):
                due = self._until_sentinel_good(since, kept) + due
                since = []
        return [kept[index] for index in range(len(planned))]

    def _at_sentinel(self) -> bool:
        """Whether there is no sentinel, or the last dwell of the run was a visit to this one."""
        if self._sentinel is None:
            return True
        poses, visits = self._context.poses, self._watch.sentinels
        last = bool(poses and visits) and visits[-1].position == poses[-1].position
        return last and poses[-1].attitude == self._sentinel.planned().attitude

    def _samples_at(self, planned: PlannedPose) -> NDArray[np.void]:
        """Go to one pose, wait until it is settled, and return its complete samples."""
        context = self._context
        rig = context.require_rig()
        pose = Pose(
            position=len(context.poses),
            step=context.step_name,
            attitude=planned.attitude,
            direction=planned.direction,
        )
        rig.move_to(planned.attitude, direction=planned.direction or None)
        samples = context.collect(pose, planned.dwell_s)
        context.progress.position_reached(context.state)
        if len(samples) >= 2:
            return samples
        if context.sample_log.unpaired:
            message = (
                f"module samples at position {pose.position} cannot be paired with the rig's "
                f"angle: more than {PAIRED_WITHIN_NS * 1e-6:g} ms lie between them; check the "
                "drives' SYNC and the load of this computer"
            )
            raise BusFault(message)
        message = (
            f"module sent {len(samples)} complete cycles at position {pose.position} in "
            f"{planned.dwell_s:g} s; check its supply, its bus and its sample period"
        )
        raise ModuleSilent(message)

    def _dwell(self, pose: PlannedPose, index: int | None = None) -> NDArray[np.void]:
        """Dwell at a pose until the reference was quiet meanwhile."""
        context, watch = self._context, self._watch
        if context.reference is not None and not context.reference.watched:
            context.reference.wait_ready()
        while True:
            samples = self._samples_at(pose)
            position = int(samples["position"][0])
            spoiled = self._replaced.pop(index, None) if index is not None else None
            if spoiled is not None:
                spoiled.repeated_as = position
            change_mg = watch.dwell_change_mg(samples["reference_mg"])
            if change_mg is None:
                return samples
            self._spoil(position, change_mg, "reference", index)
            self._wait_for_quiet(change_mg)

    def _spoil(self, position: int, change_mg: float, source: Source, index: int | None) -> None:
        context = self._context
        context.event(
            "pose_spoiled",
            position=position,
            step=context.step_name,
            change_mg=change_mg,
            source=source,
        )
        entry = self._watch.spoil(position, context.step_name, change_mg, source)
        if index is not None:
            self._replaced[index] = entry

    def _wait_for_quiet(self, change_mg: float) -> None:
        """Tick until the reference has been quiet for `QUIET_S`; the rig stays where it is."""
        context, watch = self._context, self._watch
        reference = context.reference
        if reference is None:
            return
        bus, start_s = context.bus, context.bus.now_s
        newest: deque[NDArray[np.float64]] = deque(maxlen=round(QUIET_S / TICK_S))
        largest_mg = change_mg
        while len(newest) < (newest.maxlen or 0) or not watch.is_quiet(np.array(newest)):
            if bus.now_s - start_s >= LONGEST_WAIT_S:
                if watch.baseline_mg is not None:
                    means_mg = block_means(np.array(newest))
                    largest_mg = float(np.max(np.abs(means_mg[-1] - watch.baseline_mg)))
                raise FieldChanged(_changed(largest_mg))
            for _ in range(BLOCK_SAMPLES):
                bus.tick()
                newest.append(reference.field_mg)
        context.event("field_quiet", waited_s=bus.now_s - start_s)

    def _until_sentinel_good(
        self, since: list[int], kept: dict[int, NDArray[np.void]]
    ) -> list[int]:
        """Visit the sentinel until its field is back; return the poses that must be repeated."""
        context = self._context
        change_mg = self._visit_sentinel()
        limit_mg = 0.0 if self._sentinel is None else self._sentinel.change
        if change_mg <= limit_mg:
            return []
        for index in since:
            position = int(kept[index]["position"][0])
            self._spoil(position, change_mg, "sentinel", index)
        start_s = context.bus.now_s
        while change_mg > limit_mg:
            if context.bus.now_s - start_s >= LONGEST_WAIT_S:
                raise FieldChanged(_changed(change_mg))
            context.bus.run_for(SENTINEL_PAUSE_S)
            change_mg = self._visit_sentinel()
        context.event("field_quiet", waited_s=context.bus.now_s - start_s)
        return since

    def _visit_sentinel(self) -> float:
        """Go to the sentinel pose; return the change of the module's raw field there, mG."""
        context, sentinel = self._context, self._sentinel
        if sentinel is None:
            return 0.0
        pose = sentinel.planned()
        samples = self._dwell(pose)
        at = pose.attitude
        return self._watch.visit_sentinel(
            (at.azimuth_deg, at.pitch_deg, at.roll_deg),
            reading_of(samples)["field_mg"],
            position=int(samples["position"][0]),
            step=context.step_name,
        )


def _changed(change_mg: float) -> str:
    return (
        "field at the station must come back after a disturbance; instead it stays "
        f"{change_mg:.2g} mG off its value at the run's start for {LONGEST_WAIT_S:g} s: "
        "take away what was put near the rig, or verify the station"
    )
