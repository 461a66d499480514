from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.errors import ConfigError
from bench.recording_csv import decimals_of, read_table, write_table
from bench.recordings import Recording, read_recording

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "recording.csv"


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_each_delimiter_is_found_by_itself(file: Path, delimiter: str) -> None:
    file.write_text(f"mx{delimiter}my\n1.5{delimiter}-2\n3{delimiter}4\n")

    table = read_table(file)

    assert table.names == ("mx", "my")
    assert table.numbers(["my", "mx"]).tolist() == [[-2.0, 1.5], [4.0, 3.0]]


def test_preamble_comments_blank_lines_and_byte_order_mark_are_no_rows(file: Path) -> None:
    file.write_text("\ufeff# mag_unit: uT\n# a remark\n\nmx,my,mz\n\n1,2,3\n4,5,6\n")

    table = read_table(file)

    assert table.preamble == {"mag_unit": "uT"}
    assert table.lines == (6, 7)


def test_a_foreign_preamble_is_skipped_by_lines(file: Path) -> None:
    file.write_text("Fs,50.00\nInitialization time,60\nmx,my,mz\n1,2,3\n")

    assert read_table(file, skip_lines=2).names == ("mx", "my", "mz")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "is empty: it holds no line"),
        ("# only: this\n", "is empty: it holds no line"),
        ("mx,my,mz\n", "is empty: it names columns but holds no rows"),
        ("mx,my,mz\n1,2,3\n1,2\n", r":3: a row must hold 3 values \(mx, my, mz\); .* received 2"),
        ("mx,my,mz\n1,2,3,4\n", ":2: a row must hold 3 values"),
        ("1,2,3\n4,5,6\n", ":1: the first line must name the columns; instead received '1'"),
        ("mx,my,mx\n1,2,3\n", ":1: column 'mx' is named twice"),
    ],
)
def test_a_malformed_file_is_refused_in_one_sentence(file: Path, text: str, sentence: str) -> None:
    file.write_text(text)

    with pytest.raises(ConfigError, match=sentence) as caught:
        read_table(file)

    assert "\n" not in str(caught.value)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "", "12.x", "NaN"])
def test_a_value_that_is_no_finite_number_is_named_with_its_line(file: Path, value: str) -> None:
    file.write_text(f"t_s,mx,my,mz\n0,1,2,3\n1,4,{value},6\n")

    with pytest.raises(ConfigError, match=rf":3: my must be a finite number; .* {value!r}"):
        read_recording(file)


def test_a_bad_value_in_a_column_that_is_not_used_does_not_matter(file: Path) -> None:
    file.write_text("mx,my,mz,remark\n1,2,3,nan\n4,5,6,hello\n")

    assert len(read_recording(file)) == 2


def test_a_file_that_is_missing_or_binary_is_refused(file: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read: No such file"):
        read_table(file)
    file.write_bytes(b"\x93NUMPY\xff\xfe")
    with pytest.raises(ConfigError, match="is not a text file"):
        read_table(file)


@pytest.mark.parametrize(
    ("cell", "decimals"), [("0.10", 2), ("-7", 0), ("1.25E-3", 5), ("3e2", -2), (" 4.5 ", 1)]
)
def test_printed_decimals_of_a_number(cell: str, decimals: int) -> None:
    assert decimals_of(cell) == decimals


def test_what_is_written_is_read_back(file: Path, rng: np.random.Generator) -> None:
    values = np.round(rng.normal(0.0, 300.0, (50, 3)), 3)
    columns = {name: (values[:, i], 3) for i, name in enumerate(("mx", "my", "mz"))}

    write_table(file, columns, {"mag_unit": "mG", "source": "a: b"})

    table = read_table(file)
    assert np.array_equal(table.numbers(["mx", "my", "mz"]), values)
    assert table.preamble == {"mag_unit": "mG", "source": "a: b"}


def test_no_minus_zero_is_written(file: Path) -> None:
    write_table(file, {"mx": (np.array([-0.0, 0.0]), 1)}, {})

    assert file.read_text() == "mx\n0.0\n0.0\n"


def test_a_folder_that_does_not_exist_cannot_be_written_to(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be written: No such file"):
        write_table(tmp_path / "none" / "x.csv", {"mx": (np.zeros(2), 1)}, {})


@pytest.mark.parametrize(
    ("unit", "mg"), [("mG", 1.0), ("G", 1000.0), ("uT", 10.0), ("nT", 0.01), ("counts", 1.0)]
)
def test_each_unit_of_the_field_is_brought_to_milligauss(file: Path, unit: str, mg: float) -> None:
    file.write_text("mx,my,mz\n1,2,3\n4,5,6\n")

    recording = read_recording(file, unit=unit)

    assert np.allclose(recording.field_mg, mg * np.array([[1, 2, 3], [4, 5, 6]]), rtol=1e-15)


def test_counts_of_unknown_size_are_said_to_be_so(file: Path) -> None:
    file.write_text("mx,my,mz\n1,2,3\n4,5,6\n")

    assert "unknown" in read_recording(file, unit="counts").metadata["mag_scale"]
    sized = read_recording(file, unit="counts", mg_per_count=0.5)
    assert "mag_scale" not in sized.metadata
    assert sized.field_mg[0].tolist() == [0.5, 1.0, 1.5]


def test_the_preamble_says_the_unit_and_is_not_contradicted(file: Path) -> None:
    file.write_text("# mag_unit: uT\nmx,my,mz\n1,2,3\n4,5,6\n")

    assert read_recording(file).field_mg[0].tolist() == [10.0, 20.0, 30.0]
    with pytest.raises(ConfigError, match="says mag_unit uT; instead received the unit 'G'"):
        read_recording(file, unit="G")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"unit": "tesla"}, "must be one of mG, G, uT, nT, counts; instead received 'tesla'"),
        ({"unit": "counts", "mg_per_count": 0.0}, "must be positive; instead received 0.0"),
        ({"unit": "G", "mg_per_count": 2.0}, "applies to the unit counts"),
        ({"accel_unit": "gal"}, "must be one of g, mg, m/s2, counts; instead received 'gal'"),
    ],
)
def test_a_bad_unit_is_refused(file: Path, arguments: dict[str, object], sentence: str) -> None:
    file.write_text("mx,my,mz\n1,2,3\n4,5,6\n")

    with pytest.raises(ConfigError, match=sentence):
        read_recording(file, **arguments)  # type: ignore[arg-type]


def test_every_column_of_the_format_arrives(file: Path) -> None:
    file.write_text(
        "# rate_hz: 50\n# mag_resolution_mg: 0.5\n# accel_resolution_g: 0.001\n"
        "heading_deg,pitch_deg,roll_deg,mx,my,mz,ax,ay,az,hn,he,hd\n"
        "370,1,2,3,4,5,0,0,-1,250,0,433\n-10,1,2,3,4,5,0,0,-1,250,0,433\n"
    )

    recording = read_recording(file)

    assert recording.heading_deg is not None
    assert recording.heading_deg.tolist() == [10.0, 350.0]
    assert recording.earth_ned_mg is not None
    assert recording.earth_ned_mg[0].tolist() == [250.0, 0.0, 433.0]
    assert recording.t_s.tolist() == [0.0, 0.02]
    assert recording.rate_hz == pytest.approx(50.0)
    assert (recording.mag_resolution_mg, recording.accel_resolution_g) == (0.5, 0.001)


def test_azimuth_stands_for_heading_only_where_there_is_none(file: Path) -> None:
    file.write_text("mx,my,mz,azimuth_deg\n1,2,3,90\n1,2,3,91\n")

    recording = read_recording(file)

    assert recording.heading_deg is not None
    assert recording.heading_deg.tolist() == [90.0, 91.0]
    assert recording.pitch_deg is None
    assert recording.accel_g is None


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("mx,my\n1,2\n3,4\n", "column 'mz' is missing; the columns are mx, my"),
        ("mx,my,mz\n1,2,3\n", "must hold at least 2 rows"),
        ("t_s,mx,my,mz\n1,1,2,3\n0.5,1,2,3\n", ":3: t_s must not decrease; .* 0.5 s after 1.0 s"),
        ("# rate_hz: -3\nmx,my,mz\n1,2,3\n1,2,3\n", "rate_hz of a recording must be a positive"),
    ],
)
def test_an_unusable_recording_is_refused(file: Path, text: str, sentence: str) -> None:
    file.write_text(text)

    with pytest.raises(ConfigError, match=sentence):
        read_recording(file)


def test_a_resolution_that_is_no_number_is_refused(file: Path) -> None:
    file.write_text("# mag_resolution_mg: fine\nmx,my,mz\n1,2,3\n1,2,3\n")

    with pytest.raises(ConfigError, match="mag_resolution_mg .* instead received 'fine'"):
        _ = read_recording(file).mag_resolution_mg


def test_a_recording_keeps_its_own_read_only_copy() -> None:
    field_mg = np.ones((2, 3))
    recording = Recording(t_s=np.array([0.0, 1.0]), field_mg=field_mg)

    field_mg[0, 0] = 7.0

    assert recording.field_mg[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        recording.field_mg[0, 0] = 7.0
