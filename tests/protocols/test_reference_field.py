"""The reference magnetometer's frame: scale, protection, and other people's reading of it."""

from __future__ import annotations

import cantools
import pytest

from protocols.compass import data_id, group_of, unpack_counts
from protocols.database import DBC_PATH
from protocols.e2e import E2eReceiver, E2eSender, E2eState
from protocols.frame import EXTENDED
from protocols.reference_field import (
    REFERENCE_ADDRESS,
    REFERENCE_COUNT_LIMIT,
    REFERENCE_MG_PER_COUNT,
    pack_reference_field,
    reference_field_id,
    reference_frames,
)

FIELD_ID = reference_field_id(REFERENCE_ADDRESS)


@pytest.mark.parametrize("field_mg", [(250.0, 0.0, 433.0), (-0.05, 0.05, -1600.0)])
def test_a_field_comes_back_to_half_a_count(field_mg: tuple[float, float, float]) -> None:
    data = pack_reference_field(E2eSender(data_id(FIELD_ID)), 7, field_mg)

    assert group_of(data) == 7
    read_mg = [count * REFERENCE_MG_PER_COUNT for count in unpack_counts(data)]
    assert read_mg == pytest.approx(field_mg, abs=REFERENCE_MG_PER_COUNT / 2)


def test_a_field_beyond_the_scale_is_held_at_its_end() -> None:
    data = pack_reference_field(E2eSender(data_id(FIELD_ID)), 0, (1e5, -1e5, 0.0))

    assert unpack_counts(data) == (REFERENCE_COUNT_LIMIT, -REFERENCE_COUNT_LIMIT, 0)


def test_its_protection_is_of_its_own_identifier() -> None:
    data = pack_reference_field(E2eSender(data_id(FIELD_ID)), 0, (1.0, 2.0, 3.0))

    assert E2eReceiver(data_id(FIELD_ID)).check(data) is E2eState.OK
    assert E2eReceiver(data_id(reference_field_id(0x91))).check(data) is E2eState.ERROR


def test_cantools_reads_it_in_milligauss() -> None:
    message = cantools.database.load_file(DBC_PATH).get_message_by_name("RefField")
    data = pack_reference_field(E2eSender(data_id(FIELD_ID)), 3, (250.05, -1.0, 433.0))

    decoded = message.decode(data)

    assert message.frame_id | EXTENDED == FIELD_ID
    assert decoded["Group"] == 3
    assert (decoded["X"], decoded["Y"], decoded["Z"]) == pytest.approx((250.05, -1.0, 433.0))


def test_another_address_moves_every_frame() -> None:
    assert {layout.name for layout in reference_frames()} == {
        "RefField", "RefAddressClaimed", "RefRequest",
    }  # fmt: skip
    here, there = ({f.can_id for f in reference_frames(address)} for address in (0x90, 0x91))
    assert not here & there
