"""Nothing in the bench can know a fault's name before the run has ended.

The name reaches the virtual devices and, at the end, the record. While the steps run it is
neither in a file of the run nor in anything that a step can reach; and a bench whose devices
are another process finds the same failure without the name existing in its process at all.
"""

from __future__ import annotations

import gc
import itertools
import json
import subprocess
import sys
import types
from pathlib import Path

import pytest

import bench.cli.run_command
from bench.executor import execute
from protocols.link import WirePort

ROOT = Path(__file__).resolve().parents[3]
FAULT = "swapped_axes"
LOOK_TICKS = 25
RUN = """
import json, sys
from pathlib import Path
from bench.cli.run_command import RunRequest, run_procedure

out, group = sys.argv[1:]
code = run_procedure(RunRequest(procedure="eol_three_axis", serial="SN0001", out=Path(out),
    interface="udp_multicast", channel=group, no_input=True, dashboard=False, quiet=True))
print(json.dumps({"code": code, "devices": sorted(n for n in sys.modules if n == "devices"
    or n.startswith("devices."))}))
"""


def reachable(root, *, but=()):
    """Yield what can be reached from an object by attributes, items and closures.

    Code is not followed: neither modules and classes, nor what a function could import.
    """
    seen = {id(each) for each in but}
    waiting = [root]
    while waiting:
        one = waiting.pop()
        if id(one) in seen or isinstance(one, types.ModuleType | type):
            continue
        seen.add(id(one))
        yield one
        if isinstance(one, types.FunctionType):
            waiting += one.__closure__ or ()
            waiting += one.__defaults__ or ()
        elif not isinstance(one, types.FrameType | types.CodeType):
            waiting += gc.get_referents(one)


@pytest.fixture
def watched(monkeypatch):
    """Let a test look at the run's context every 0.25 s while its steps run."""
    looks = []

    def install(look):
        def watching(procedure, context):
            def hook():
                if context.bus.tick_count % LOOK_TICKS == 0 and not context.completed:
                    looks.append(look(context))

            context.bus.add_hook(hook)
            return execute(procedure, context)

        monkeypatch.setattr(bench.cli.run_command, "execute", watching)
        return looks

    return install


def test_no_file_of_a_running_run_holds_the_name(bench, watched):
    def named(context):
        folder = context.recorder.folder
        files = [path for path in folder.rglob("*") if path.is_file()]
        documents = [json.dumps(context.recorder.record).encode()]
        return any(FAULT.encode() in text for text in documents + [f.read_bytes() for f in files])

    looks = watched(named)
    run = bench.run(FAULT, seed=1)

    assert len(looks) > 20
    assert not any(looks)
    assert run.first_failure == "axis_sense_x"
    assert run.record["injected_faults"] == [FAULT]
    assert run.events("run_ended")[0]["seq"] > run.events("section")[-1]["seq"]


def test_nothing_that_a_step_can_reach_holds_the_name(bench, watched):
    def names(context):
        # the far end of the wire is the devices, and `finish` runs when all steps are over
        wires = [one.wire for one in reachable(context) if isinstance(one, WirePort)]
        texts = (
            one for one in reachable(context, but=[*wires, context.finish]) if isinstance(one, str)
        )
        return [text for text in texts if FAULT in text]

    looks = watched(lambda context: names(context) if context.bus.tick_count < 400 else [])
    bench.run(FAULT, seed=1)

    assert len(looks) > 10
    assert list(itertools.chain(*looks)) == []


def test_the_search_does_find_a_name_that_can_be_reached(bench, watched):
    def found_at_first_look(context):
        texts = (one for one in reachable(context) if isinstance(one, str))
        return context.bus.tick_count == LOOK_TICKS and any(FAULT in text for text in texts)

    looks = watched(found_at_first_look)
    bench.run(FAULT, seed=1)

    assert looks[0]


@pytest.fixture
def station(request):
    """Start virtual devices with a fault as a process of its own; return their channel."""
    fault = request.param
    group = f"239.74.{200 + len(fault) % 50}.{sum(fault.encode()) % 250 + 1}"
    argv = [sys.executable, "-m", "bench.cli.main", "simulate", "--serial", "SN0001"]
    argv += ["--interface", "udp_multicast", "--channel", group, "--fault", fault]
    with subprocess.Popen(argv, cwd=ROOT, stderr=subprocess.PIPE, text=True) as process:
        assert "in lock-step" in process.stderr.readline()
        yield fault, group
        process.terminate()
        assert process.wait(10) == 0


@pytest.mark.parametrize(
    ("station", "code", "first_failure"),
    [
        ("dead_strap_y", 1, "set_reset_amplitude_y"),
        ("excess_noise", 1, "noise_x"),
        ("axis_stalled_pitch", 4, "rig_fault"),
        ("module_silent", 4, "module_silent"),
    ],
    indirect=["station"],
)
def test_a_bench_whose_devices_are_elsewhere_finds_the_same_failure_first(
    bench, station, code, first_failure
):
    fault, group = station

    run = bench.run(interface="udp_multicast", channel=group)

    assert (run.exit_code, run.first_failure) == (code, first_failure)
    assert run.record["injected_faults"] == []
    for path in run.folder.glob("*.*"):
        assert fault == first_failure or fault.encode() not in path.read_bytes()


@pytest.mark.parametrize("station", ["inverted_axis_z"], indirect=True)
def test_a_bench_on_a_channel_does_not_even_load_the_devices(station, tmp_path):
    _, group = station

    ended = subprocess.run(
        [sys.executable, "-c", RUN, str(tmp_path), group],
        cwd=ROOT, capture_output=True, text=True, timeout=50, check=False,
    )  # fmt: skip

    assert ended.returncode == 0, ended.stderr
    said = json.loads(ended.stdout)
    record = json.loads((tmp_path / "latest" / "record.json").read_text())
    assert said == {"code": 1, "devices": []}
    assert record["first_failure"] == "axis_sense_z"
