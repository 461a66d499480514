"""A module or a drive that says what cannot be: ERROR or FAIL for its own reason, never PASS.

The frames are changed on their way from the devices to the bench.
"""

from __future__ import annotations

import random
from dataclasses import replace

import pytest

from bench.acceptance.outcome import Outcome
from protocols import canopen, compass, j1939, uds
from protocols.e2e import crc8, data_id_seed
from protocols.frame import EXTENDED
from protocols.sync import SYNC_ID, TICK_DONE_ID

ADDRESS = 0x80
MAG_SET, HEADING = compass.mag_set_id(ADDRESS), compass.heading_id(ADDRESS)
STATUS, CLAIM = compass.status_id(ADDRESS), j1939.address_claimed_id(ADDRESS)
UDS, TPDO = uds.physical_response_id(ADDRESS), canopen.tpdo1_id(1)
SDO = canopen.sdo_response_id(1)
REFUSED = b"\x03\x7f\x22\x31" + bytes(4)
PENDING = b"\x03\x7f\x22\x78" + bytes(4)


class ChangedLink:
    """The devices' link; `change` gives the frames that leave in the place of one."""

    def __init__(self, link, change, from_tick):
        self._link, self._change, self._from_tick = link, change, from_tick
        self._ticks = 0
        self.wait, self.close = link.wait, link.close

    def poll(self):
        frame = self._link.poll()
        if frame is not None and frame.can_id == SYNC_ID:
            self._ticks += 1
        return frame

    def send(self, can_id, data):
        changed = self._change(can_id, data) if self._ticks >= self._from_tick else [(can_id, data)]
        for frame in changed:
            self._link.send(*frame)


def only(identifier, change, *, every=1):
    """Return a change of every n-th frame of one identifier."""
    count = 0

    def changed(can_id, data):
        nonlocal count
        if can_id == identifier:
            count += 1
            if count % every == 0:
                return [(can_id, each) for each in change(data)]
        return [(can_id, data)]

    return changed


def wrong_crc(data):
    return [bytes([data[0] ^ 0x01]) + data[1:]]


def stuck_counter(data):
    rest = bytes([data[1] & 0xF0 | 3]) + data[2:]
    return [bytes([crc8(data_id_seed(compass.data_id(MAG_SET)), rest)]) + rest]


def same_heading(data):
    """The direction of the very first frame, in an otherwise valid one."""
    rest = data[1:2] + b"\x00\x10" + data[4:]
    return [bytes([crc8(data_id_seed(compass.data_id(HEADING)), rest)]) + rest]


def another_name(data):
    return [data, bytes([data[0] ^ 0x01]) + data[1:]]


@pytest.fixture
def lie(prepare):
    """Return what runs a procedure with changed frames and gives the run after it."""

    def run(change, procedure="set_reset", from_tick=0, **options):
        lying = prepare(
            procedure, between=lambda link: ChangedLink(link, change, from_tick), **options
        )
        lying.verdict = lying.execute()
        assert lying.recorder.verdict == lying.verdict
        assert lying.verdict.outcome is not Outcome.PASS
        assert "failed: " not in lying.verdict.reason, "it is no typed reason"
        return lying

    return run


LIES = {
    # what is wrong: (frame, change, from tick, first failure, words of the reason)
    "every CRC": (MAG_SET, wrong_crc, 0, "module_silent", "has not sent readings and status"),
    "a stuck counter": (MAG_SET, stuck_counter, 60, "frames_lost", "complete cycles"),
    "short readings": (MAG_SET, lambda data: [data[:7]], 60, "frames_lost", "complete cycles"),
    "no readings": (MAG_SET, lambda data: [], 500, "module_silent", "cycles at position"),
    "headings twice": (HEADING, lambda data: [data] * 2, 60, "frames_lost", "frames_lost"),
    "short status": (STATUS, lambda data: [data[:5]], 60, "bus_fault", "must be 8 bytes"),
    "two names": (CLAIM, another_name, 0, "bus_fault", "is claimed by 2 modules"),
    "empty drive status": (TPDO, lambda data: [b""], 60, "bus_fault", "must be 6 bytes"),
    "no drive status": (TPDO, lambda data: [], 300, "rig_fault", "azimuth drive (node 1)"),
    "short SDO answers": (SDO, lambda data: [data[:7]], 0, "rig_fault", "must be 8 bytes"),
    "zeros by ISO-TP": (UDS, lambda data: [bytes(8)], 0, "module_silent", "broke off"),
    "single bytes by ISO-TP": (UDS, lambda data: [data[:1]], 0, "module_silent", "broke off"),
    "no answer": (UDS, lambda data: [], 0, "module_silent", "does not answer"),
    "a refusal": (UDS, lambda data: [REFUSED], 0, "module_refused", "RequestOutOfRange"),
    "pending for ever": (UDS, lambda data: [PENDING], 0, "module_silent", "does not answer"),
    "short tick-done": (TICK_DONE_ID, lambda data: [data[:2]], 60, "bus_fault", "SYNC 60"),
}


@pytest.mark.parametrize("what", LIES)
def test_frames_that_cannot_be_are_an_error_with_their_reason(lie, what):
    identifier, change, from_tick, first_failure, words = LIES[what]

    verdict = lie(only(identifier, change), from_tick=from_tick).verdict

    assert verdict.outcome is Outcome.ERROR
    assert verdict.first_failure == first_failure
    assert words in verdict.reason


@pytest.mark.parametrize(
    "change", [wrong_crc, lambda data: [], lambda data: [data, data]], ids=["crc", "gap", "twice"]
)
def test_single_frames_that_are_not_right_are_counted_and_an_error(lie, change):
    run = lie(only(MAG_SET, change, every=700))

    assert (run.verdict.outcome, run.verdict.first_failure) == (Outcome.ERROR, "frames_lost")
    assert run.context.module.lost > 0


def test_a_module_that_always_sends_one_heading_fails(lie):
    run = lie(only(HEADING, same_heading), "acceptance_swing")

    assert run.verdict.first_failure == "level_max"
    assert run.value("bench_against_module") > 1.0


@pytest.mark.parametrize("seed", range(8))
def test_random_damage_never_passes_and_never_surprises_the_bench(lie, seed):
    rng = random.Random(seed)

    def damage(can_id, data):
        if can_id == TICK_DONE_ID or rng.random() > 0.002:
            return [(can_id, data)]
        kind = rng.choice(["flip", "cut", "drop", "long"])
        if kind == "flip" and data:
            at = rng.randrange(len(data))
            return [
                (can_id, data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :])
            ]
        if kind == "cut":
            return [(can_id, data[: rng.randrange(len(data) + 1)])]
        return [] if kind == "drop" else [(can_id, (data + bytes(8))[:8])]

    run = lie(damage, from_tick=60)

    assert run.verdict.outcome in (Outcome.ERROR, Outcome.FAIL)
    assert run.verdict.first_failure is not None


def test_a_module_that_is_not_there_is_an_error(lie):
    def of_the_drives(can_id, data):
        return [(can_id, data)] if can_id == TICK_DONE_ID or not can_id & EXTENDED else []

    verdict = lie(of_the_drives).verdict

    assert (verdict.outcome, verdict.first_failure) == (Outcome.ERROR, "module_silent")


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_coefficients_that_are_no_numbers_are_not_taken(prepare, value):
    run = prepare("acceptance_swing")
    (firmware,) = (node.firmware for node in run.host._nodes if hasattr(node, "firmware"))
    boot = firmware.boot

    def boot_with_nonsense():
        boot()
        firmware.coefficients = replace(firmware.coefficients, mag_offset_mg=(value, 0.0, 0.0))

    firmware.boot = boot_with_nonsense

    verdict = run.execute()

    assert (verdict.outcome, verdict.first_failure) == (Outcome.ERROR, "module_refused")
    assert "must hold finite numbers" in verdict.reason


def test_scales_that_are_no_numbers_are_not_taken(lie):
    def zero_scales(can_id, data):
        if can_id == UDS and b"\x62" in data[:4]:
            return [(can_id, data[:5] + bytes(3))]
        return [(can_id, data if can_id != UDS or data[0] >> 4 != 2 else data[:1] + bytes(7))]

    verdict = lie(zero_scales).verdict

    assert (verdict.outcome, verdict.first_failure) == (Outcome.ERROR, "module_refused")
