"""Set-up shared by all tests: recordings, seeds, and what happens where there is no vcan."""

from __future__ import annotations

import os
import random
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
NET = Path("/sys/class/net")
REASON = pytest.StashKey[str]()


def data_folder() -> Path:
    """Return where the recordings are expected: COMPASS_BENCH_DATA, else ../shared/data."""
    return Path(os.environ.get("COMPASS_BENCH_DATA") or ROOT.parent / "shared" / "data")


def why_no_vcan() -> str:
    """Return why the vcan tests cannot run here, or '' where vcan0 is up."""
    if not NET.is_dir():
        return "this system has no Linux network interfaces"
    if not (NET / "vcan0").exists():
        return "there is no vcan0 (`make vcan` runs these tests on one)"
    if not int((NET / "vcan0" / "flags").read_text(), 16) & 1:
        return "vcan0 is down (`ip link set vcan0 up`)"
    return ""


def pytest_configure(config: pytest.Config) -> None:
    config.stash[REASON] = why_no_vcan()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    reason = config.stash[REASON]
    for item in items:
        if reason and item.get_closest_marker("vcan"):
            item.add_marker(pytest.mark.skip(reason=f"no vcan: {reason}"))
        if item.get_closest_marker("data") and not data_folder().is_dir():
            item.add_marker(pytest.mark.skip(reason=f"no recordings: no folder {data_folder()}"))


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    skipped = [
        report
        for report in terminalreporter.stats.get("skipped", [])
        if "no vcan: " in str(report.longrepr)
    ]
    if skipped:
        terminalreporter.section("NOT TESTED ON A REAL CAN INTERFACE", sep="!", red=True)
        terminalreporter.line(f"{len(skipped)} vcan tests were skipped: {config.stash[REASON]}.")


@pytest.fixture(autouse=True)
def _seeded() -> None:
    """Start every test from the same global random states; the product itself uses none."""
    random.seed(20260101)
    np.random.seed(20260101)  # noqa: NPY002 - the global state is what is pinned here


@pytest.fixture
def rng() -> np.random.Generator:
    """Return a generator that starts each test alike."""
    return np.random.default_rng(20260101)


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Return the folder of the real recordings; skip, with the reason, where there is none."""
    folder = data_folder()
    if not folder.is_dir():
        pytest.skip(f"no recordings: no folder {folder} (COMPASS_BENCH_DATA names another)")
    return folder
