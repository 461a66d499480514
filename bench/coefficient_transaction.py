"""Writing coefficients so that the module holds the old ones or the new, never a mixture.

Snapshot, write beside the bank in use, read back, commit, reset, compare. What goes wrong
before the reset is undone by dropping the staged bank; after it, by writing the snapshot.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bench.errors import BenchError, ConfigError
from protocols import uds
from protocols.errors import FrameError

if TYPE_CHECKING:
    from bench.bus import BenchBus
    from bench.diagnostics import Diagnostics
    from protocols.uds import Coefficients

logger = logging.getLogger(f"compassbench.{__name__}")


@dataclass(frozen=True, slots=True, kw_only=True)
class CoefficientWrite:
    """What a write of coefficients came to.

    Attributes
    ----------
    before : Coefficients
        In use before the write.
    written : Coefficients
        As sent, rounded to single precision.
    read_back : Coefficients
        In use after the reset.
    """

    before: Coefficients
    written: Coefficients
    read_back: Coefficients

    @property
    def read_back_equal(self) -> bool:
        """Whether the module uses exactly what was written."""
        return uds.pack_coefficients(self.read_back) == uds.pack_coefficients(self.written)


class CoefficientTransaction:
    """One write, from the snapshot to the comparison after the reset.

    Parameters
    ----------
    bus : BenchBus
    diagnostics : Diagnostics
    coefficients : Coefficients
        What is to be written.

    Raises
    ------
    ConfigError
        If no module can hold them; nothing is sent then.
    """

    def __init__(self, bus: BenchBus, diagnostics: Diagnostics, coefficients: Coefficients) -> None:
        self._bus = bus
        self._diagnostics = diagnostics
        self._bank = uds.pack_coefficients(coefficients)
        try:
            self._written = uds.unpack_coefficients(self._bank)
        except FrameError as error:
            message = f"coefficients must be sound to be written; instead: {error}"
            raise ConfigError(message) from error
        self._before: Coefficients | None = None
        self._reset_begun = False

    def run(self) -> CoefficientWrite:
        """Do it all; an exception leaves the module with its former coefficients.

        A module that does not hold what was written after the reset gets its former
        coefficients back, and the result says so by `read_back_equal`.

        Raises
        ------
        BenchError
            What went wrong (`ModuleSilent`, `ModuleRefused`, `BusFault`, `Aborted`).
        """
        diagnostics = self._diagnostics
        self._before = before = diagnostics.read_coefficients()
        try:
            read_back = before
            if self._stage(self._bank):
                self._activate()
                read_back = diagnostics.read_coefficients()
        except BenchError:
            self._undo()
            raise
        outcome = CoefficientWrite(before=before, written=self._written, read_back=read_back)
        if not outcome.read_back_equal:
            logger.warning("the module does not hold what was written; restoring the former")
            self._undo()
        return outcome

    def _stage(self, bank: bytes) -> bool:
        """Write the bank beside the one in use; whether it reads back as written."""
        diagnostics = self._diagnostics
        diagnostics.unlock()
        diagnostics.write_did(uds.DID_COEFFICIENTS_STAGED, bank)
        return diagnostics.read_did(uds.DID_COEFFICIENTS_STAGED) == bank

    def _activate(self) -> None:
        self._diagnostics.routine(uds.ROUTINE_COMMIT)
        self._reset_begun = True
        self._diagnostics.reset()

    def _undo(self) -> None:
        """Bring the former coefficients back, as far as the module still answers."""
        with self._bus.cancel.shielded():
            try:
                if self._reset_begun:
                    self._restore()
                else:
                    self._diagnostics.unlock()
                    self._diagnostics.routine(uds.ROUTINE_ROLLBACK)
            except BenchError as error:
                logger.warning("the former coefficients could not be restored: %s", error)

    def _restore(self) -> None:
        before = self._before
        self._diagnostics.recover()
        if before is None or self._diagnostics.read_coefficients() == before:
            return
        if self._stage(uds.pack_coefficients(before)):
            self._activate()
