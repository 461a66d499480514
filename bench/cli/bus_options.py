"""From the bus options of a command to an open link."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.errors import ConfigError
from protocols.pycan_link import PyCanLink

if TYPE_CHECKING:
    from protocols.clock import Clock

IN_PROCESS = "lockstep"


def is_in_process(interface: str | None, channel: str | None) -> bool:
    """Whether the devices are to be made in this process: no bus was named."""
    return channel is None and interface in (None, IN_PROCESS)


def open_link(
    interface: str | None, channel: str | None, bitrate: int, clock: Clock | None = None
) -> PyCanLink:
    """Open a channel that other processes or real devices are on.

    Raises
    ------
    ConfigError
        If the interface is missing or cannot reach another process.
    LinkError
        If the channel cannot be opened.
    """
    if interface in (None, IN_PROCESS, "virtual"):
        message = (
            f"--interface must name a bus that reaches other processes, such as socketcan or "
            f"udp_multicast, with --channel {channel}; instead received {interface or 'none'}"
        )
        raise ConfigError(message)
    return PyCanLink(interface, channel, bitrate=bitrate, clock=clock)
