"""A whole virtual station: determinism, options, faults, cost."""

from __future__ import annotations

import hashlib
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

from devices.simulator import SimulatorOptions, build_host, simulate
from protocols import canopen, compass, uds
from protocols.link import Wire
from protocols.sync import SYNC_DATA, SYNC_ID, TICK_DONE_ID, TICK_NS

NEW_SET_POINT = 0x3F


def drive_about(station, ticks=300):
    """Enable and move the rig, ask the module, and return a digest of every frame."""
    digest = hashlib.sha256()
    station.send(canopen.NMT_ID, canopen.nmt_frame(canopen.NMT_START, 0))
    for word in (0x06, 0x07, 0x0F, NEW_SET_POINT):
        for node in canopen.AXIS_NODES:
            station.send(canopen.rpdo1_id(node), canopen.pack_rpdo1(word, 20_000))
        station.tick()
    station.send(uds.physical_request_id(0x80), b"\x03\x22\xf1\x8c\xcc\xcc\xcc\xcc")
    for frame in station.tick(ticks):
        digest.update(frame.can_id.to_bytes(4, "big") + frame.data)
    return digest.hexdigest()


def test_one_seed_gives_the_same_frames(make_station):
    assert drive_about(make_station(seed=5)) == drive_about(make_station(seed=5))


@pytest.mark.parametrize("other", [{"seed": 6}, {"serial": "SN0002"}, {"horizontal_mg": 251.0}])
def test_another_seed_serial_or_site_gives_others(make_station, other):
    assert drive_about(make_station(seed=5)) != drive_about(make_station(**{"seed": 5, **other}))


def test_a_link_for_each_node_gives_the_same_frames(make_station):
    one = make_station(seed=5)
    wire = Wire()
    host = build_host(SimulatorOptions(seed=5), [wire.attach() for _ in range(5)])
    wire.add_server(host.serve)
    several = make_station(seed=5)
    several.wire, several.host, several.port = wire, host, wire.attach()

    assert drive_about(one) == drive_about(several)


def test_the_module_feels_the_rig_turn(booted):
    before = compass.unpack_counts(booted.tick()[0].data)
    drive_about(booted)
    frames = booted.tick()
    after = [f for f in frames if f.can_id == compass.mag_set_id(0x80)][0]

    assert (
        max(abs(a - b) for a, b in zip(before, compass.unpack_counts(after.data), strict=True))
        > 100
    )


def test_coefficients_outlive_the_process_in_the_file(make_station, tmp_path):
    nvm = tmp_path / "module.nvm"
    first = make_station(nvm=nvm)
    first.tick(40)
    first.unlock()
    bank = uds.pack_coefficients(replace(uds.DEFAULT_COEFFICIENTS, version=1))
    first.request(b"\x2e\x01\x01" + bank)
    first.request(b"\x31\x01\x02\x02")

    second = make_station(nvm=nvm)
    status = [f for f in second.tick(60) if f.can_id == compass.status_id(0x80)][-1]

    assert compass.unpack_status(status.data).boots == 2
    assert not compass.unpack_status(status.data).flags & compass.FLAG_DEFAULT_COEFFICIENTS


def test_a_decayed_file_boots_with_defaults_and_a_trouble_code(make_station, tmp_path):
    nvm = tmp_path / "module.nvm"
    nvm.write_bytes(b"rubbish" * 40)
    station = make_station(nvm=nvm)
    station.tick(40)

    assert station.request(b"\x19\x02\xff") == b"\x59\x02\x09\xc1\x00\x55\x09"
    assert station.request(b"\x22\x01\x00")[3:] == uds.pack_coefficients(uds.DEFAULT_COEFFICIENTS)


def test_a_lost_write_reads_back_from_the_buffer_and_is_gone_after_the_reset(make_station):
    station = make_station(faults=("lost_write",))
    station.tick(40)
    station.unlock()
    bank = uds.pack_coefficients(
        uds.Coefficients(
            version=4,
            mag_offset_mg=(1.0, 2.0, 3.0),
            mag_matrix=(1.0,) * 9,
            accel_offset_g=(0.0,) * 3,
            accel_matrix=(1.0,) * 9,
        )
    )
    station.request(b"\x2e\x01\x01" + bank)
    assert station.request(b"\x22\x01\x01")[3:] == bank
    assert station.request(b"\x31\x01\x02\x02")[0] == 0x71
    station.request(b"\x11\x01")
    station.tick(40)

    assert station.request(b"\x22\x01\x00")[3:] == uds.pack_coefficients(uds.DEFAULT_COEFFICIENTS)


def test_a_sensor_fault_begins_at_its_tick(make_station):
    sound, broken = make_station(), make_station(faults=("stuck_axis_x@60",))

    def readings(station, ticks):
        frames = station.tick(ticks)
        return [f.data for f in frames if f.can_id == compass.mag_set_id(0x80)]

    assert readings(sound, 59) == readings(broken, 59)
    assert readings(sound, 1) != readings(broken, 1)


def test_a_stalled_axis_is_reported_by_its_drive(make_station):
    station = make_station(faults=("axis_stalled_roll",))
    station.tick(40)
    station.send(canopen.NMT_ID, canopen.nmt_frame(canopen.NMT_START, 0))
    for word in (0x06, 0x07, 0x0F, NEW_SET_POINT):
        for node in canopen.AXIS_NODES:
            station.send(canopen.rpdo1_id(node), canopen.pack_rpdo1(word, 20_000))
        station.tick()

    emergencies = {f.can_id for f in station.tick(100) if 0x081 <= f.can_id <= 0x083}

    assert emergencies == {canopen.emergency_id(canopen.ROLL_NODE)}


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"serial": ""}, "serial must be 1 to 32 printable ASCII characters"),
        ({"serial": "SN\u00e9"}, "serial must be"),
        ({"serial": "x" * 33}, "serial must be"),
        ({"address": 0xFE}, "address must be within 0 and 253; instead received 254"),
        ({"seed": -1}, "seed must be at least 0; instead received -1"),
        ({"faults": ("dead_strap_q",)}, "did you mean dead_strap"),
        (
            {"faults": ("excess_noise",), "replay": Path("recording.csv")},
            "fault excess_noise breaks the sensor model, which a recording replaces",
        ),
    ],
)
def test_options_that_cannot_be_are_refused_in_one_sentence(options, sentence):
    with pytest.raises(ValueError, match=sentence):
        SimulatorOptions(**options)


class ThreadPort:
    """A wire's port whose waiting lets another thread run; frames cross by two deques."""

    def __init__(self, port):
        self._port = port

    def send(self, can_id, data):
        self._port.send(can_id, data)

    def poll(self):
        return self._port.queue.popleft() if self._port.queue else None

    def wait(self, timeout_s):
        if not self._port.queue:
            time.sleep(min(timeout_s, 0.001))
        return self.poll()

    def close(self):
        return None


@pytest.mark.parametrize("free_running", [False, True])
def test_simulate_runs_until_it_is_stopped(free_running):
    wire = Wire()
    device, bench = ThreadPort(wire.attach()), ThreadPort(wire.attach())
    ended = threading.Event()
    hosts = []
    thread = threading.Thread(
        target=lambda: hosts.append(
            simulate(SimulatorOptions(), device, free_running=free_running, stop=ended.is_set)
        )
    )
    thread.start()
    seen = set()
    deadline = time.monotonic() + 20.0
    counter = 1
    while compass.mag_set_id(0x80) not in seen and time.monotonic() < deadline:
        bench.send(SYNC_ID, SYNC_DATA[counter])
        counter = counter % 240 + 1
        time.sleep(0.002)
        while (frame := bench.poll()) is not None:
            seen.add(frame.can_id)
    ended.set()
    thread.join(10.0)

    assert compass.mag_set_id(0x80) in seen
    assert (TICK_DONE_ID in seen) is not free_running
    assert hosts[0].tick_count >= 30


def test_simulate_ends_after_its_seconds():
    wire = Wire()
    started = time.monotonic()
    host = simulate(
        SimulatorOptions(),
        ThreadPort(wire.attach()),
        free_running=True,
        stop=lambda: False,
        seconds=0.2,
    )

    assert 10 <= host.tick_count <= 30
    assert host.now_ns == host.tick_count * TICK_NS
    assert time.monotonic() - started < 5.0
