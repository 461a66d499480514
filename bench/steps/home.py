"""Connect the drives, home every axis and go to the rig's zero."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from bench.errors import BenchError
from bench.steps.step import Step

if TYPE_CHECKING:
    from bench.rig import Rig
    from bench.run_context import RunContext


class Home(Step):
    """Enable the drives and home them; parking is promised before anything moves."""

    fixed_duration_s: ClassVar[float] = 3.0
    kind: Literal["home"]

    def run(self, context: RunContext) -> None:
        """Connect and home.

        Raises
        ------
        RigFault
            If a drive is silent, in fault, or does not finish homing.
        """
        rig = context.require_rig()
        context.on_exit("park the rig", lambda: park(rig))
        rig.connect()
        context.recorder.set("rig", {"identity": rig.identity})
        rig.home()
        context.event("homed")


def park(rig: Rig) -> None:
    """Bring the rig to 0, 0, 0 and switch it off; stop it where it stands if it does not go.

    Raises
    ------
    RigFault
        If it did not reach its park position.
    """
    try:
        rig.park()
    except BenchError:
        rig.quick_stop()
        raise
