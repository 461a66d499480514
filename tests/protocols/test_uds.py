"""UDS identifiers and payloads, against can-isotp's addressing and zlib's CRC."""

from __future__ import annotations

import dataclasses
import math
import struct
import zlib

import isotp
import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols import uds
from protocols.errors import FrameError
from protocols.frame import EXTENDED

float32 = st.floats(width=32, allow_nan=False, allow_infinity=False)
dip_deg = st.floats(-89.0, 89.0, width=32)
field_mg = st.floats(1.0, 1e6, width=32)
hk_mg = st.one_of(st.just(0.0), st.floats(2000.0, 1e6, width=32))


def bank(values: list[float], version: int = 1) -> uds.Coefficients:
    return uds.Coefficients(
        version=version,
        mag_offset_mg=tuple(values[0:3]),
        mag_matrix=tuple(values[3:12]),
        accel_offset_g=tuple(values[12:15]),
        accel_matrix=tuple(values[15:24]),
        extended_dip_deg=values[24],
        horizontal_mg=values[25],
        hk_mg=tuple(values[26:29]),
    )


@pytest.mark.parametrize("address", [0x00, 0x80, 0x8F, 0xFD])
def test_identifiers_are_those_of_normal_fixed_addressing(address: int) -> None:
    tester = isotp.Address(
        isotp.AddressingMode.NormalFixed_29bits, source_address=0xF1, target_address=address
    )

    assert uds.physical_request_id(address) == EXTENDED | tester.get_tx_arbitration_id()
    assert uds.physical_response_id(address) == EXTENDED | tester.get_rx_arbitration_id()


@given(
    st.lists(float32, min_size=24, max_size=24),
    dip_deg,
    field_mg,
    st.lists(hk_mg, min_size=3, max_size=3),
    st.integers(0, 0xFFFF),
)
def test_a_bank_of_single_precision_numbers_comes_back_exactly(
    values: list[float], dip_deg: float, horizontal_mg: float, hk_mg: list[float], version: int
) -> None:
    coefficients = bank([*values, dip_deg, horizontal_mg, *hk_mg], version)

    assert uds.unpack_coefficients(uds.pack_coefficients(coefficients)) == coefficients


def test_a_bank_of_double_precision_numbers_is_rounded_to_single() -> None:
    sent = bank([*(math.pi * place for place in range(26)), 0.0, 0.0, 8000.0])

    received = uds.unpack_coefficients(uds.pack_coefficients(sent))

    rounded = struct.unpack("<f", struct.pack("<f", math.pi))[0]
    assert received.mag_offset_mg[1] == rounded != math.pi


def test_the_layout_of_a_bank_is_version_layout_floats_and_crc() -> None:
    values = [*map(float, range(26)), 0.0, 7000.0, 8000.0]
    data = uds.pack_coefficients(bank(values, version=0x0102))

    assert len(data) == uds.BANK_LENGTH == 124
    assert data[:4] == bytes.fromhex("02010100")
    assert struct.unpack("<29f", data[4:120]) == tuple(values)
    assert int.from_bytes(data[120:], "little") == zlib.crc32(data[:120])


def test_a_bank_without_cross_axis_terms_is_that_of_modules_that_did_not_know_them() -> None:
    values = [*map(float, range(24)), 48.5, 250.0]
    body = struct.pack("<H2x26f", 7, *values)
    former = body + zlib.crc32(body).to_bytes(4, "little")

    received = uds.unpack_coefficients(former)

    assert received == bank([*values, 0.0, 0.0, 0.0], version=7)
    assert uds.pack_coefficients(received) == former
    assert len(former) == uds.PLAIN_BANK_LENGTH == 112


@pytest.mark.parametrize("hk_mg", [0.0, 8000.0])
def test_a_bank_is_found_in_a_longer_place(hk_mg: float) -> None:
    data = uds.pack_coefficients(bank([0.0] * 28 + [hk_mg]))

    assert uds.bank_in(data + bytes(300)) == data


@pytest.mark.parametrize("length", [uds.BANK_LENGTH, uds.PLAIN_BANK_LENGTH])
def test_a_layout_that_does_not_belong_to_the_length_is_refused(length: int) -> None:
    body = bytearray(length - 4)
    body[2] = 7
    data = bytes(body) + zlib.crc32(body).to_bytes(4, "little")

    with pytest.raises(FrameError, match=f"{length} bytes must have layout .; .* layout 7"):
        uds.unpack_coefficients(data)


@pytest.mark.parametrize(
    ("hk_mg", "sentence"),
    [
        ((1999.0, 0.0, 0.0), "field x .* must be 0 or at least 2000 mG; .* 1999.0 mG"),
        ((8000.0, -8000.0, 0.0), "field y of a coefficient bank .* -8000.0 mG"),
        ((0.0, 0.0, 1e-30), "field z"),
        ((0.0, math.nan, 0.0), "finite numbers"),
    ],
)
def test_an_anisotropy_field_of_no_sound_film_is_refused(
    hk_mg: tuple[float, float, float], sentence: str
) -> None:
    data = uds.pack_coefficients(bank([0.0] * 26 + list(hk_mg)))

    with pytest.raises(FrameError, match=sentence):
        uds.unpack_coefficients(data)


@given(st.integers(0, 8 * uds.BANK_LENGTH - 1))
def test_every_single_bit_error_in_a_bank_is_refused(bit: int) -> None:
    knowing = dataclasses.replace(uds.DEFAULT_COEFFICIENTS, hk_mg=(8000.0, 7900.0, 0.0))
    data = bytearray(uds.pack_coefficients(knowing))
    data[bit // 8] ^= 1 << bit % 8

    with pytest.raises(FrameError, match="wrong CRC-32"):
        uds.unpack_coefficients(bytes(data))


@pytest.mark.parametrize("length", [0, uds.BANK_LENGTH - 1, uds.BANK_LENGTH + 1])
def test_a_bank_of_another_length_is_refused_with_both_lengths(length: int) -> None:
    with pytest.raises(FrameError, match=f"must be 112 or 124 bytes; instead received {length}"):
        uds.unpack_coefficients(bytes(length))


@pytest.mark.parametrize(
    ("dip_deg", "horizontal_mg", "sentence"),
    [
        (90.0, 250.0, r"dip .* must be within \(-90, 90\) deg; instead received 90.0 deg"),
        (-91.0, 250.0, "instead received -91.0 deg"),
        (math.nan, 250.0, "finite numbers; instead it holds NaN"),
        (60.0, math.inf, "finite numbers"),
        (60.0, -250.0, "must be positive, or 0 with a dip of 0; instead received -250.0 mG"),
        (60.0, 0.0, "instead received 0.0 mG with 60.0 deg"),
    ],
)
def test_a_dip_that_leaves_no_vertical_field_is_refused(
    dip_deg: float, horizontal_mg: float, sentence: str
) -> None:
    data = uds.pack_coefficients(bank([0.0] * 24 + [dip_deg, horizontal_mg, 0.0, 0.0, 0.0]))

    with pytest.raises(FrameError, match=sentence):
        uds.unpack_coefficients(data)


def test_default_coefficients_change_nothing() -> None:
    identity = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

    assert uds.DEFAULT_COEFFICIENTS.mag_matrix == uds.DEFAULT_COEFFICIENTS.accel_matrix == identity
    assert uds.DEFAULT_COEFFICIENTS.mag_offset_mg == (0.0, 0.0, 0.0)
    assert uds.DEFAULT_COEFFICIENTS.version == 0
    assert uds.DEFAULT_COEFFICIENTS.extended_dip_deg == 0.0
    assert uds.DEFAULT_COEFFICIENTS.horizontal_mg == 0.0
    assert uds.DEFAULT_COEFFICIENTS.hk_mg == (0.0, 0.0, 0.0)


def test_scales_round_trip_exactly() -> None:
    scales = (1600.0 / 16384.0, 1.0 / 16384.0)

    assert uds.unpack_scales(uds.pack_scales(*scales)) == scales


def test_scales_of_another_length_are_refused() -> None:
    with pytest.raises(FrameError, match="scales must be 16 bytes; instead received 8"):
        uds.unpack_scales(bytes(8))


def test_key_has_four_bytes_and_follows_the_seed() -> None:
    keys = {uds.security_key(number.to_bytes(4, "big")) for number in range(256)}

    assert len(keys) == 256
    assert {len(key) for key in keys} == {4}
    # CRC-32 of four zero bytes is 2144DF1Ch
    assert uds.security_key(bytes(4)) == (0x2144DF1C ^ 0x5EC0DE11).to_bytes(4, "big")


def test_a_value_beyond_single_precision_is_refused_with_the_value() -> None:
    beyond = dataclasses.replace(uds.DEFAULT_COEFFICIENTS, mag_offset_mg=(4e38, 0.0, 0.0))
    with pytest.raises(FrameError, match="single precision; instead received 4e\\+38"):
        uds.pack_coefficients(beyond)
