"""A recording sent by the module: each row once, exactly, flagged, and again after a reset."""

from __future__ import annotations

import numpy as np
import pytest

from devices.replay import ReplaySensors
from protocols import compass, uds

HEAD = "# source: test\n# mag_unit: mG\n# mag_resolution_mg: 0.25\n# accel_resolution_g: 0.001\n"
FIELD = [(100.25, -200.5, 300.0), (0.0, 0.25, -0.25), (-799.75, 5.0, 1.0)]
FORCE = [(0.001, -0.5, -0.866), (0.0, 0.0, -1.0), (1.0, 0.002, 0.0)]


def recording(tmp_path, *, force=True, head=HEAD):
    columns = ["t_s", "mx", "my", "mz", *(["ax", "ay", "az"] if force else [])]
    lines = [",".join(columns)]
    for index, field in enumerate(FIELD):
        values = [0.1 * index, *field, *(FORCE[index] if force else ())]
        lines.append(",".join(map(str, values)))
    path = tmp_path / "recording.csv"
    path.write_text(head + "\n".join(lines) + "\n")
    return path


def received(station, ticks=60):
    """Return rows of (field, force) in physical units from the frames, and the last flags."""
    mag, accel = uds.unpack_scales(station.host_scales)
    frames = station.tick(ticks)
    by_id = {}
    flags = 0
    for frame in frames:
        by_id.setdefault(frame.can_id, []).append(frame.data)
        if frame.can_id == compass.status_id(0x80):
            flags = compass.unpack_status(frame.data).flags
    sets = [compass.unpack_counts(data) for data in by_id.get(compass.mag_set_id(0x80), [])]
    resets = [compass.unpack_counts(data) for data in by_id.get(compass.mag_reset_id(0x80), [])]
    forces = [compass.unpack_counts(data) for data in by_id.get(compass.acceleration_id(0x80), [])]
    field = (np.array(sets) - np.array(resets)) / 2.0 * mag
    return field, np.array(forces) * accel, flags


@pytest.fixture
def replaying(tmp_path, make_station):
    def make(**options):
        path = recording(tmp_path, **options)
        station = make_station(replay=path)
        converters = ReplaySensors(path).converters
        station.host_scales = uds.pack_scales(
            converters.mag_mg_per_count, converters.accel_g_per_count
        )
        return station

    return make


def test_what_is_received_equals_the_file(replaying):
    field, force, _ = received(replaying())

    np.testing.assert_array_equal(field, FIELD)
    np.testing.assert_allclose(force, FORCE, rtol=0.0, atol=1e-15)


def test_the_scales_of_the_recording_are_told_by_diagnostics(replaying):
    station = replaying()
    station.tick(40)

    assert station.request(b"\x22\x01\x04")[3:] == uds.pack_scales(0.25, 0.001)


def test_pairs_are_flagged_as_synthesised_and_the_end_is_told(replaying):
    _, _, flags = received(replaying())

    assert flags & compass.FLAG_SYNTHESISED
    assert flags & compass.FLAG_REPLAY_ENDED
    assert not flags & compass.FLAG_NO_ACCELERATION


def test_the_end_is_not_told_before_the_last_row_was_sent(tmp_path):
    sensors = ReplaySensors(recording(tmp_path))
    told = [(sensors.sample(0.0) is not None, bool(sensors.flags & 0x08)) for _ in range(4)]

    assert told == [(True, False), (True, False), (True, False), (False, True)]


def test_a_reset_of_the_module_begins_the_recording_again(replaying):
    station = replaying()
    station.tick(60)
    assert len(received(station)[0]) == 0
    station.request(b"\x11\x01")

    field, _, _ = received(station)

    np.testing.assert_array_equal(field, FIELD)


def test_a_recording_without_acceleration_says_so_and_still_sends_every_field(replaying):
    field, _, flags = received(replaying(force=False))

    np.testing.assert_array_equal(field, FIELD)
    assert flags & compass.FLAG_NO_ACCELERATION


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("mx,my", "mx,mq", "must have columns mx, my, mz; missing my"),
        ("mx,my", "mx,mx", "column 'mx' of recording recording.csv is named twice"),
        ("300.0", "nan", "mz in line 6 of recording recording.csv must be a number"),
        ("300.0", "", "mz in line 6 of recording recording.csv must be a number"),
        ("300.0", "300.1", "mz in line 6 .* must be a whole number of steps of 0.25"),
        ("300.0", "9e5", "mz in line 6 .* must be within 32767 steps of 0.25"),
        ("mag_unit: mG", "mag_unit: uT", "mag_unit .* must be mG; instead received uT"),
        ("resolution_mg: 0.25", "resolution_mg: 0", "must be a positive number"),
    ],
)
def test_a_recording_that_cannot_be_sent_is_refused_in_one_sentence(tmp_path, old, new, sentence):
    path = recording(tmp_path)
    path.write_text(path.read_text().replace(old, new))

    with pytest.raises(ValueError, match=sentence):
        ReplaySensors(path)


def test_a_byte_order_mark_hides_nothing_of_a_recording(tmp_path):
    path = recording(tmp_path)
    path.write_text(path.read_text(), encoding="utf-8-sig")

    assert ReplaySensors(path).converters.mag_mg_per_count == 0.25


def test_an_empty_recording_has_no_header(tmp_path):
    path = tmp_path / "empty.csv"
    path.write_text(HEAD)

    with pytest.raises(ValueError, match="has no header row"):
        ReplaySensors(path)
