"""What the module's diagnostics speak: ISO 14229-1 identifiers and their payloads.

Transport is ISO 15765-2 with 29-bit normal fixed addressing (18DA target source).
"""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import dataclass
from typing import Final

from protocols.errors import FrameError
from protocols.frame import EXTENDED
from protocols.j1939 import TESTER_ADDRESS

DID_PART_NUMBER: Final = 0xF187
DID_SERIAL: Final = 0xF18C
DID_HARDWARE_VERSION: Final = 0xF191
DID_FIRMWARE_VERSION: Final = 0xF195
DID_COEFFICIENTS: Final = 0x0100
"""Coefficients in use; read only."""
DID_COEFFICIENTS_STAGED: Final = 0x0101
"""The inactive bank; written, read back, then made active by the commit routine."""
DID_SET_RESET: Final = 0x0102
"""Strap pulse current in mA (u16) and set/reset operation (u8: 1 alternating)."""
DID_SAMPLE_PERIOD: Final = 0x0103
"""Ticks of 10 ms between measuring cycles (u8)."""
DID_SCALES: Final = 0x0104
"""mG per magnetometer count and g per accelerometer count (two float64)."""
DID_TEMPERATURE: Final = 0x0105
"""Temperature in 0.01 deg C (s16)."""

ROUTINE_SET_RESET_PULSE: Final = 0x0201
"""One set and one reset pulse of the given current in mA (u16)."""
ROUTINE_COMMIT: Final = 0x0202
"""Make the staged bank the active one, from the next reset on."""
ROUTINE_SELF_TEST: Final = 0x0203
ROUTINE_ROLLBACK: Final = 0x0204
"""Drop the staged bank."""

SECURITY_SEED: Final = 0x01
SECURITY_KEY: Final = 0x02
SECURITY_ATTEMPTS: Final = 3
SECURITY_LOCK_OUT_S: Final = 10.0
SESSION_DEFAULT: Final = 0x01
SESSION_EXTENDED: Final = 0x03
S3_SERVER_S: Final = 5.0
P2_SERVER_S: Final = 0.05
P2_STAR_SERVER_S: Final = 5.0

DTC_COEFFICIENTS_LOST: Final = 0xC10055
DTC_STRAP: Final = 0xC10101
DTC_SATURATED: Final = 0xC10102

_SECURITY_MASK: Final = 0x5EC0DE11


def physical_request_id(module_address: int) -> int:
    """Return the identifier of requests from the bench to a module.

    >>> hex(physical_request_id(0x80))
    '0x98da80f1'
    """
    return EXTENDED | 0x18DA0000 | module_address << 8 | TESTER_ADDRESS


def physical_response_id(module_address: int) -> int:
    """Return the identifier of a module's answers to the bench."""
    return EXTENDED | 0x18DA0000 | TESTER_ADDRESS << 8 | module_address


def security_key(seed: bytes) -> bytes:
    """Return the key for a seed of four bytes: CRC-32 of the seed, masked."""
    return (zlib.crc32(seed) ^ _SECURITY_MASK).to_bytes(4, "big")


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficients:
    """One bank of the module's coefficients, as float32 on the wire.

    field of a bridge (mG) = raw (mG) (1 - (raw across/hk_mg)^2)
    corrected field (mG) = mag_matrix @ (field of the bridges (mG) - mag_offset_mg)
    corrected specific force (g) = accel_matrix @ (raw (g) - accel_offset_g)

    The raw field is (set - reset)/2; across of x is y, of y and z it is x. Matrices are row-major.

    Attributes
    ----------
    hk_mg : three floats
        Anisotropy field of the x, y and z film in the reading of the bridge across it; 0 takes no
        cross-axis term out of that bridge.
    extended_dip_deg : float
        Cho & Park's extended dip angle, within (-90, 90); 0 where the module has three axes.
    horizontal_mg : float
        Horizontal field in which a module of two axes was normalised; 0 where it was not, and
        where the module has three axes. The field downwards is horizontal_mg tan(dip).
    """

    version: int
    mag_offset_mg: tuple[float, ...]
    mag_matrix: tuple[float, ...]
    accel_offset_g: tuple[float, ...]
    accel_matrix: tuple[float, ...]
    extended_dip_deg: float = 0.0
    horizontal_mg: float = 0.0
    hk_mg: tuple[float, ...] = (0.0, 0.0, 0.0)


_PLAIN_BANK = struct.Struct("<HBx26f")
_BANK = struct.Struct("<HBx29f")
PLAIN_BANK_LENGTH: Final = _PLAIN_BANK.size + 4
"""A bank of layout 0, which ends before hk_mg: no cross-axis term is taken out."""
BANK_LENGTH: Final = _BANK.size + 4
"""A bank of layout 1."""
_LAYOUTS: Final = {PLAIN_BANK_LENGTH: (0, _PLAIN_BANK), BANK_LENGTH: (1, _BANK)}
LEAST_HK_MG: Final = 2000.0
"""A film of less is broken: films have 4 G and more."""

DEFAULT_COEFFICIENTS: Final = Coefficients(
    version=0,
    mag_offset_mg=(0.0, 0.0, 0.0),
    mag_matrix=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    accel_offset_g=(0.0, 0.0, 0.0),
    accel_matrix=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
)


def pack_coefficients(coefficients: Coefficients) -> bytes:
    """Return version, layout, 26 or 29 float32 and CRC-32 (little-endian).

    A bank without cross-axis terms has the layout that modules had before they knew them.

    Raises
    ------
    FrameError
        If a value does not fit a float32.
    """
    values = (
        *coefficients.mag_offset_mg,
        *coefficients.mag_matrix,
        *coefficients.accel_offset_g,
        *coefficients.accel_matrix,
        coefficients.extended_dip_deg,
        coefficients.horizontal_mg,
        *(coefficients.hk_mg if any(coefficients.hk_mg) else ()),
    )
    layout, bank = _LAYOUTS[BANK_LENGTH if any(coefficients.hk_mg) else PLAIN_BANK_LENGTH]
    try:
        body = bank.pack(coefficients.version, layout, *values)
    except OverflowError as error:
        sentence = (
            f"coefficients must fit single precision; instead received {max(values, key=abs)}"
        )
        raise FrameError(sentence) from error
    return body + zlib.crc32(body).to_bytes(4, "little")


def unpack_coefficients(data: bytes) -> Coefficients:
    """Return one bank of either layout.

    Raises
    ------
    FrameError
        If length, layout or CRC-32 is wrong, a value is not a finite number, the dip is not
        within (-90, 90), the horizontal field is negative, there is a dip without it, or an
        anisotropy field is neither 0 nor one of a sound film.
    """
    if len(data) not in _LAYOUTS:
        sentence = (
            f"coefficient bank must be {PLAIN_BANK_LENGTH} or {BANK_LENGTH} bytes; "
            f"instead received {len(data)}"
        )
        raise FrameError(sentence)
    body, crc = data[:-4], int.from_bytes(data[-4:], "little")
    if zlib.crc32(body) != crc:
        sentence = "coefficient bank has a wrong CRC-32; read it again or restore it"
        raise FrameError(sentence)
    known, bank = _LAYOUTS[len(data)]
    version, layout, *values = bank.unpack(body)
    if layout != known:
        sentence = (
            f"coefficient bank of {len(data)} bytes must have layout {known}; "
            f"instead received layout {layout}"
        )
        raise FrameError(sentence)
    if not all(map(math.isfinite, values)):
        sentence = "coefficient bank must hold finite numbers; instead it holds NaN or infinity"
        raise FrameError(sentence)
    hk_mg = tuple(values[26:]) or (0.0, 0.0, 0.0)
    _check_dip(values[24], values[25])
    _check_hk(hk_mg)
    return Coefficients(
        version=version,
        mag_offset_mg=tuple(values[0:3]),
        mag_matrix=tuple(values[3:12]),
        accel_offset_g=tuple(values[12:15]),
        accel_matrix=tuple(values[15:24]),
        extended_dip_deg=values[24],
        horizontal_mg=values[25],
        hk_mg=hk_mg,
    )


def _check_hk(hk_mg: tuple[float, ...]) -> None:
    for axis, value_mg in zip("xyz", hk_mg, strict=True):
        if value_mg != 0.0 and not value_mg >= LEAST_HK_MG:
            sentence = (
                f"anisotropy field {axis} of a coefficient bank must be 0 or at least "
                f"{LEAST_HK_MG:g} mG; instead received {value_mg} mG"
            )
            raise FrameError(sentence)


def bank_in(slot: bytes) -> bytes:
    """Return the bank that begins a place of at least BANK_LENGTH bytes, by its layout."""
    return slot[: PLAIN_BANK_LENGTH if slot[2] == 0 else BANK_LENGTH]


def _check_dip(extended_dip_deg: float, horizontal_mg: float) -> None:
    if not -90.0 < extended_dip_deg < 90.0:
        sentence = (
            "extended dip of a coefficient bank must be within (-90, 90) deg; "
            f"instead received {extended_dip_deg} deg"
        )
        raise FrameError(sentence)
    if horizontal_mg < 0.0 or (horizontal_mg == 0.0 and extended_dip_deg != 0.0):
        sentence = (
            "horizontal field of a coefficient bank must be positive, or 0 with a dip of 0; "
            f"instead received {horizontal_mg} mG with {extended_dip_deg} deg"
        )
        raise FrameError(sentence)


_SCALES = struct.Struct("<dd")


def pack_scales(mag_mg_per_count: float, accel_g_per_count: float) -> bytes:
    """Return the payload of DID_SCALES."""
    return _SCALES.pack(mag_mg_per_count, accel_g_per_count)


def unpack_scales(data: bytes) -> tuple[float, float]:
    """Return (mG per magnetometer count, g per accelerometer count)."""
    if len(data) != _SCALES.size:
        sentence = f"scales must be {_SCALES.size} bytes; instead received {len(data)}"
        raise FrameError(sentence)
    mag_mg_per_count, accel_g_per_count = _SCALES.unpack(data)
    if not (0.0 < mag_mg_per_count < math.inf and 0.0 < accel_g_per_count < math.inf):
        sentence = (
            "scales must be positive and finite; instead received "
            f"{mag_mg_per_count} mG and {accel_g_per_count} g"
        )
        raise FrameError(sentence)
    return mag_mg_per_count, accel_g_per_count
