"""Processes of the product, forked on request from one that has everything imported.

Run as `python forge.py`: every line of standard input is an order in JSON, every line of
standard output its answer.

    {"argv": [...], "out": PATH, "err": PATH, "trips": [...]}   ->  process number
    {"wait": NUMBER}                                            ->  exit code, -signal, or null

The child runs the command line `argv`. A trip sends a signal to the child itself at one
frame: {"way": "in" | "out", "id": IDENTIFIER, "begins": HEX, "count": N, "signal": S}, where
"in" is a frame that its virtual devices take and "out" one that they send. The frame is
through when the signal comes.
"""

from __future__ import annotations

import json
import os
import sys

import canopen

import bench.cli.run_command
import bench.cli.simulate_command
import bench.diagnostics
import devices.simulator
from bench.calibration import methods
from bench.cli.main import main
from protocols import bus_opening

WARM = (
    bench.cli.run_command,
    bench.cli.simulate_command,
    bench.diagnostics,
    canopen,
    methods,
    bus_opening,
)


class Trip:
    """Counts frames of one kind and sends a signal after the last of them."""

    def __init__(self, *, way, count, signal, id=None, begins=""):
        self.way, self.left, self.signal = way, count, signal
        self.can_id, self.begins = id, bytes.fromhex(begins)

    def passed(self, way, can_id, data):
        if way == self.way and self.can_id in (None, can_id) and data.startswith(self.begins):
            self.left -= 1
            return self.left == 0
        return False


class TrippedLink:
    """A link of the devices on which trips lie."""

    def __init__(self, link, trips):
        self._link, self._trips = link, trips
        self._due = []
        self.close = link.close

    def send(self, can_id, data):
        self._link.send(can_id, data)
        self._look("out", can_id, data)
        self._pull()

    def poll(self):
        return self._received(self._link.poll)

    def wait(self, timeout_s):
        return self._received(lambda: self._link.wait(timeout_s))

    def _received(self, receive):
        self._pull()  # the frame before has been obeyed
        frame = receive()
        if frame is not None:
            self._look("in", frame.can_id, frame.data)
        return frame

    def _look(self, way, can_id, data):
        self._due += [trip for trip in self._trips if trip.passed(way, can_id, data)]

    def _pull(self):
        while self._due:
            os.kill(os.getpid(), self._due.pop().signal)


def lay(trips):
    build = devices.simulator.build_host
    devices.simulator.build_host = lambda options, link: build(options, TrippedLink(link, trips))


def become(order):
    for name, number in (("out", 1), ("err", 2)):
        file = os.open(order[name], os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(file, number)
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    if order.get("trips"):
        lay([Trip(**trip) for trip in order["trips"]])
    sys.argv = ["compass-bench", *order["argv"]]
    main()


def answer(order):
    if "wait" in order:
        number, status = os.waitpid(order["wait"], os.WNOHANG)
        return os.waitstatus_to_exitcode(status) if number else None
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        become(order)
        code = 0
    except SystemExit as end:
        code = end.code or 0
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    for line in sys.stdin:
        sys.stdout.write(json.dumps(answer(json.loads(line))) + "\n")
        sys.stdout.flush()
