"""One seed gives one run: in one process, again, and across two processes on the loopback."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

COMMAND = (sys.executable, "-m", "bench.cli.main")
RUN = ("run", "eol_three_axis", "--serial", "SN0001", "--no-dashboard", "--no-input")
OF_THE_BUS = {"interface", "channel"}
OF_THE_SIMULATOR = {"id", "seed"}  # a bench on a channel does not know the seed


def started(*argv, hash_seed):
    """Start the command line; text hashes in another way in every one of them."""
    environment = {**os.environ, "PYTHONHASHSEED": str(hash_seed)}
    return subprocess.Popen(
        [*COMMAND, *map(str, argv)],
        env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def finished(process, timeout_s=110.0):
    _, words = process.communicate(timeout=timeout_s)
    assert process.returncode == 0, words
    return words


@pytest.fixture(scope="module")
def folders(tmp_path_factory, new_group):
    """Return the folders of three runs of one seed: "one", "again", "two"."""
    out = tmp_path_factory.mktemp("runs")
    bus = ("--interface", "udp_multicast", "--channel", new_group())
    simulator = started("simulate", "--serial", "SN0001", *bus, hash_seed=4)
    try:
        while "in lock-step" not in simulator.stderr.readline():
            assert simulator.poll() is None
        two = started(*RUN, "--out", out / "two", *bus, hash_seed=3)
        for hash_seed, name in enumerate(("one", "again"), start=1):
            finished(started(*RUN, "--out", out / name, hash_seed=hash_seed))
        finished(two)
    finally:
        simulator.terminate()
        simulator.communicate(timeout=10)
    assert simulator.returncode == 0
    return {name: Path(os.path.realpath(out / name / "latest")) for name in ("one", "again", "two")}


def frames_digest(folder):
    """Return the hash of every frame with its time and direction; the file holds no date."""
    return hashlib.sha256((folder / "bus.blf").read_bytes()).hexdigest()


def document(folder, *left_out):
    """Return the record without what the wall clock or the bus has given it."""

    def kept(value):
        if isinstance(value, dict):
            return {
                key: kept(each)
                for key, each in value.items()
                if not (key.endswith("_utc") or key.startswith("wall_") or key in left_out)
            }
        return [kept(each) for each in value] if isinstance(value, list) else value

    return kept(json.loads((folder / "record.json").read_text()))


@pytest.mark.timeout(120)
@pytest.mark.parametrize("other", ["again", "two"])
def test_one_seed_gives_the_same_samples(folders, other):
    ones, others = (pq.read_table(folders[name] / "samples.parquet") for name in ("one", other))

    assert ones.num_rows > 30_000
    assert ones.equals(others)


@pytest.mark.timeout(120)
@pytest.mark.parametrize("other", ["again", "two"])
def test_one_seed_gives_the_same_frames_at_the_same_times(folders, other):
    assert frames_digest(folders["one"]) == frames_digest(folders[other])


@pytest.mark.timeout(120)
def test_one_seed_gives_the_same_record_again(folders):
    assert document(folders["one"]) == document(folders["again"])


@pytest.mark.timeout(120)
def test_the_record_across_processes_differs_by_the_names_of_the_bus_only(folders):
    one, two = (json.loads((folders[name] / "record.json").read_text()) for name in ("one", "two"))

    left_out = OF_THE_BUS | OF_THE_SIMULATOR
    assert document(folders["one"], *left_out) == document(folders["two"], *left_out)
    assert (one["bus"]["mode"], two["bus"]["mode"]) == ("lockstep", "lockstep")
    assert (one["bus"]["interface"], two["bus"]["interface"]) == ("lockstep", "udp_multicast")


@pytest.mark.timeout(120)
def test_the_runs_pass_with_no_frame_lost(folders):
    for folder in folders.values():
        record = json.loads((folder / "record.json").read_text())

        assert record["verdict"]["outcome"] == "PASS"
        assert record["bus"]["lost"] == 0
        assert record["bus"]["frames"] > 300_000
