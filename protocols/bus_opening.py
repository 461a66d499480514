"""Opening a python-can bus, and one sentence for each way in which that fails."""

from __future__ import annotations

import difflib
import errno
import logging
import socket
from typing import TYPE_CHECKING, Any

import can
from can.interfaces import BACKENDS

from protocols.bus_port import BusPort, hears_itself
from protocols.errors import LinkError
from protocols.lockstep import LockstepBus
from protocols.multicast_port import DEFAULT_GROUP, DEFAULT_PORT, MulticastPort, is_multicast_group
from protocols.socketcan_port import SocketCanPort

if TYPE_CHECKING:
    from collections.abc import Mapping

    from protocols.link_faults import FaultCounter
    from protocols.pycan_link import Port


def open_port(
    interface: str,
    channel: str | int | None,
    bitrate: int,
    bus_kwargs: Mapping[str, Any],
    faults: FaultCounter,
) -> Port:
    """Return the raw side of a link on a channel.

    `udp_multicast` on an IPv4 group stays on this machine unless a `hop_limit` is given.

    Raises
    ------
    LinkError
        As `open_bus`.
    """
    local = interface == "udp_multicast" and "hop_limit" not in bus_kwargs
    if local and is_multicast_group(channel):
        group = DEFAULT_GROUP if channel is None else str(channel)
        try:
            return MulticastPort(group, faults, bus_kwargs.get("port", DEFAULT_PORT))
        except OSError as error:
            raise LinkError(_cannot_open(interface, group, error)) from error
    return port_on(open_bus(interface, channel, bitrate, bus_kwargs), interface, faults)


def port_on(bus: can.BusABC, interface: str, faults: FaultCounter) -> Port:
    """Return the raw side of a link on a bus that is open already."""
    if interface == "socketcan":
        return SocketCanPort(bus, faults)
    return BusPort(bus, faults, echoes=hears_itself(bus, interface))


def open_bus(
    interface: str, channel: str | int | None, bitrate: int, bus_kwargs: Mapping[str, Any]
) -> can.BusABC:
    """Return an open bus.

    Raises
    ------
    LinkError
        If the interface is unknown, or the channel does not exist or cannot be opened.
    """
    if interface == "lockstep":  # also where the package's entry points are not installed
        return LockstepBus("bench0" if channel is None else channel)
    if interface not in BACKENDS:
        raise LinkError(_unknown_interface(interface))
    logging.getLogger("can").addHandler(logging.NullHandler())  # our sentence is enough
    kwargs: dict[str, Any] = {"bitrate": bitrate, **bus_kwargs}
    if interface == "udp_multicast":
        # this machine only: other machines' benches share the group's default address
        kwargs = {"hop_limit": 0, "fd": False, **kwargs}
    try:
        if interface == "socketcan" and channel is not None:
            _require_channel(str(channel))
        return can.Bus(channel=channel, interface=interface, **kwargs)
    except (can.CanError, OSError, ValueError, TypeError, ImportError, RuntimeError) as error:
        raise LinkError(_cannot_open(interface, channel, error)) from error


def _require_channel(channel: str) -> None:
    """Raise OSError where SocketCAN or the channel is missing.

    python-can would find out too, but would leave its socket open.
    """
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW):
        names = {name for _, name in socket.if_nameindex()}
    if channel not in names:
        raise OSError(errno.ENODEV, "No such device")


def _unknown_interface(interface: str) -> str:
    near = difflib.get_close_matches(interface, [*BACKENDS, "lockstep"], n=1)
    hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(sorted(BACKENDS))}"
    return f"interface {interface} does not exist in python-can: {hint}"


def _cannot_open(interface: str, channel: str | int | None, error: Exception) -> str:
    number = getattr(error, "errno", None) or getattr(error, "error_code", None)
    if interface == "socketcan" and number == errno.ENODEV:
        kind = "vcan" if str(channel).startswith("vcan") else "can"
        make = (
            f"`ip link add dev {channel} type vcan && ip link set {channel} up`"
            if kind == "vcan"
            else f"`ip link set {channel} up type can bitrate 500000`"
        )
        return (
            f"channel {channel} does not exist on interface socketcan: bring it up with {make} "
            "or name another with --channel"
        )
    if interface == "socketcan" and number == errno.EAFNOSUPPORT:
        return (
            f"channel {channel} cannot be opened because this kernel has no SocketCAN: "
            "load the module can_raw or use another --interface"
        )
    reason = " ".join(str(error).split()) or type(error).__name__
    return (
        f"channel {channel} on interface {interface} cannot be opened ({reason}): "
        "check that the adapter is there, or name another with --interface and --channel"
    )
