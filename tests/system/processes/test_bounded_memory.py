"""The memory of a run does not grow with its length."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

import pytest

SHORT_TICKS, LONG_TICKS = 20_000, 120_000
ALLOWED_KIB = 6 * 1024
"""One block of frames and of samples is 1 MiB; a list of all frames would take 900 MiB."""


def peak_kib(process) -> int:
    """Return the largest resident memory that a process had so far."""
    status = Path(f"/proc/{process.number}/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1])


def waiting(folder, ticks):
    path = folder / f"wait_{ticks}.yaml"
    path.write_text(
        f"""name: wait_{ticks}
version: "1.0"
title: Wait
description: Listen to the module for a long time.
limits: min_max
steps:
  - {{kind: check_bus, name: bus}}
  - {{kind: identify, name: identify}}
  - {{kind: wait, name: wait, duration: {ticks / 100:g} s}}
"""
    )
    return path


@pytest.mark.timeout(90)
def test_a_run_six_times_as_long_takes_the_same_memory(forge, tmp_path):
    peaks = {}
    for ticks in (SHORT_TICKS, LONG_TICKS):
        run = forge.start(
            "run", waiting(tmp_path, ticks), "--serial", "SN0001", "--out", tmp_path / str(ticks),
            "--no-dashboard",
        )  # fmt: skip
        peak = 0
        while run.ended() is None:
            with contextlib.suppress(OSError, StopIteration):
                peak = max(peak, peak_kib(run))
            time.sleep(0.02)
        assert run.code == 0, run.err.read_text()
        peaks[ticks] = peak

    assert peaks[LONG_TICKS] - peaks[SHORT_TICKS] < ALLOWED_KIB, peaks
