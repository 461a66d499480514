"""The module's diagnostic server over the wire: services, refusals, security and time."""

from __future__ import annotations

import dataclasses

import pytest

from protocols import compass, uds
from protocols.uds import DEFAULT_COEFFICIENTS, pack_coefficients

BANK = pack_coefficients(
    dataclasses.replace(DEFAULT_COEFFICIENTS, version=9, mag_offset_mg=(10.0, 20.0, 30.0))
)


def did(identifier):
    return identifier.to_bytes(2, "big")


WRITE_BANK = b"\x2e" + did(uds.DID_COEFFICIENTS_STAGED) + BANK
COMMIT = b"\x31\x01" + did(uds.ROUTINE_COMMIT)
ROLLBACK = b"\x31\x01" + did(uds.ROUTINE_ROLLBACK)
SELF_TEST = b"\x31\x01" + did(uds.ROUTINE_SELF_TEST)
READ_STAGED = b"\x22" + did(uds.DID_COEFFICIENTS_STAGED)
READ_ACTIVE = b"\x22" + did(uds.DID_COEFFICIENTS)


@pytest.mark.parametrize(
    ("identifier", "value"),
    [
        (uds.DID_SERIAL, b"SN0001"),
        (uds.DID_PART_NUMBER, b"CB-AMR3"),
        (uds.DID_HARDWARE_VERSION, b"1.0"),
        (uds.DID_FIRMWARE_VERSION, b"1.0.0"),
        (uds.DID_SCALES, uds.pack_scales(compass.MAG_MG_PER_COUNT, compass.ACCEL_G_PER_COUNT)),
        (uds.DID_COEFFICIENTS, pack_coefficients(DEFAULT_COEFFICIENTS)),
        (uds.DID_SAMPLE_PERIOD, b"\x01"),
    ],
)
def test_reads_identity_and_settings(booted, identifier, value):
    assert booted.request(b"\x22" + did(identifier)) == b"\x62" + did(identifier) + value


def test_reads_several_identifiers_at_once(booted):
    answer = booted.request(b"\x22" + did(uds.DID_SERIAL) + did(uds.DID_HARDWARE_VERSION))

    assert answer == b"\x62" + did(uds.DID_SERIAL) + b"SN0001" + did(0xF191) + b"1.0"


def test_the_temperature_is_the_one_of_the_status_frame(booted):
    status = [f for f in booted.tick(10) if f.can_id == compass.status_id(0x80)][-1]
    answer = booted.request(b"\x22" + did(uds.DID_TEMPERATURE))

    reported = int.from_bytes(answer[3:], "big", signed=True) / 100.0
    assert reported == pytest.approx(compass.unpack_status(status.data).temperature_c, abs=0.05)


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        (b"\x85\x01", 0x11),
        (b"\x10\x02", 0x12),
        (b"\x10\x01\x00", 0x13),
        (b"\x10", 0x13),
        (b"\x3e\x01", 0x12),
        (b"\x11\x05", 0x12),
        (b"\x22\x01", 0x13),
        (b"\x22\x01\x00\x01", 0x13),
        (b"\x22\xab\xcd", 0x31),
        (READ_STAGED, 0x22),
        (b"\x22" + did(uds.DID_COEFFICIENTS) * 4, 0x14),
        (b"\x27\x01", 0x7F),
        (WRITE_BANK, 0x7F),
        (COMMIT, 0x7F),
        (b"\x19\x06\xff\xff\xff", 0x12),
        (b"\x19\x02", 0x13),
        (b"\x14\x12\x34\x56", 0x31),
    ],
)
def test_refuses_in_the_default_session(booted, request_, code):
    assert booted.request(request_) == bytes((0x7F, request_[0], code))


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        (WRITE_BANK, 0x33),
        (b"\x2e" + did(uds.DID_SERIAL) + b"SN0002", 0x31),
        (COMMIT, 0x33),
        (b"\x31\x01\xff\xff", 0x31),
        (b"\x31\x02" + did(uds.ROUTINE_COMMIT), 0x12),
        (b"\x31\x03" + did(uds.ROUTINE_SELF_TEST), 0x24),
        (b"\x27\x03", 0x12),
        (b"\x27\x02\x00\x00\x00\x00", 0x24),
        (b"\x27\x02\x00", 0x13),
    ],
)
def test_refuses_while_locked(booted, request_, code):
    booted.request(b"\x10\x03")

    assert booted.request(request_) == bytes((0x7F, request_[0], code))


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        (WRITE_BANK[:-1], 0x13),
        (WRITE_BANK[:-1] + b"\x00", 0x31),
        (b"\x2e" + did(uds.DID_SAMPLE_PERIOD) + b"\x00", 0x31),
        (b"\x2e" + did(uds.DID_SET_RESET) + b"\x01\xf4\x02", 0x31),
        (b"\x2e" + did(uds.DID_SET_RESET) + b"\xff\xff\x01", 0x31),
        (b"\x31\x01" + did(uds.ROUTINE_SET_RESET_PULSE), 0x13),
        (b"\x31\x01" + did(uds.ROUTINE_SET_RESET_PULSE) + b"\xff\xff", 0x31),
        (COMMIT + b"\x00", 0x13),
        (COMMIT, 0x24),
    ],
)
def test_refuses_nonsense_when_unlocked(booted, request_, code):
    booted.unlock()

    assert booted.request(request_) == bytes((0x7F, request_[0], code))


def test_coefficients_that_are_no_numbers_are_refused(booted):
    booted.unlock()
    bank = pack_coefficients(
        dataclasses.replace(DEFAULT_COEFFICIENTS, mag_offset_mg=(float("nan"), 0.0, 0.0))
    )

    answer = booted.request(b"\x2e" + did(uds.DID_COEFFICIENTS_STAGED) + bank)

    assert answer == b"\x7f\x2e\x31"


def test_an_unlocked_module_sends_a_seed_of_zeros(booted):
    booted.unlock()

    assert booted.request(b"\x27\x01") == b"\x67\x01" + bytes(4)


def test_three_wrong_keys_lock_the_module_out_for_ten_seconds(booted):
    booted.request(b"\x10\x03")
    codes = []
    for _ in range(3):
        booted.request(b"\x27\x01")
        codes.append(booted.request(b"\x27\x02\x00\x00\x00\x00")[2])
    assert codes == [0x35, 0x35, 0x36]
    assert booted.request(b"\x27\x01") == b"\x7f\x27\x37"

    for _ in range(10):
        booted.request(b"\x3e\x00")
        booted.tick(100)

    assert booted.request(b"\x27\x01")[:2] == b"\x67\x01"


def test_a_reset_does_not_shorten_the_lock_out(booted):
    booted.request(b"\x10\x03")
    for _ in range(3):
        booted.request(b"\x27\x01")
        booted.request(b"\x27\x02\x00\x00\x00\x00")
    booted.request(b"\x11\x01")
    booted.tick(40)
    booted.request(b"\x10\x03")

    assert booted.request(b"\x27\x01") == b"\x7f\x27\x37"


def test_a_key_belongs_to_one_seed(booted):
    booted.request(b"\x10\x03")
    first = booted.request(b"\x27\x01")[2:]
    second = booted.request(b"\x27\x01")[2:]
    assert first != second

    assert booted.request(b"\x27\x02" + uds.security_key(first)) == b"\x7f\x27\x35"


def test_the_session_ends_five_seconds_after_the_last_request(booted):
    booted.unlock()
    booted.tick(490)
    assert booted.request(b"\x3e\x00") == b"\x7e\x00"
    booted.tick(490)
    assert booted.request(b"\x27\x01") == b"\x67\x01" + bytes(4)

    booted.tick(510)

    assert booted.request(b"\x27\x01") == b"\x7f\x27\x7f"


def test_tester_present_can_be_silent(booted):
    assert booted.request(b"\x3e\x80", ticks=5) == b""
    assert booted.request(b"\x3e\x80\x01", ticks=5) == b"\x7f\x3e\x13"


def test_entering_a_session_locks_the_module_and_tells_its_times(booted):
    booted.unlock()

    assert booted.request(b"\x10\x03") == b"\x50\x03\x00\x32\x01\xf4"
    assert booted.request(WRITE_BANK) == b"\x7f\x2e\x33"


def test_a_written_bank_is_used_after_commit_and_reset(booted):
    booted.unlock()
    assert booted.request(WRITE_BANK) == b"\x6e" + did(uds.DID_COEFFICIENTS_STAGED)
    assert booted.request(READ_STAGED)[3:] == BANK
    assert booted.request(READ_ACTIVE)[3:] == pack_coefficients(DEFAULT_COEFFICIENTS)
    assert booted.request(COMMIT) == b"\x71\x01" + did(uds.ROUTINE_COMMIT)
    assert booted.request(b"\x11\x01") == b"\x51\x01"
    assert booted.request(READ_ACTIVE, ticks=20) == b"", "silent while it boots"
    booted.tick(20)

    assert booted.request(READ_ACTIVE)[3:] == BANK


def test_rollback_drops_what_was_staged(booted):
    booted.unlock()
    booted.request(WRITE_BANK)
    assert booted.request(ROLLBACK) == b"\x71\x01" + did(uds.ROUTINE_ROLLBACK)

    assert booted.request(READ_STAGED) == b"\x7f\x22\x22"
    assert booted.request(COMMIT) == b"\x7f\x31\x24"


def test_rollback_with_nothing_to_drop_is_granted(booted):
    booted.unlock()

    assert booted.request(ROLLBACK)[0] == 0x71


def test_a_second_write_must_wait_for_the_reset_after_a_commit(booted):
    booted.unlock()
    booted.request(WRITE_BANK)
    booted.request(COMMIT)

    assert booted.request(WRITE_BANK) == b"\x7f\x2e\x22"


def test_the_self_test_is_announced_and_takes_its_time(booted):
    booted.request(b"\x10\x03")
    response_id = uds.physical_response_id(0x80)
    booted.send(uds.physical_request_id(0x80), b"\x04" + SELF_TEST + b"\xcc" * 3)
    answers = [
        (tick, frame.data[1 : 1 + frame.data[0]])
        for tick in range(40)
        for frame in booted.tick()
        if frame.can_id == response_id
    ]

    assert answers == [(0, b"\x7f\x31\x78"), (19, b"\x71\x01" + did(uds.ROUTINE_SELF_TEST) + b"\0")]


def test_other_requests_are_put_off_during_the_self_test(booted):
    booted.request(b"\x10\x03")
    booted.send(uds.physical_request_id(0x80), b"\x04" + SELF_TEST + b"\xcc" * 3)
    booted.tick()

    assert booted.request(b"\x22\xf1\x8c") == b"\x7f\x22\x21"


def test_too_small_a_strap_current_is_a_trouble_code_until_it_is_cleared(booted):
    booted.unlock()
    assert booted.request(b"\x19\x02\xff") == b"\x59\x02\x09"
    booted.request(b"\x2e" + did(uds.DID_SET_RESET) + b"\x00\x0a\x01")

    assert booted.request(b"\x19\x02\xff") == b"\x59\x02\x09\xc1\x01\x01\x09"
    assert booted.request(b"\x19\x01\x08") == b"\x59\x01\x09\x01\x00\x01"
    assert booted.request(b"\x19\x02\x04") == b"\x59\x02\x09"
    assert len(booted.request(b"\x19\x0a")) == 3 + 3 * 4
    assert booted.request(SELF_TEST)[-1] == 0x01
    assert booted.request(b"\x14\xff\xff\xff") == b"\x54"
    assert booted.request(b"\x19\x02\xff") == b"\x59\x02\x09"


def test_the_set_reset_current_reads_back(booted):
    booted.unlock()
    booted.request(b"\x2e" + did(uds.DID_SET_RESET) + b"\x01\x2c\x01")

    assert booted.request(b"\x22" + did(uds.DID_SET_RESET))[3:] == b"\x01\x2c\x01"


def test_the_sample_period_slows_the_cyclic_frames(booted):
    booted.unlock()
    booted.request(b"\x2e" + did(uds.DID_SAMPLE_PERIOD) + b"\x05")

    frames = [f for f in booted.tick(50) if f.can_id == compass.mag_set_id(0x80)]

    assert len(frames) == 10


def test_udsoncans_client_reads_the_serial(booted):
    import isotp
    import udsoncan
    from udsoncan.client import Client
    from udsoncan.connections import BaseConnection

    class Text(udsoncan.DidCodec):
        def encode(self, value):
            return value.encode()

        def decode(self, payload):
            return payload.decode()

        def __len__(self):
            raise udsoncan.DidCodec.ReadAllRemainingData

    response_id = uds.physical_response_id(0x80)
    inbox = []
    transport = isotp.TransportLayerLogic(
        rxfn=lambda timeout=0.0: inbox.pop(0) if inbox else None,
        txfn=lambda m: booted.send(m.arbitration_id | 0x80000000, bytes(m.data)),
        address=isotp.Address(
            isotp.AddressingMode.NormalFixed_29bits, target_address=0x80, source_address=0xF1
        ),
        params={"tx_padding": 0xCC},
    )

    class Connection(BaseConnection):
        def open(self):
            return self

        def close(self):
            return None

        def is_open(self):
            return True

        def empty_rxqueue(self):
            inbox.clear()

        def specific_send(self, payload, timeout=None):
            transport.send(payload)

        def specific_wait_frame(self, timeout=None):
            for _ in range(50):
                transport.process()
                inbox.extend(
                    isotp.CanMessage(
                        arbitration_id=response_id & 0x1FFFFFFF, data=frame.data, extended_id=True
                    )
                    for frame in booted.tick()
                    if frame.can_id == response_id
                )
                transport.process()
                if transport.available():
                    return bytes(transport.recv())
            raise udsoncan.exceptions.TimeoutException

    config = dict(udsoncan.configs.default_client_config)
    config["data_identifiers"] = {uds.DID_SERIAL: Text()}
    with Client(Connection("test"), config=config) as client:
        client.change_session(3)
        client.tester_present()
        response = client.read_data_by_identifier([uds.DID_SERIAL])

    assert response.service_data.values[uds.DID_SERIAL] == "SN0001"
