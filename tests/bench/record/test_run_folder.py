"""The folder's names."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest

from bench.errors import BenchNotReady
from bench.record.run_folder import RunFolder

STARTED = datetime(2026, 11, 22, 10, 15, 0, tzinfo=UTC)


def test_runs_of_one_second_get_numbers(tmp_path):
    first = RunFolder(tmp_path, "SN1", "eol", STARTED)
    second = RunFolder(tmp_path, "SN1", "eol", STARTED)
    done = first.complete()
    third = RunFolder(tmp_path, "SN1", "eol", STARTED)

    assert done.name == "101500-eol"
    assert second.path.name == "101500-eol-2.part"
    assert third.path.name == "101500-eol-3.part"


@pytest.mark.parametrize(
    ("serial", "part"),
    [("../../etc", "_.._etc"), ("A B/C", "A_B_C"), ("..", "_"), ("SN-1.2", "SN-1.2")],
)
def test_a_serial_cannot_leave_the_output_folder(tmp_path, serial, part):
    folder = RunFolder(tmp_path, serial, "eol", STARTED)

    assert folder.path.parent == tmp_path / "2026-11-22" / part


def test_latest_is_relative_and_follows_the_newest(tmp_path):
    RunFolder(tmp_path, "SN1", "eol", STARTED).complete()
    newest = RunFolder(tmp_path, "SN2", "eol", STARTED).complete()

    link = tmp_path / "latest"
    assert not link.readlink().is_absolute()
    assert link.resolve() == newest
    tmp_path.rename(tmp_path.with_name("moved"))
    assert (tmp_path.with_name("moved") / "latest" / "config").is_dir()


def test_a_latest_that_is_a_folder_does_not_cost_the_record(tmp_path):
    (tmp_path / "latest" / "x").mkdir(parents=True)

    assert RunFolder(tmp_path, "SN1", "eol", STARTED).complete().is_dir()
    assert (tmp_path / "latest" / "x").is_dir()


def test_a_folder_that_vanished_is_one_sentence(tmp_path):
    folder = RunFolder(tmp_path, "SN1", "eol", STARTED)
    (folder.path / "config").rmdir()
    folder.path.rmdir()

    with pytest.raises(BenchNotReady, match="could not be renamed"):
        folder.complete()
