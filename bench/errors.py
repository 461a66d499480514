"""Errors of the bench.

BenchError
├── ConfigError(ValueError)          a file, option or name that cannot be used      exit 2
├── ModuleSilent(TimeoutError)       the module does not answer or stopped sending   exit 4
├── ModuleRefused                    the module answered with a negative response    exit 4
├── RigFault                         a drive is in fault, silent or does not settle  exit 4
├── BusFault                         frames dropped, bus off, simulator gone         exit 4
├── ReferenceSilent(TimeoutError)    the reference magnetometer stopped sending      exit 4
├── FieldChanged                     the field at the station is not what it was     exit 4
├── BenchNotReady                    station record, site or files of a run unusable exit 4
└── Aborted                          the operator or a signal ended the run          exit 130, 143
"""

from __future__ import annotations


class BenchError(Exception):
    """Base of the bench's errors: one sentence that says what, where and what to do."""

    @property
    def exit_code(self) -> int:
        """Exit code of the command line where the error ends a command."""
        return 4


class ConfigError(BenchError, ValueError):
    """A file, option or name that cannot be used."""

    @property
    def exit_code(self) -> int:
        """Usage or configuration."""
        return 2


class ModuleSilent(BenchError, TimeoutError):
    """The module does not answer or has stopped sending."""


class ModuleRefused(BenchError):
    """The module answered a service with a negative response."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class RigFault(BenchError):
    """A drive is in fault, silent, or does not reach or hold its position."""

    def __init__(self, message: str, axis: str) -> None:
        super().__init__(message)
        self.axis = axis


class BusFault(BenchError):
    """Frames were dropped, the bus is off, or the simulator is gone."""


class ReferenceSilent(BenchError, TimeoutError):
    """The station's reference magnetometer does not send."""


class FieldChanged(BenchError):
    """The field at the station has changed during the run and does not come back."""


class BenchNotReady(BenchError):
    """The bench cannot judge: station record, site or record folder unusable."""


class Aborted(BenchError):
    """The operator or a signal ended the run."""

    def __init__(self, signal_number: int) -> None:
        super().__init__(f"run aborted by signal {signal_number}")
        self.signal_number = signal_number

    @property
    def exit_code(self) -> int:
        """128 + signal, as shells count."""
        return 128 + self.signal_number
