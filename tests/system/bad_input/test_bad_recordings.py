"""A recording that cannot be used: one sentence with file and line, exit 2, by every way in."""

from __future__ import annotations

import numpy as np
import pytest

PREAMBLE = "# mag_unit: mG\n# mag_resolution_mg: 0.1\n# rate_hz: 100\n"
HEADER = "t_s,mx,my,mz\n"


@pytest.fixture
def recording(tmp_path):
    """Return what writes a sound recording of a sphere, edited at a line."""
    directions = np.random.default_rng(3).standard_normal((200, 3))
    field_mg = 480.0 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    rows = [f"{i * 0.01:.2f},{x:.1f},{y:.1f},{z:.1f}" for i, (x, y, z) in enumerate(field_mg)]

    def write(header=HEADER, row=None, rows=rows):
        path = tmp_path / "recording.csv"
        lines = list(rows) if row is None else [*rows[:10], row, *rows[11:]]
        path.write_text(PREAMBLE + header + "\n".join(lines) + "\n", encoding="utf-8")
        return path

    return write


@pytest.fixture(params=["replay", "fit", "import"])
def used(request, bench_run, command, tmp_path):
    """Return what takes a recording in: over the bus, by `fit`, by `import`."""
    return {
        "replay": lambda path: bench_run("recording", "--replay", path),
        "fit": lambda path: command("fit", path, "--method", "ellipsoid", "--json"),
        "import": lambda path: command("import", path, tmp_path / "imported.csv"),
    }[request.param]


def test_a_sound_recording_is_taken(used, recording):
    assert used(recording()).code == 0


@pytest.mark.parametrize("header", ["t_s,mx,my,b\n", "t_s,mx,mx,mz\n", "t_s,x,y,z\n"])
def test_a_missing_column_is_named(used, recording, header):
    ended = used(recording(header))

    assert (ended.code, ended.out) == (2, "")
    assert "recording.csv" in ended.sentence
    assert any(word in ended.sentence for word in ("missing", "named twice"))
    assert not ended.recorded


@pytest.mark.parametrize("used", ["replay", "fit"], indirect=True)
def test_an_accelerometer_of_one_axis_is_refused(used, recording):
    path = recording("t_s,mx,my,mz,ax\n", rows=["0,1,2,3,0.1"] * 40)

    ended = used(path)

    assert ended.code == 2
    assert "missing" in ended.sentence
    assert "ay" in ended.sentence


@pytest.mark.parametrize(
    ("row", "received"),
    [
        ("0.10,nan,1,2", "nan"),
        ("0.10,inf,1,2", "inf"),
        ("0.10,,1,2", "''"),
        ("0.10,ten,1,2", "ten"),
        ("0.10,1e300,1,2", "1e300"),
        ("0.10,1,2", "3"),
        ("0.10,1,2,3,4", "5"),
    ],
)
def test_a_wrong_row_is_named_by_its_line(used, recording, row, received):
    ended = used(recording(row=row))

    assert (ended.code, ended.out) == (2, "")
    assert "15" in ended.sentence.replace("recording.csv:15", "15")
    assert received in ended.sentence
    assert not ended.recorded


@pytest.mark.parametrize("content", [b"", b"t_s,mx,my,mz\n", bytes(range(256)) * 4])
def test_a_file_without_rows_or_text_is_refused(used, tmp_path, content):
    path = tmp_path / "recording.csv"
    path.write_bytes(content)

    ended = used(path)

    assert (ended.code, ended.out) == (2, "")
    assert "recording.csv" in ended.sentence
    assert not ended.recorded


def test_a_file_that_is_not_there_is_refused(used, tmp_path):
    for path in (tmp_path / "none.csv", tmp_path):
        ended = used(path)

        assert (ended.code, ended.out) == (2, "")
        assert str(path) in ended.sentence


def test_a_recording_of_a_still_module_is_a_failure_with_a_record(bench_run, recording):
    ended = bench_run("recording", "--replay", recording(rows=["0,200,50,400"] * 200))

    assert ended.code == 1
    assert ended.record["first_failure"] == "fit_accepted"


@pytest.mark.parametrize(
    ("argv", "sentence"),
    [
        (("--method", "magic"), "method must be one of"),
        (("--holdout", "some"), "holdout must be one of"),
        (("--order", "sideways"), "order must be one of"),
        (("--unit", "parsec"), "parsec"),
        (("--declination", "nan"), "--declination must be from -180 to 180 deg"),
    ],
)
def test_an_option_of_fit_that_cannot_be_used_is_refused(command, recording, argv, sentence):
    ended = command("fit", recording(), *argv)

    assert ended.code == 2
    assert sentence in ended.sentence


def test_an_import_that_cannot_be_written_is_refused(command, recording, tmp_path):
    ended = command("import", recording(), tmp_path / "no" / "folder.csv")

    assert ended.code == 2
    assert "cannot be written" in ended.sentence
