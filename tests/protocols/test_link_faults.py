"""Faults of a channel: what error frames mean, and how they are counted."""

from __future__ import annotations

import logging

import pytest

from protocols.link_faults import FaultCounter, LinkFault, error_frame_fault

# identifiers and byte 1 as the Linux kernel sends them (can/error.h)
CASES = {
    "bus-off": (0x040, bytes(8), LinkFault.BUS_OFF),
    "receive overflow": (0x004, bytes((0, 0x01)), LinkFault.CONTROLLER_OVERFLOW),
    "transmit overflow": (0x004, bytes((0, 0x02)), LinkFault.CONTROLLER_OVERFLOW),
    "receive warning": (0x004, bytes((0, 0x04)), LinkFault.ERROR_WARNING),
    "transmit warning": (0x004, bytes((0, 0x08)), LinkFault.ERROR_WARNING),
    "receive passive": (0x004, bytes((0, 0x10)), LinkFault.ERROR_PASSIVE),
    "transmit passive": (0x004, bytes((0, 0x20)), LinkFault.ERROR_PASSIVE),
    "active again": (0x004, bytes((0, 0x40)), None),
    "unspecified state": (0x004, bytes(8), LinkFault.BUS_ERROR),
    "no state byte": (0x004, b"", LinkFault.BUS_ERROR),
    "no acknowledgement": (0x020, bytes(8), LinkFault.BUS_ERROR),
    "protocol violation": (0x008, bytes(8), LinkFault.BUS_ERROR),
    "bus-off with its state": (0x044, bytes((0, 0x30)), LinkFault.BUS_OFF),
}


@pytest.mark.parametrize("case", CASES)
def test_an_error_frame_is_read_as_the_kernel_means_it(case: str) -> None:
    error_class, data, fault = CASES[case]

    assert error_frame_fault(error_class, data) is fault


def test_faults_are_listed_once_in_order_and_counted() -> None:
    counter = FaultCounter("can0")

    counter.add(LinkFault.ERROR_PASSIVE)
    counter.add(LinkFault.BUS_OFF)
    counter.add(LinkFault.ERROR_PASSIVE)
    counter.add(LinkFault.RECEIVE_DROPPED, 12)

    assert counter.kinds == ["error_passive", "bus_off", "receive_dropped"]
    assert counter.counts[LinkFault.ERROR_PASSIVE] == 2
    assert counter.counts[LinkFault.RECEIVE_DROPPED] == 12


def test_the_first_fault_of_a_kind_is_logged_with_its_channel(
    caplog: pytest.LogCaptureFixture,
) -> None:
    counter = FaultCounter("can0")

    with caplog.at_level(logging.WARNING, "compassbench.protocols.link_faults"):
        counter.add(LinkFault.BUS_OFF)
        counter.add(LinkFault.BUS_OFF)

    assert [record.getMessage() for record in caplog.records] == ["channel can0 reports bus_off"]
