"""Clocks and the tick's frames."""

from __future__ import annotations

from protocols.clock import MonotonicClock, SimulatedClock
from protocols.sync import (
    SYNC_COUNTER_OVERFLOW,
    SYNC_DATA,
    TICK_DONE_ID,
    TICK_NS,
    TICK_S,
    pack_tick_done,
    sync_counter,
    unpack_tick_done,
)


def test_simulated_time_passes_only_when_it_is_advanced() -> None:
    clock = SimulatedClock(start_ns=7)
    first = clock.now_ns()

    clock.advance(TICK_NS)

    assert (first, clock.now_ns()) == (7, 10_000_007)


def test_monotonic_time_starts_near_zero_and_never_falls() -> None:
    clock = MonotonicClock()

    times_ns = [clock.now_ns() for _ in range(100)]

    assert times_ns == sorted(times_ns)
    assert 0 <= times_ns[0] < 5_000_000_000


def test_a_tick_is_ten_milliseconds() -> None:
    assert TICK_NS == round(TICK_S * 1e9) == 10_000_000


def test_sync_counter_runs_1_to_240_and_starts_again() -> None:
    counters = [sync_counter(tick) for tick in range(1, 482)]

    assert counters[:240] == list(range(1, 241))
    assert counters[240:480] == counters[:240]
    assert counters[480] == 1


def test_the_low_four_bits_of_the_counter_go_on_across_the_overflow() -> None:
    groups = [sync_counter(tick) & 0x0F for tick in range(1, 500)]

    assert all((b - a) % 16 == 1 for a, b in zip(groups, groups[1:], strict=False))


def test_sync_payload_is_the_counter_as_one_byte() -> None:
    assert [data[0] for data in SYNC_DATA] == list(range(SYNC_COUNTER_OVERFLOW + 1))


def test_tick_done_round_trips_at_its_boundaries() -> None:
    for tick in (0, 1, 0xFFFFFFFF):
        assert unpack_tick_done(pack_tick_done(tick, 240)) == (tick, 240)
    assert unpack_tick_done(pack_tick_done(0x1_0000_0005, 1)) == (5, 1)
    assert len(pack_tick_done(1, 1)) == 8


def test_tick_done_has_the_lowest_priority_of_the_modules_groups() -> None:
    assert TICK_DONE_ID == 0x98FFFEFE
