"""The bench of an experiment: rig and module, driven and heard over CAN.

The command line builds it, as only there bench and devices meet; the studies of the papers
know no more of it than this.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from contextlib import AbstractContextManager
    from typing import TypeAlias

    import numpy as np
    from numpy.typing import NDArray

    from bench.module import Module
    from bench.pose import Attitude
    from bench.reproduction.setup import Setup
    from bench.rig import Rig


class Laboratory(Protocol):
    """One virtual station, connected and homed."""

    @property
    def rig(self) -> Rig:
        """Client of the rig."""
        ...

    @property
    def module(self) -> Module:
        """Client of the module, with its diagnostics."""
        ...

    @property
    def now_s(self) -> float:
        """Time of the station in seconds."""
        ...

    def measure(
        self, poses: Sequence[Attitude], *, dwell_s: float = 0.05, direction: int | None = None
    ) -> NDArray[np.void]:
        """Go to poses one after the other and return one READING each, shape (n,).

        Raises
        ------
        BenchError
            If a pose is not reached or the module sends too little.
        """
        ...

    def listen(self, duration_s: float) -> NDArray[np.void]:
        """Stay where the rig is and return the complete SAMPLEs of a time, shape (n,)."""
        ...


OpenLaboratory: TypeAlias = "Callable[[Setup], AbstractContextManager[Laboratory]]"
"""Builds a station of a setup on a wire of its own and closes it at the end."""
