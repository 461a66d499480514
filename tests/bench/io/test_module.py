from __future__ import annotations

import pytest

from bench.errors import BusFault, ModuleSilent
from bench.module import Module
from bench.samples import COMPLETE
from protocols import compass
from protocols.compass import Status, acceleration_id, heading_id, mag_reset_id, mag_set_id
from protocols.e2e import E2eSender, E2eState
from protocols.j1939 import address_claimed_id, pack_name

ADDRESS = 0x80
IDS = (mag_set_id, mag_reset_id, acceleration_id, heading_id)


class Sender:
    """The cyclic frames of a module, to be altered by a test."""

    def __init__(self) -> None:
        self.senders = [E2eSender(compass.data_id(make(ADDRESS))) for make in IDS]
        self.alter = lambda _tick, _slot, data: data

    def __call__(self, tick: int) -> list[tuple[int, bytes]]:
        frames = []
        for slot, (make, sender) in enumerate(zip(IDS, self.senders, strict=True)):
            data = self.alter(tick, slot, compass.pack_counts(sender, tick & 15, tick, 0, -1))
            if data is not None:
                frames.append((make(ADDRESS), data))
        if tick % 10 == 0:
            status = Status(21.5, 5.0, 0, 1, 0)
            frames.append((compass.status_id(ADDRESS), compass.pack_status(status)))
        return frames


@pytest.fixture
def sender(echo):
    sender = Sender()
    echo.says = sender
    return sender


@pytest.fixture
def module(bus, sender):
    del sender
    return Module(bus)


@pytest.fixture
def cycles(module):
    seen = []
    module.add_listener(seen.append)
    return seen


def test_given_four_frames_of_a_group_then_one_complete_cycle_a_tick(bus, cycles, module):
    bus.run_for(0.2)

    assert len(cycles) == 20
    assert {cycle.complete for cycle in cycles} == {COMPLETE}
    assert [cycle.group for cycle in cycles] == [tick & 15 for tick in range(1, 21)]
    assert [compass.unpack_counts(cycle.mag_set)[0] for cycle in cycles] == list(range(1, 21))
    assert module.lost == 0
    assert module.status.temperature_c == pytest.approx(21.5)


def test_given_a_frame_that_is_missing_then_the_cycle_is_incomplete_and_the_loss_listed(
    bus, cycles, module, sender
):
    sender.alter = lambda tick, slot, data: None if (tick, slot) == (5, 1) else data
    bus.run_for(0.1)

    assert [cycle.complete for cycle in cycles] == [15] * 4 + [0b1101] + [15] * 5
    assert module.incomplete == 1
    assert module.lost == 1
    (loss,) = module.losses
    assert loss.frame == "mag_reset"
    assert loss.state is E2eState.OK_SOME_LOST
    assert loss.missing == 1
    assert loss.t_s == pytest.approx(0.06)


def test_given_a_frame_with_a_flipped_bit_then_it_is_left_out_of_the_cycle(
    bus, cycles, module, sender
):
    sender.alter = lambda tick, slot, data: (
        data[:7] + bytes([data[7] ^ 0x10]) if (tick, slot) == (3, 2) else data
    )
    bus.run_for(0.06)

    assert [cycle.complete for cycle in cycles] == [15, 15, 0b1011, 15, 15, 15]
    assert module.e2e["acceleration"]["errors"] == 1
    assert module.losses[0].state is E2eState.ERROR


def test_given_a_repeated_frame_then_it_is_not_used(bus, cycles, module, sender):
    kept = {}

    def freeze(tick: int, slot: int, data: bytes) -> bytes:
        kept.setdefault(slot, data)
        return kept[slot] if slot == 3 else data

    sender.alter = freeze
    bus.run_for(0.03)

    assert [cycle.complete for cycle in cycles] == [15, 7, 7]
    assert module.e2e["heading"]["state"] == "repeated"


def test_given_a_module_that_falls_silent_then_the_tick_raises_once_after_half_a_second(
    bus, module, echo
):
    module.wait_ready()
    echo.says = lambda _: []
    start_s = bus.now_s
    with pytest.raises(ModuleSilent, match="0x80 has sent nothing for 0.5 s"):
        bus.run_for(2.0)

    assert bus.now_s - start_s == pytest.approx(0.51)
    assert module.silent
    assert module.e2e["heading"]["state"] == "not_available"
    bus.run_for(1.0)


def test_given_a_module_that_never_sends_then_wait_ready_raises(bus, echo):
    del echo
    with pytest.raises(ModuleSilent, match="module 0x80 has not sent readings and status"):
        Module(bus).wait_ready(0.5)


def test_given_an_announced_reset_then_silence_and_new_counters_are_no_loss(bus, module, sender):
    module.wait_ready()
    module.expect_silence()
    quiet_until = bus.tick_count + 100
    sender.alter = lambda tick, _slot, data: None if tick < quiet_until else data
    bus.run_for(1.2)

    assert module.lost == 0


def test_given_two_names_on_one_address_then_bus_fault_says_how_many(bus, module, echo, sender):
    claim = address_claimed_id(ADDRESS)
    echo.says = lambda tick: [
        *sender(tick),
        (claim, pack_name("SN0001")),
        (claim, pack_name("SN0002" if tick > 20 else "SN0001")),
    ]
    bus.run_for(0.2)
    with pytest.raises(BusFault, match="claimed by 2 modules"):
        bus.run_for(0.1)
    bus.run_for(0.1)


def test_given_the_virtual_module_when_identified_then_serial_and_scales_are_known(station):
    station.module.wait_ready()
    identity = station.module.identity()

    assert identity.serial == "SN0001"
    assert identity.part == "CB-AMR3"
    assert identity.firmware == "1.0.0"
    assert not identity.synthesised
    assert station.module.mag_mg_per_count == identity.mag_mg_per_count == 1600 / 16384


def test_given_a_silence_that_the_counters_do_not_show_then_its_cycles_count_as_lost(
    bus, module, echo
):
    module.wait_ready()
    sender = echo.says
    echo.says = lambda _tick: []
    bus.run_for(0.25)
    echo.says = sender
    bus.run_for(0.1)

    assert module.missed == 25
    assert module.lost == 25
    (loss,) = [loss for loss in module.losses if loss.frame == "cycle"]
    assert loss.state is E2eState.NOT_AVAILABLE
    assert loss.missing == 25


def test_given_a_silence_that_the_bench_asked_for_then_nothing_is_lost(bus, module, echo):
    module.wait_ready()
    sender = echo.says
    module.expect_silence()
    echo.says = lambda _tick: []
    bus.run_for(0.25)
    echo.says = sender
    module.wait_ready()
    bus.run_for(0.1)

    assert module.missed == 0


def test_given_a_longer_period_that_was_asked_for_then_nothing_is_lost(bus, module, echo):
    module.wait_ready()
    sender = echo.says
    module.follow_period(5)
    echo.says = lambda tick: sender(tick) if tick % 5 == 0 else []
    bus.run_for(0.5)

    assert module.missed == 0
