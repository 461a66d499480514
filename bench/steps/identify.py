"""Read who the module is, over diagnostics, and hold it against the scanned serial."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from bench.steps.step import OnMiss, Step

if TYPE_CHECKING:
    from bench.run_context import RunContext

SERIAL_NAME = "serial_match"
FIRMWARE_NAME = "firmware_version"


class Identify(Step):
    """Serial, part, hardware and firmware; a wrong serial is an ERROR, wrong firmware a FAIL."""

    fixed_duration_s: ClassVar[float] = 0.5
    kind: Literal["identify"]
    on_miss: OnMiss = "stop"
    part: str | None = None
    """Part number that the unit must have."""
    firmware: tuple[str, ...] = ()
    """Firmware versions that are released; none given: every version."""

    def run(self, context: RunContext) -> None:
        """Read the identity; judge the serial, then part and firmware.

        Raises
        ------
        ModuleSilent
            If the module does not answer.
        """
        identity = context.module.identity()
        context.set_identity(identity)
        context.measure(
            SERIAL_NAME,
            float(identity.serial == context.serial),
            note=f"scanned {context.serial}, module says {identity.serial}",
        )
        released = not self.firmware or identity.firmware in self.firmware
        right_part = self.part is None or identity.part == self.part
        allowed = ", ".join(self.firmware) or "any"
        note = f"{identity.part} firmware {identity.firmware}; released {allowed}"
        context.measure(FIRMWARE_NAME, float(released and right_part), note=note)

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        return (SERIAL_NAME, FIRMWARE_NAME)
