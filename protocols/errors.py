"""Errors of the wire.

ProtocolError
├── FrameError(ValueError)         a frame or payload that cannot be what it claims
├── LinkError(OSError)             the channel cannot be opened, read or written
└── SdoAbort                       a CANopen node refused an object
"""

from __future__ import annotations


class ProtocolError(Exception):
    """Base of all errors of the wire."""


class FrameError(ProtocolError, ValueError):
    """A frame or payload that cannot be what it claims to be."""


class LinkError(ProtocolError, OSError):
    """A channel that cannot be opened, read or written; says which and what to do."""


class SdoAbort(ProtocolError):  # noqa: N818 (the standard's word)
    """A CANopen node refused an object (CiA 301, 7.2.4.3.17)."""

    def __init__(self, node_id: int, index: int, subindex: int, code: int, meaning: str) -> None:
        super().__init__(
            f"drive {node_id} refused object {index:04X}h.{subindex:02X}h: {meaning} ({code:08X}h)"
        )
        self.node_id = node_id
        self.index = index
        self.subindex = subindex
        self.code = code
