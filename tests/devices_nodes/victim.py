"""Module processes to be killed: forked on request, each on a socket of its own.

Run as `python victim.py FD`: FD is a Unix socket on which every message carries the path of
a non-volatile memory and the socket of the bus; the answer is the new process's number.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import sys
from pathlib import Path

from devices.simulator import SimulatorOptions, simulate
from protocols.frame import Frame


class SocketLink:
    """A bus of two ends on a socket that keeps message boundaries."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end

    def send(self, can_id: int, data: bytes) -> None:
        self._end.send(can_id.to_bytes(4, "little") + data)

    def poll(self) -> Frame | None:
        return self.wait(0.0)

    def wait(self, timeout_s: float) -> Frame | None:
        if not select.select([self._end], [], [], timeout_s)[0]:
            return None
        message = self._end.recv(16)
        if not message:
            raise EOFError
        return Frame(0, int.from_bytes(message[:4], "little"), message[4:])

    def close(self) -> None:
        self._end.close()


def serve(control: socket.socket) -> None:
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while True:
        path, fds, _, _ = socket.recv_fds(control, 4096, 1)
        if not path:
            return
        child = os.fork()
        if child == 0:
            options = SimulatorOptions(nvm=Path(path.decode()))
            link = SocketLink(socket.socket(fileno=fds[0]))
            try:
                simulate(options, link, free_running=False, stop=lambda: False)
            except (EOFError, OSError):
                os._exit(0)
        os.close(fds[0])
        control.send(str(child).encode())


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))
