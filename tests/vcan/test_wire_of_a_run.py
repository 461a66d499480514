"""What other people's tools read in the frames of a real run, by the commands of the how-to page.

The page docs/how-to/read-the-bus.md is the source of every command here.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.sample_file import read_samples
from bench.samples import COMPLETE
from protocols import compass, j1939, uds
from protocols.canopen import AXIS_NODES, BENCH_NODE

if TYPE_CHECKING:
    import socket
    from collections.abc import Callable
    from contextlib import AbstractContextManager

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "how-to" / "read-the-bus.md"
PROBE_SYNCS = 1  # the bench's first SYNC finds out whether a simulator keeps its time

pytestmark = [
    pytest.mark.vcan,
    pytest.mark.timeout(120),
    pytest.mark.skipif(shutil.which("candump") is None, reason="can-utils are not installed"),
    pytest.mark.filterwarnings("ignore:.*use of fork.*:DeprecationWarning"),
]
needs_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="no tshark here")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)


def command(*words: str) -> str:
    """Return the one command of the page that contains all words."""
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    found = [line for line in lines if all(word in line for word in words)]
    assert len(found) == 1, (words, found)
    return found[0]


def dissected(log: Path, *words: str) -> list[list[str]]:
    """Return the fields that a tshark command of the page prints for a log."""
    argv = shlex.split(command("tshark", *words))
    argv = [str(log) if word in ("bus.log", "uds.pcapng") else word for word in argv]
    done = subprocess.run(argv, capture_output=True, text=True, check=True)
    return [line.split("\t") for line in done.stdout.splitlines()]


def decoded(lines: list[str], *words: str) -> list[str]:
    """Return what the page's cantools command makes of lines of a log."""
    argv = shlex.split(command("cantools", *words).partition("| ")[2])
    argv[0:1] = [sys.executable, "-m", "cantools"]
    done = subprocess.run(
        argv, input="".join(lines), capture_output=True, text=True, check=True, cwd=ROOT
    )
    return [line.partition(" :: ")[2] for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def log(recorded_run: Any) -> Path:
    return recorded_run.log


@pytest.fixture(scope="module")
def diagnostics(log: Path) -> Path:
    """Return the diagnostic frames of the run, cut out by the page's command."""
    cut_out = log.with_name("uds.pcapng")
    argv = shlex.split(command("tshark", "-w uds.pcapng"))
    files = {"bus.log": str(log), "uds.pcapng": str(cut_out)}
    subprocess.run([files.get(word, word) for word in argv], check=True, capture_output=True)
    return cut_out


@pytest.fixture(scope="module")
def ticks(log: Path) -> dict[int, list[str]]:
    """Return the lines of the log by the bench's tick in which they were sent."""
    found: dict[int, list[str]] = {}
    tick = -PROBE_SYNCS
    for line in log.read_text().splitlines(keepends=True):
        tick += " 080#" in line
        found.setdefault(tick, []).append(line)
    return found


def test_candump_heard_every_frame_that_the_bench_recorded(recorded_run: Any) -> None:
    heard = len(recorded_run.log.read_text().splitlines())

    # the probe's tick, and the drives' boot-up frames before it, are not the run's
    assert 0 <= heard - recorded_run.done.record["bus"]["frames"] <= 20


def test_cantools_decodes_the_readings_as_they_stand_in_the_samples(
    recorded_run: Any, ticks: dict[int, list[str]]
) -> None:
    samples = read_samples(recorded_run.done.folder / "samples.parquet")
    whole = samples[(samples["complete"] == COMPLETE) & np.isfinite(samples["heading_deg"])]
    chosen = whole[:: len(whole) // 40]
    shown = iter(decoded([line for row in chosen for line in ticks[int(row["tick"])]], "-m 0x1ff"))
    assert len(chosen) >= 40
    for sample in chosen:
        of_tick = "\n".join(itertools.islice(shown, len(ticks[int(sample["tick"])])))
        for name, field in (
            ("MagSet", "set_mg"),
            ("MagReset", "reset_mg"),
            ("Acceleration", "accel_g"),
        ):
            text = re.search(rf"^{name}\((.*)\)$", of_tick, re.MULTILINE).group(1)
            values = [float(re.search(rf"\b{axis}: (\S+)", text).group(1)) for axis in "XYZ"]
            assert values == pytest.approx(sample[field].tolist(), abs=1e-9)
        heading = float(re.search(r"Heading: (\S+) deg", of_tick).group(1))
        assert heading == pytest.approx(float(sample["heading_deg"]), abs=1e-9)


def test_cantools_knows_every_frame_of_the_run(ticks: dict[int, list[str]]) -> None:
    kinds: dict[str, str] = {}
    for lines in ticks.values():
        for line in lines:
            kinds.setdefault(line.split()[2].partition("#")[0], line)

    shown = decoded(list(kinds.values()), "-s protocols")

    assert not [line for line in shown if "Unknown" in line or "Wrong" in line]
    names = {line.partition("(")[0] for line in shown}
    assert {"Sync", "TickDone", "MagSet", "Heading", "UdsRequest", "HeartbeatBench"} <= names
    assert {"Tpdo1Azimuth", "Rpdo1Azimuth", "Tpdo1Pitch", "Tpdo1Roll"} <= names


@needs_tshark
def test_tshark_reads_the_rig_of_the_run_as_canopen(log: Path, ticks: dict[int, Any]) -> None:
    rows = dissected(log, "can.flags.xtd == 0")
    told = [(int(row[0], 0), row[1].strip()) for row in rows]

    syncs = [words for can_id, words in told if can_id == 0x080]
    assert len(syncs) == max(ticks) + PROBE_SYNCS
    assert syncs[PROBE_SYNCS : PROBE_SYNCS + 3] == ["SYNC [1]", "SYNC [2]", "SYNC [3]"]
    for node in AXIS_NODES:
        assert (0x180 + node, "PDO1 (tx)") in told
        assert (0x200 + node, "PDO1 (rx)") in told
        assert (0x600 + node, "Default-SDO (rx): Initiate download request") in told
        assert (0x580 + node, "Default-SDO (tx): Initiate download response") in told
        assert (0x700 + node, f"NMT Error Control: Operational [0x{node:x}]") in told
    assert (0x700 + BENCH_NODE, f"NMT Error Control: Operational [0x{BENCH_NODE:x}]") in told
    assert not [words for _, words in told if "Abort" in words or "Malformed" in words]


@needs_tshark
def test_tshark_shows_who_watches_the_benchs_heartbeat_and_no_emergency(log: Path) -> None:
    watched = dissected(log, "canopen.sdo.main_idx == 0x1016")

    assert {int(row[0], 0) for row in watched} >= {0x600 + node for node in AXIS_NODES}
    assert dissected(log, "canopen.em.err_code") == []


@needs_tshark
def test_tshark_reassembles_the_coefficients_that_the_run_wrote(
    diagnostics: Path, recorded_run: Any
) -> None:
    rows = dissected(diagnostics, "uds.wdbi.data_identifier == 0x0101")
    requests = [row for row in rows if row[2] == "0x00"]
    written = uds.unpack_coefficients(bytes.fromhex(requests[0][3]))
    recorded = recorded_run.done.record["coefficients"]["written"]

    assert [(int(row[0], 0), row[1]) for row in rows[:2]] == [
        (0x18DA80F1, "0x2e"),
        (0x18DAF180, "0x2e"),
    ]
    assert list(written.mag_offset_mg) == pytest.approx(recorded["mag_offset_mg"])
    assert np.ravel(written.mag_matrix) == pytest.approx(np.ravel(recorded["mag_matrix"]))


@needs_tshark
def test_tshark_reads_every_service_and_no_negative_response(diagnostics: Path) -> None:
    rows = dissected(diagnostics, '-Y "uds" -T')

    services = {int(row[1], 0) for row in rows if row[1]}
    assert {0x10, 0x11, 0x22, 0x27, 0x2E, 0x31} <= services
    assert dissected(diagnostics, "uds.err.code") == []


@needs_tshark
def test_tshark_reads_the_module_of_the_run_as_j1939(log: Path, recorded_run: Any) -> None:
    rows = dissected(log, "can.flags.xtd == 1")
    seen = [int(row[0]) for row in rows if int(row[1]) == j1939.MODULE_ADDRESS]

    cycles = recorded_run.done.record["run"]["ticks"]
    for pgn in (compass.PGN_MAG_SET, compass.PGN_MAG_RESET, compass.PGN_HEADING):
        assert 0.9 * cycles < seen.count(pgn) <= cycles + PROBE_SYNCS
    assert seen.count(j1939.PGN_ADDRESS_CLAIMED) >= 1
    heading = dissected(log, "j1939.pgn == 65256")
    assert len(heading) == pytest.approx(cycles / 10, rel=0.1)
    assert {tuple(map(int, row)) for row in heading} == {(j1939.MODULE_ADDRESS, 8)}


def until_it_speaks(node: socket.socket) -> None:
    """Wait until the module has started: it sends its heading."""
    while int.from_bytes(node.recv(16)[:4], sys.byteorder) != compass.heading_id(0x80):
        pass


def test_udsoncans_own_client_reads_the_serial_of_a_free_running_module(
    station: Callable[..., AbstractContextManager[int]],
    node: socket.socket,
) -> None:
    simulate = command("compass-bench simulate")
    assert "--free-running" in simulate
    (program,) = blocks("python")
    said = io.StringIO()

    with station(free_running=True), contextlib.redirect_stdout(said):
        until_it_speaks(node)
        exec(compile(program, str(PAGE), "exec"), {})  # noqa: S102

    assert said.getvalue() == "SN0001\n"
