"""A module process killed by SIGKILL after any frame of the coefficient write.

GIVEN a virtual station on the loopback that keeps its coefficients in a file, WHEN it is
killed after the n-th frame between the bench and its diagnostics, THEN the bench says that
the simulator is gone, and a station started on the same file has the old coefficients or the
new, bit by bit.
"""

from __future__ import annotations

import dataclasses
import json
import signal
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from bench import bus as bench_bus
from bench.bus import BenchBus, detect_mode
from bench.errors import BusFault
from bench.module import Module
from devices.coefficient_store import CoefficientStore
from devices.simulator import SimulatorOptions, build_host
from protocols.clock import SimulatedClock
from protocols.link import Wire
from protocols.pycan_link import PyCanLink
from protocols.uds import (
    DEFAULT_COEFFICIENTS,
    pack_coefficients,
    physical_request_id,
    physical_response_id,
)

NEW = dataclasses.replace(
    DEFAULT_COEFFICIENTS,
    version=7,
    mag_offset_mg=(11.0, -12.0, 13.0),
    mag_matrix=(1.5, 0.25, 0.125, -0.25, 1.5, 0.5, 0.75, -0.5, 1.25),
    accel_offset_g=(0.5, -0.25, 0.125),
    accel_matrix=(1.25, 0.5, 0.25, 0.125, 1.5, -0.25, 0.5, 0.75, 1.75),
)
REQUEST, RESPONSE = physical_request_id(0x80), physical_response_id(0x80)
AT_A_TIME = 6
COMMIT = "0431010202"


@pytest.fixture(autouse=True)
def _short_deadline(monkeypatch):
    monkeypatch.setattr(bench_bus, "SIMULATOR_DEADLINE_S", 0.8)


class Station:
    """A bench's client of a station that runs in a process of its own."""

    def __init__(self, forge, options, nvm, trips=()):
        self.process = forge.start("simulate", *options, "--nvm", nvm, trips=trips)
        self.process.until_it_says("in lock-step")
        self.link = PyCanLink(options[1], options[3])
        detect_mode(self.link, SimulatedClock())
        self.link.clock = clock = SimulatedClock()
        self.bus = BenchBus(self.link, clock)
        self.module = Module(self.bus)

    def __enter__(self):
        self.module.wait_ready()
        return self

    def __exit__(self, *_):
        self.link.close()
        self.process.end()


def frames_of_the_write(forge, options, nvm):
    """Write undisturbed; return the identifiers and bytes of all ISO-TP frames in order."""
    frames = []
    with Station(forge, options, nvm) as station:

        def note(block):
            spoken = block[np.isin(block["can_id"], (REQUEST, RESPONSE))]
            frames.extend((int(frame["can_id"]), frame["data"].tobytes()) for frame in spoken)

        station.bus.add_sink(note)
        station.module.diagnostics.write_coefficients(NEW)
        station.bus.flush()
    return frames


def stored(nvm):
    store = CoefficientStore(nvm)
    store.boot()
    return store.active


@pytest.mark.timeout(100)
def test_a_module_killed_after_any_frame_has_the_old_coefficients_or_the_new(
    forge, new_group, tmp_path
):
    bus = ("--interface", "udp_multicast", "--channel")
    frames = frames_of_the_write(forge, (*bus, new_group()), tmp_path / "whole.nvm")
    assert stored(tmp_path / "whole.nvm") == NEW
    requests = [data for can_id, data in frames if can_id == REQUEST]
    commit = 1 + next(n for n, data in enumerate(requests) if data.hex().startswith(COMMIT))

    def killed(way_and_number):
        way, number = way_and_number
        can_id = REQUEST if way == "in" else RESPONSE
        trip = {"way": way, "id": can_id, "count": number, "signal": signal.SIGKILL}
        nvm = tmp_path / f"{way}-{number}.nvm"
        return way_and_number, killed_after(forge, (*bus, new_group()), nvm, trip)

    ways = [("in", n + 1) for n in range(len(requests))]
    ways += [("out", n + 1) for n in range(len(frames) - len(requests))]
    with ThreadPoolExecutor(AT_A_TIME) as pool:  # most of the time they wait for the dead
        after = list(pool.map(killed, ways))

    assert len(after) == len(frames) > 40
    old, new = DEFAULT_COEFFICIENTS, NEW
    for (way, number), found in after:
        assert found in (old, new), f"a mixture after frame {number} {way}: {found}"
        if way == "in":
            assert found == (old if number < commit else new), f"after request {number}"


def killed_after(forge, options, nvm, trip):
    """Write until the station is killed, start it again and return what its module uses."""
    with Station(forge, options, nvm, (trip,)) as first, pytest.raises(BusFault, match="simulator"):
        first.module.diagnostics.write_coefficients(NEW)
    assert first.process.wait(5.0) == -signal.SIGKILL
    found = in_use(nvm)
    assert pack_coefficients(found) == pack_coefficients(stored(nvm))
    return found


def in_use(nvm):
    """Switch a module with this memory on and ask it which coefficients it uses."""
    wire = Wire()
    wire.add_server(build_host(SimulatorOptions(nvm=nvm), wire.attach()).serve)
    module = Module(BenchBus(wire.attach(), SimulatedClock()))
    module.wait_ready()
    return module.diagnostics.read_coefficients()


def test_a_run_whose_module_is_killed_amid_the_write_is_an_error_with_a_record(
    forge, bus, short_procedure, tmp_path
):
    out, nvm = tmp_path / "runs", tmp_path / "module.nvm"
    killed = {"way": "in", "id": REQUEST, "begins": COMMIT, "count": 1, "signal": signal.SIGKILL}
    forge.start("simulate", *bus, "--nvm", nvm, trips=(killed,)).until_it_says("in lock-step")

    run = forge.start(
        "run", short_procedure, "--serial", "SN0001", "--no-dashboard", "--out", out, *bus
    )

    assert run.wait(40.0) == 4, run.err.read_text()
    record = json.loads((out / "latest" / "record.json").read_text())
    assert record["verdict"]["outcome"] == "ERROR"
    assert record["steps"][-1]["name"] == "write"
    fitted = next(fit for fit in record["fits"] if fit["method"] == "truth_aided")
    kept = stored(nvm)
    assert kept == DEFAULT_COEFFICIENTS or whole(kept) == pytest.approx(whole_of(fitted), rel=1e-6)


def whole(kept):
    """Return all 24 numbers of a bank."""
    return [*kept.mag_offset_mg, *kept.mag_matrix, *kept.accel_offset_g, *kept.accel_matrix]


def whole_of(fit):
    """Return all 24 numbers of a fit in the record."""
    return [
        *fit["offset_mg"],
        *np.ravel(fit["matrix"]),
        *fit["accel_offset_g"],
        *np.ravel(fit["accel_matrix"]),
    ]
