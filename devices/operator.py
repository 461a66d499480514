"""The virtual operator: remounts the unit in the seat when the bench asks for it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from protocols.remounting import (
    REMOUNT_DONE_ID,
    REMOUNT_ID,
    MountCode,
    RemountResult,
    pack_remount_done,
    unpack_remount,
)

if TYPE_CHECKING:
    import numpy as np

    from devices.host import Emit
    from devices.world import World

REMOUNT_NS: Final = 10_000_000_000
"""Time that it takes to take the unit out and to put it in again."""
LEVEL_DEG: Final = 3.0
"""Tilt of the rig up to which the operator lays hands on the unit."""


class VirtualOperator:
    """A node of the simulator alone: no device of a real bus answers in its place.

    Parameters
    ----------
    world : World
        Holds the seat.
    rng : numpy.random.Generator
        How square each unit is put in.
    seating_sd_deg : float
        Standard deviation of each of the three turns of a unit that was put in again.
    """

    def __init__(self, world: World, rng: np.random.Generator, *, seating_sd_deg: float) -> None:
        self._world = world
        self._rng = rng
        self._seating_sd_deg = seating_sd_deg
        self._asked: MountCode | None = None
        self._due_ns = 0

    @property
    def accepts(self) -> frozenset[int]:
        """Identifiers that the operator listens to."""
        return frozenset({REMOUNT_ID})

    def receive(self, t_ns: int, can_id: int, data: bytes) -> None:
        """Take a wish; one that cannot be read is not obeyed and not answered."""
        del can_id
        try:
            self._asked = unpack_remount(data)
        except ValueError:
            return
        self._due_ns = t_ns + REMOUNT_NS

    def tick(self, t_ns: int, group: int, emit: Emit) -> None:
        """Refuse at once on a tilted rig; else put the unit in when the time is over."""
        del group
        asked = self._asked
        if asked is None:
            return
        if not self._level():
            result = RemountResult.RIG_NOT_LEVEL
        elif t_ns < self._due_ns:
            return
        else:
            self._put_in(asked)
            result = RemountResult.DONE
        self._asked = None
        emit(REMOUNT_DONE_ID, pack_remount_done(asked, result))

    def sync(self, emit: Emit) -> None:
        """Send nothing on SYNC."""
        del emit

    def _level(self) -> bool:
        rig = self._world.rig
        tilts_deg = (rig.pitch.angle_deg, rig.roll.angle_deg)
        still = not any(axis.moving for axis in rig.axes)
        return still and all(abs(tilt_deg) < LEVEL_DEG for tilt_deg in tilts_deg)

    def _put_in(self, mounting: MountCode) -> None:
        x, y, z = (float(turn) for turn in self._rng.normal(0.0, self._seating_sd_deg, 3))
        self._world.seat = replace(self._world.seat, mounting=int(mounting), seating_deg=(x, y, z))
