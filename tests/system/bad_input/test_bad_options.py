"""An option that cannot be used: one sentence, exit 2, and no record of a run that never began."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from bench.limit_set import load_limits
from bench.procedure_loader import procedure_path


@pytest.mark.parametrize(
    ("serial", "received"),
    [(None, "received none"), ("", "''"), ("two words", "'two words'"), ("../x", "'../x'")],
)
def test_a_missing_or_unreadable_serial_is_refused(bench_run, serial, received):
    ended = bench_run("set_reset", serial=serial)

    assert ended.code == 2
    assert ended.sentence.startswith("--serial must be")
    assert received in ended.sentence
    assert not ended.recorded


def test_a_serial_is_not_asked_for_where_there_is_no_terminal(tmp_path):
    argv = [sys.executable, "-m", "bench.cli.main", "run", "set_reset", "--out", str(tmp_path)]

    ended = subprocess.run(
        argv, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=30, check=False
    )

    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith("compass-bench: --serial must be the serial number of the unit")
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("eol_three_axes", "unknown procedure 'eol_three_axes'; did you mean 'eol_three_axis'?"),
        ("banana", "unknown procedure 'banana'; known are acceptance_swing, "),
        ("nowhere.yaml", "procedure nowhere.yaml: there is no such file"),
    ],
)
def test_an_unknown_procedure_is_refused_with_a_suggestion(bench_run, command, name, sentence):
    for ended in (bench_run(name), command("plan", name)):
        assert ended.code == 2
        assert ended.sentence.startswith(sentence)
        assert not ended.recorded


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("name: set_reset\n", "name: [set_reset\n", "file is not valid YAML"),
        ("dwell: 2 s", "dwel: 2 s", "unknown key 'dwel'; did you mean 'dwell'?"),
        ("dwell: 2 s", "dwell: 2 deg", "number with its unit (s or ms or min)"),
        ("dwell: 2 s", "dwell: .nan", "number with its unit"),
        ("kind: home", "kind: hom", "unknown kind 'hom'; did you mean 'home'?"),
        ("kind: home\n    name: home", "kind: home", "key 'name' is missing"),
    ],
)
def test_a_wrong_procedure_file_is_refused_with_its_place(bench_run, edited, old, new, sentence):
    path = edited("procedure", old, new)
    line = path.read_text(encoding="utf-8").partition(new)[0].count("\n") + 1

    ended = bench_run(path)

    assert ended.code == 2
    place, _, said = ended.sentence.removeprefix(f"{path}:").partition(": ")
    assert sentence in said
    assert int(place.split(":")[0]) in (line, line + 1)  # YAML sees an open bracket a line late
    assert not ended.recorded


@pytest.mark.parametrize("content", [b"", b"- 1\n- 2\n", b"\xff\xfe\x00\x01", b"\t\x00"])
def test_a_file_that_is_no_procedure_at_all_is_refused(bench_run, tmp_path, content):
    path = tmp_path / "procedure.yaml"
    path.write_bytes(content)

    ended = bench_run(path)

    assert ended.code == 2
    assert ended.sentence.startswith(str(path))


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("high: 0.255 mG", "low: 0.3 mG\n    high: 0.255 mG", "low must lie below high"),
        ("    high: 0.255 mG\n", "", "limits must have low or high"),
        ("high: 0.255 mG", "high: 0.255 deg", "number with its unit"),
        ("high: 0.255 mG", "high: nan mG", "number with its unit"),
        ("high: 0.255 mG", "high: 0", "number with its unit"),
        ("high: 0.255 mG", "high: true", "valid string"),
        ('"noise_{x,y,z}"', '"noise_{x,y}"', "limits set_reset 1.0 lack noise_z"),
        ('"noise_{x,y,z}"', '"noize_{x,y,z}"', "unknown measurement 'noize_x'; did you mean"),
        ("unit: mG\n    high: 0.255 mG\n    uncertainty: 0.02 mG",
         "unit: deg\n    high: 1 deg\n    uncertainty: 0.1 deg", "unit of noise_x must be mG"),
        ("missed: ERROR", "missed: MAYBE", "missed"),
    ],
)  # fmt: skip
def test_missing_or_reversed_limits_are_refused_before_anything_moves(
    bench_run, edited, old, new, sentence
):
    path = edited("limits", old, new)

    ended = bench_run("set_reset", "--limits", path)

    assert ended.code == 2
    assert sentence in ended.sentence
    assert str(path) in ended.sentence
    assert not ended.recorded


def test_a_procedure_that_names_unknown_limits_is_refused(bench_run, edited):
    ended = bench_run(edited("procedure", "limits: set_reset", "limits: set_rest"))

    assert (ended.code, ended.sentence) == (
        2,
        "unknown limits file 'set_rest'; did you mean 'set_reset'?",
    )


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("dip: 60 deg", "dip: 95 deg", "dip must be from -89 deg to 89 deg"),
        ("horizontal: 250 mG", "horizontal: 0 mG", "horizontal must be from 1 mG"),
        ("horizontal: 250 mG\n", "", "key 'horizontal' is missing"),
    ],
)
def test_a_station_that_cannot_be_is_refused(bench_run, edited, old, new, sentence):
    ended = bench_run("set_reset", "--site", edited("station", old, new))

    assert ended.code == 2
    assert sentence in ended.sentence


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (("--interface", "socketcan", "--channel", "vcan99"), ("vcan99", "--interface")),
        (("--interface", "sockcan", "--channel", "x"), ("sockcan does not exist", "socketcan")),
        (("--interface", "virtual", "--channel", "x"), ("reaches other processes", "virtual")),
        (("--channel", "vcan0"), ("--interface must name", "received none")),
        (("--interface", "udp_multicast", "--channel", "nonsense"), ("channel nonsense",)),
        (("--interface", "slcan", "--channel", "/dev/no"), ("channel /dev/no", "--channel")),
    ],
)  # fmt: skip
def test_a_channel_that_does_not_exist_is_refused_with_what_to_do(bench_run, argv, words):
    ended = bench_run("set_reset", *argv)

    assert ended.code == 2
    assert all(word in ended.sentence for word in words), ended.sentence
    assert not ended.recorded


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ("dead_strip_x", "instead received 'dead_strip_x'; did you mean dead_strap_x?"),
        ("", "fault must be a name of the catalogue"),
        ("dead_strap_x=2", "must be within 0 and 1; instead received '2'"),
        ("dead_strap_x=nan", "must be within 0 and 1"),
        ("dead_strap_x@-3", "tick of 'dead_strap_x@-3' must be a whole number"),
    ],
)
def test_a_wrong_fault_is_refused_by_run_and_by_simulate(bench_run, command, fault, sentence):
    channel = ("--interface", "udp_multicast", "--channel", "239.74.163.9")
    for ended in (
        bench_run("set_reset", "--fault", fault),
        command("simulate", *channel, "--fault", fault),
    ):
        assert ended.code == 2
        assert sentence in ended.sentence
        assert not ended.recorded


@pytest.mark.parametrize("name", ["--fault", "--nvm", "--replay"])
def test_what_belongs_to_the_devices_is_refused_on_a_channel(bench_run, name):
    value = {"--fault": "swapped_axes"}.get(name, "some.file")

    ended = bench_run("set_reset", "--interface", "udp_multicast", name, value)

    assert ended.code == 2
    assert ended.sentence.startswith(f"{name} must be given to `compass-bench simulate`")


@pytest.mark.parametrize(
    "argv", [("--seed", "-1"), ("--seed", "x"), ("--bitrate", "5"), ("--banana",)]
)
def test_a_value_out_of_range_is_a_usage_error(bench_run, argv):
    ended = bench_run("set_reset", *argv)

    assert ended.code == 2
    assert argv[0] in ended.err
    assert not ended.recorded


def test_a_memory_file_that_cannot_be_one_is_refused(bench_run, tmp_path):
    for nvm in (tmp_path, tmp_path / "no" / "folder.nvm", Path("/dev/zero")):
        ended = bench_run("set_reset", "--nvm", nvm)

        assert ended.code == 2
        assert (
            ended.sentence
            == f"--nvm must be a file in a folder that exists; instead received {nvm}"
        )


def test_the_files_that_the_tests_edit_are_sound(bench_run):
    path, limits = procedure_path("set_reset"), load_limits("set_reset").path

    ended = bench_run(path, "--limits", limits)

    assert ended.code == 0
    assert ended.record["verdict"]["outcome"] == "PASS"


def test_a_pose_that_cannot_be_reached_is_refused_before_a_record_is_begun(bench_run, edited):
    ended = bench_run(edited("procedure", "pitch: 30 deg", "pitch: 95 deg"), "--limits",
                      load_limits("set_reset").path)  # fmt: skip

    assert ended.code == 2
    assert "pitch must be between -90 and 90 deg; instead received 95 deg" in ended.sentence
    assert not ended.recorded


def test_any_seed_makes_a_unit(bench_run, tmp_path):
    path = tmp_path / "homed.yaml"
    path.write_text(
        'name: homed\nversion: "1.0"\ntitle: t\nlimits: set_reset\nsteps:\n'
        "  - {kind: check_bus, name: bus}\n  - {kind: home, name: home}\n"
    )

    assert bench_run(path, "--seed", 10**22).code == 0
