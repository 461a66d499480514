"""The client of the reference magnetometer on a simulated bus."""

from __future__ import annotations

import numpy as np
import pytest

from bench.errors import BusFault, ReferenceSilent
from bench.reference import NO_COUNTS, Reference
from protocols.compass import data_id
from protocols.e2e import E2eSender
from protocols.j1939 import address_claimed_id, pack_name
from protocols.reference_field import (
    REFERENCE_ADDRESS,
    pack_reference_field,
    reference_field_id,
)

FIELD = reference_field_id(REFERENCE_ADDRESS)


class Node:
    """Sends one field every tick from a tick on, as long as it may."""

    def __init__(self, echo, first_tick=1):
        self.sender = E2eSender(data_id(FIELD))
        self.first_tick, self.last_tick = first_tick, 10**9
        self.field_mg = (250.0, -1.0, 433.0)
        self.extra = []
        self.damaged = False
        echo.says = self.says

    def says(self, tick):
        frames, self.extra = self.extra, []
        if self.first_tick <= tick <= self.last_tick:
            data = pack_reference_field(self.sender, tick & 15, self.field_mg)
            frames.append((FIELD, data[:7] + bytes([data[7] ^ self.damaged])))
        return frames


@pytest.fixture
def node(echo):
    return Node(echo)


@pytest.fixture
def reference(bus):
    return Reference(bus, REFERENCE_ADDRESS)


def test_its_reading_is_that_of_the_tick(bus, node, reference):
    reference.wait_ready()
    assert reference.field_mg == pytest.approx((250.0, -1.0, 433.0))

    node.field_mg = (251.0, -1.0, 433.0)
    bus.tick()

    assert reference.counts == (5020, -20, 8660)
    assert reference.e2e["reference_field"]["state"] == "ok"


def test_before_the_first_frame_there_is_no_reading(bus, node, reference):
    node.first_tick = 10
    bus.run_for(0.05)

    assert reference.counts == NO_COUNTS
    assert np.isnan(reference.field_mg).all()
    assert not reference.watched


def test_a_node_that_never_speaks_is_an_error_with_what_to_do(bus, node, reference):
    node.first_tick = 10**9

    with pytest.raises(ReferenceSilent, match=r"0x90 has sent no reading within 2 s: check its"):
        reference.wait_ready()
    assert bus.tick_count == 200


def test_a_node_that_falls_silent_ends_the_run_once(bus, node, reference):
    reference.wait_ready()
    node.last_tick = bus.tick_count + 10

    with pytest.raises(ReferenceSilent, match=r"has sent nothing usable for 0\.5 s"):
        bus.run_for(2.0)
    assert bus.tick_count == node.last_tick + 51
    assert reference.e2e["reference_field"]["state"] == "not_available"
    bus.run_for(1.0)


def test_a_reading_without_any_noise_ends_the_run_once(bus, node, reference):
    reference.wait_ready()

    with pytest.raises(ReferenceSilent, match="sent one and the same reading for 10 s"):
        bus.run_for(20.0)
    assert bus.tick_count == pytest.approx(1002, abs=2)
    bus.run_for(1.0)


def test_one_count_of_noise_in_nine_seconds_is_enough(bus, node, reference):
    reference.wait_ready()
    for step in range(3):
        node.field_mg = (250.0, -1.0, 433.0 + 0.05 * (step % 2))
        bus.run_for(9.0)

    assert reference.watched


def test_an_old_reading_stands_beside_no_cycle(bus, node, reference):
    reference.wait_ready()
    node.last_tick = bus.tick_count
    bus.run_for(0.1)
    assert reference.counts != NO_COUNTS

    bus.tick()

    assert reference.counts == NO_COUNTS


def test_damaged_frames_are_not_used_and_count_as_silence(bus, node, reference):
    reference.wait_ready()
    node.damaged = True

    with pytest.raises(ReferenceSilent):
        bus.run_for(2.0)
    assert reference.e2e["reference_field"]["errors"] == 51


def test_before_it_was_heard_its_silence_ends_nothing(bus, node, reference):
    node.last_tick = 10

    bus.run_for(2.0)

    assert reference.silent


def test_two_nodes_at_its_address_are_told_with_both_identities(bus, node, reference):
    reference.wait_ready()
    claim = address_claimed_id(REFERENCE_ADDRESS)
    node.extra = [(claim, pack_name("REF1")), (claim, pack_name("REF2"))]

    with pytest.raises(BusFault, match="0x90 is claimed by 2 nodes"):
        bus.tick()


def test_the_rows_of_a_whole_station_hold_it(make_station):
    from bench.sample_log import SampleLog

    station = make_station()
    reference = Reference(station.bus, REFERENCE_ADDRESS)
    log = SampleLog(None, station.module, station.rig, reference=reference)
    bare = SampleLog(None, station.module, station.rig)
    station.module.wait_ready()
    for each in (log, bare):
        each.begin_dwell(0)
    station.bus.run_for(0.5)
    samples, without = log.end_dwell(), bare.end_dwell()

    assert len(samples) == 50
    assert np.linalg.norm(samples["reference_mg"], axis=1) == pytest.approx(500.0, abs=3.0)
    assert samples["reference_mg"].std(axis=0).max() < 0.1
    assert np.isnan(without["reference_mg"]).all()
    for name in ("set_mg", "heading_deg", "rig_azimuth_deg"):
        np.testing.assert_array_equal(samples[name], without[name])
