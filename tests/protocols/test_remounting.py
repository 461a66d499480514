"""The two frames of the virtual operator."""

from __future__ import annotations

import pytest

from protocols import remounting
from protocols.frame import EXTENDED
from protocols.remounting import (
    MountCode,
    RemountResult,
    pack_remount,
    pack_remount_done,
    unpack_remount,
    unpack_remount_done,
)


@pytest.mark.parametrize("code", MountCode)
@pytest.mark.parametrize("result", RemountResult)
def test_what_is_packed_is_unpacked(code: MountCode, result: RemountResult) -> None:
    assert unpack_remount(pack_remount(code)) is code
    assert unpack_remount_done(pack_remount_done(code, result)) == (code, result)


@pytest.mark.parametrize("data", [b"", bytes(7), bytes(9)])
def test_a_frame_of_another_length_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="remount frame must have 8 bytes"):
        unpack_remount_done(data)


@pytest.mark.parametrize("data", [b"\x03" + bytes(7), b"\x00\x02" + bytes(6)])
def test_a_code_that_is_none_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="is not a valid"):
        unpack_remount_done(data)


def test_both_identifiers_belong_to_no_device() -> None:
    for can_id in (remounting.REMOUNT_ID, remounting.REMOUNT_DONE_ID):
        assert can_id & EXTENDED
        assert can_id & 0xFF == 0xFE  # the null address of SAE J1939-81
