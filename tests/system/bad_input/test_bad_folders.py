"""Folders that cannot be written or are no run's, files that are cut off, and a full disk."""

from __future__ import annotations

import json
import resource
import shutil

import pytest

from bench.cli.run_command import RunRequest, run_procedure


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The folder of one good run of this file."""
    out = tmp_path_factory.mktemp("good")
    request = RunRequest(
        procedure="set_reset", serial="SN0001", out=out, no_input=True, dashboard=False, quiet=True
    )
    assert run_procedure(request) == 0
    return (out / "latest").resolve()


@pytest.fixture
def run(finished, tmp_path):
    return shutil.copytree(finished, tmp_path / "run")


@pytest.fixture
def disk_of():
    """Let no file grow beyond a size: the system refuses the write, as a full disk does."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("place", ["file", "/proc/nothing"])
def test_an_output_folder_that_cannot_be_written_is_refused(bench_run, tmp_path, place):
    (tmp_path / "file").write_text("no folder")
    out = tmp_path / place

    ended = bench_run("set_reset", "--out", out)

    assert (ended.code, ended.out) == (2, "")
    assert ended.sentence.startswith(f"output folder {out} must be writable; instead received")
    assert ended.sentence.endswith("choose another with --out")


@pytest.mark.parametrize("size", [20_000, 200_000])
def test_a_disk_that_fills_up_is_an_error_with_a_record_and_a_parked_rig(bench_run, disk_of, size):
    disk_of(size)

    ended = bench_run("set_reset")

    assert ended.code == 4
    record = ended.record
    assert record["verdict"]["outcome"] == "ERROR"
    assert "free the disk" in record["verdict"]["reason"]
    assert record["first_failure"] == "bench_fault"
    (log,) = ended.folder.glob("2*/*/*/events.ndjson")
    events = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    assert [e["action"] for e in events if e["event"] == "teardown"] == ["park the rig"]
    assert not [e for e in events if e["event"] == "teardown_failed"]


def test_a_disk_too_full_for_the_record_leaves_what_there_is(bench_run, disk_of):
    disk_of(5_000)

    ended = bench_run("set_reset")

    assert ended.code == 4
    assert "record.json must be writable" in ended.err
    (part,) = ended.folder.glob("2*/*/*.part")
    assert json.loads((part / "record.json").read_text())["run"]["status"] == "running"


@pytest.mark.parametrize("sub_command", ["judge", "view", "report"])
@pytest.mark.parametrize("kind", ["none", "empty", "file"])
def test_a_folder_that_is_no_run_is_refused(command, tmp_path, sub_command, kind):
    path = tmp_path / kind
    if kind == "empty":
        path.mkdir()
    if kind == "file":
        path.write_text("text")

    ended = command(sub_command, path)

    assert (ended.code, ended.out) == (2, "")
    assert str(path) in ended.sentence


@pytest.mark.parametrize(
    ("old", "new"),
    [('"seed": 1', '"seed": NaN'), ("record/1", "record/9"), ('"seed"', '"sed"'), ("{", "[", )],
)  # fmt: skip
def test_a_record_that_is_none_is_refused(command, run, old, new):
    path = run / "record.json"
    path.write_text(path.read_text().replace(old, new, 1))

    for sub_command in ("judge", "view", "report"):
        ended = command(sub_command, run)

        assert ended.code == 2
        assert str(path) in ended.sentence


@pytest.mark.parametrize("damage", ["cut", "hole", "empty", "text", "gone"])
def test_samples_that_are_damaged_are_not_judged(command, run, damage):
    path = run / "samples.parquet"
    sound = path.read_bytes()
    path.unlink()
    if damage != "gone":
        path.write_bytes(
            {
                "cut": sound[: len(sound) // 2],
                "hole": sound[:2000] + bytes(2000) + sound[4000:],
                "empty": b"",
                "text": b"t_s,mx,my,mz\n" * 40,
            }[damage]
        )

    ended = command("judge", run)

    assert (ended.code, ended.out) == (2, "")
    assert str(run) in ended.sentence


@pytest.mark.parametrize("content", ["id: x\n", "id: [x\n", ""])
def test_limits_that_cannot_be_used_do_not_judge(command, run, tmp_path, content):
    path = tmp_path / "limits.yaml"
    path.write_text(content)

    ended = command("judge", run, "--limits", path)

    assert (ended.code, ended.out) == (2, "")
    assert ended.sentence.startswith(str(path))


def test_the_run_that_these_tests_damage_is_sound(command, run):
    ended = command("judge", run)

    assert ended.code == 0
    assert "PASS" in ended.out
