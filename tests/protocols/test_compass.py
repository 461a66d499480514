"""The module's frames: the precompiled structs against cantools reading the DBC."""

from __future__ import annotations

import math

import cantools
import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols import compass
from protocols.database import DBC_PATH
from protocols.e2e import E2eSender

DATABASE = cantools.database.load_file(DBC_PATH)
SOURCE = 0x80

int16 = st.integers(-(2**15), 2**15 - 1)
groups = st.integers(0, 15)


def decoded(name: str, data: bytes) -> dict[str, float]:
    """Return raw values by signal, as cantools reads them."""
    message = DATABASE.get_message_by_name(name)
    return dict(message.decode(data, decode_choices=False, scaling=False))


def physical(name: str, data: bytes) -> dict[str, float]:
    return dict(DATABASE.get_message_by_name(name).decode(data, decode_choices=False))


@pytest.mark.parametrize(
    ("name", "identifier"),
    [
        ("MagSet", compass.mag_set_id),
        ("MagReset", compass.mag_reset_id),
        ("Acceleration", compass.acceleration_id),
        ("Heading", compass.heading_id),
        ("Status", compass.status_id),
        ("VehicleDirectionSpeed", compass.vehicle_direction_id),
    ],
)
def test_identifiers_are_those_of_the_database(name: str, identifier) -> None:  # type: ignore[no-untyped-def]
    message = DATABASE.get_message_by_name(name)

    assert message.is_extended_frame
    assert identifier(SOURCE) & 0x1FFFFFFF == message.frame_id
    assert identifier(0x8F) - identifier(SOURCE) == 0x0F


@given(groups, int16, int16, int16)
@pytest.mark.parametrize("name", ["MagSet", "MagReset", "Acceleration"])
def test_readings_are_read_alike_by_cantools(name: str, group: int, x: int, y: int, z: int) -> None:
    sender = E2eSender(compass.data_id(compass.mag_set_id(SOURCE)))
    data = compass.pack_counts(sender, group, x, y, z)

    raw = decoded(name, data)

    assert (raw["X"], raw["Y"], raw["Z"], raw["Group"], raw["E2eCounter"]) == (x, y, z, group, 0)
    assert compass.unpack_counts(data) == (x, y, z)
    assert compass.group_of(data) == group


@pytest.mark.parametrize("count", [-(2**15), -1, 0, 1, compass.MAG_COUNT_LIMIT, 2**15 - 1])
def test_what_cantools_encodes_we_read(count: int) -> None:
    data = DATABASE.encode_message(
        "MagReset",
        {"E2eCrc": 0, "E2eCounter": 14, "Group": 15, "X": count, "Y": -count - 1, "Z": 0},
        scaling=False,
    )

    assert compass.unpack_counts(data) == (count, -count - 1, 0)
    assert compass.group_of(data) == 15


@given(
    groups,
    st.floats(0.0, 360.0, exclude_max=True),
    st.floats(-90.0, 90.0),
    st.floats(-180.0, 180.0),
    st.integers(0, 15),
)
def test_heading_is_read_alike_by_cantools_within_half_a_count(
    group: int, heading_deg: float, pitch_deg: float, roll_deg: float, quality: int
) -> None:
    data = compass.pack_heading(E2eSender(1), group, heading_deg, pitch_deg, roll_deg, quality)
    raw = decoded("Heading", data)
    values = physical("Heading", data)

    assert compass.unpack_heading(data) == (raw["Heading"], raw["Pitch"], raw["Roll"], quality)
    assert raw["Quality"] == quality
    assert abs(math.remainder(values["Heading"] - heading_deg, 360.0)) <= 360.0 / 131072 + 1e-9
    assert abs(values["Pitch"] - pitch_deg) <= 0.0125 / 2 + 1e-9
    assert abs(values["Roll"] - roll_deg) <= 0.025 / 2 + 1e-9


@pytest.mark.parametrize(
    ("heading_deg", "counts"),
    [(0.0, 0), (359.998, 0), (359.99, 65534), (180.0, 32768), (-90.0, 49152)],
)
def test_heading_wraps_in_counts(heading_deg: float, counts: int) -> None:
    data = compass.pack_heading(E2eSender(1), 0, heading_deg, 0.0, 0.0, 0)

    assert compass.unpack_heading(data).heading == counts


@pytest.mark.parametrize(("pitch", "roll"), [(-8192, 8191), (8191, -8192), (-1, -1), (0, 1)])
def test_tilt_counts_keep_their_sign_at_the_ends(pitch: int, roll: int) -> None:
    data = DATABASE.encode_message(
        "Heading",
        {
            **dict.fromkeys(("E2eCrc", "E2eCounter", "Group"), 0),
            "Heading": 65535,
            "Pitch": pitch,
            "Roll": roll,
            "Quality": 15,
        },
        scaling=False,
    )

    assert compass.unpack_heading(data) == (65535, pitch, roll, 15)


@given(st.floats(-300.0, 300.0), st.floats(0.0, 65.0), st.integers(0, 63), st.integers(0, 300))
def test_status_is_read_alike_by_cantools(
    temperature_c: float, supply_v: float, flags: int, boots: int
) -> None:
    data = compass.pack_status(compass.Status(temperature_c, supply_v, flags, boots, 7))
    values = physical("Status", data)
    status = compass.unpack_status(data)

    assert status.temperature_c == pytest.approx(values["Temperature"], abs=1e-9)
    assert status.temperature_c == pytest.approx(temperature_c, abs=0.005 + 1e-9)
    assert status.supply_v == pytest.approx(values["Supply"], abs=1e-9)
    assert (status.flags, status.boots, status.dtc_count) == (flags, boots & 0xFF, 7)
    assert values["Boots"] == boots & 0xFF
    assert bool(values["Synthesised"]) == bool(flags & compass.FLAG_SYNTHESISED)
    assert bool(values["NoAcceleration"]) == bool(flags & compass.FLAG_NO_ACCELERATION)


@pytest.mark.parametrize(
    ("flag", "signal"),
    [
        (compass.FLAG_SYNTHESISED, "Synthesised"),
        (compass.FLAG_SATURATED, "Saturated"),
        (compass.FLAG_DEFAULT_COEFFICIENTS, "DefaultCoefficients"),
        (compass.FLAG_REPLAY_ENDED, "ReplayEnded"),
        (compass.FLAG_NO_ACCELERATION, "NoAcceleration"),
        (compass.FLAG_TWO_AXIS, "TwoAxis"),
    ],
)
def test_each_flag_is_one_signal(flag: int, signal: str) -> None:
    raw = decoded("Status", compass.pack_status(compass.Status(20.0, 5.0, flag, 0, 0)))

    bits = [one.name for one in DATABASE.get_message_by_name("Status").signals if one.length == 1]
    assert [name for name in bits if raw[name]] == [signal]


@given(st.floats(0.0, 360.0, exclude_max=True), st.floats(-90.0, 90.0))
def test_vehicle_direction_is_read_alike_by_cantools(heading_deg: float, pitch_deg: float) -> None:
    values = physical(
        "VehicleDirectionSpeed", compass.pack_vehicle_direction(heading_deg, pitch_deg)
    )

    assert 0.0 <= values["CompassBearing"] < 360.0
    assert abs(math.remainder(values["CompassBearing"] - heading_deg, 360.0)) <= 1 / 256 + 1e-9
    assert abs(values["Pitch"] - pitch_deg) <= 1 / 256 + 1e-9


def test_speed_and_altitude_are_said_to_be_not_available() -> None:
    message = DATABASE.get_message_by_name("VehicleDirectionSpeed")

    values = message.decode(compass.pack_vehicle_direction(90.0, 0.0))

    assert str(values["NavigationBasedVehicleSpeed"]) == "not available"
    assert str(values["Altitude"]) == "not available"


def test_the_data_id_tells_frames_and_modules_apart() -> None:
    identifiers = [
        identifier(source)
        for identifier in (
            compass.mag_set_id,
            compass.mag_reset_id,
            compass.acceleration_id,
            compass.heading_id,
        )
        for source in range(0x80, 0x90)
    ]

    assert len({compass.data_id(can_id) for can_id in identifiers}) == len(identifiers)
