from __future__ import annotations

import pytest

from bench.bus import detect_mode
from bench.errors import ModuleSilent
from protocols.clock import SimulatedClock
from protocols.sync import SYNC_ID


def test_given_a_lockstep_simulator_then_lockstep_after_one_sync(wire, echo):
    assert detect_mode(wire.attach(), SimulatedClock()) == "lockstep"
    assert [f.can_id for f in echo.heard] == [SYNC_ID]


def test_given_frames_without_tick_done_then_free(wire):
    port = wire.attach()
    wire.attach().send(0x181, b"123456")

    assert detect_mode(port, SimulatedClock()) == "free"


def test_given_an_empty_bus_then_module_silent_says_what_to_do(wire):
    with pytest.raises(ModuleSilent, match="start the simulator"):
        detect_mode(wire.attach(), SimulatedClock())
