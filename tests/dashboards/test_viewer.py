from __future__ import annotations

import struct
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from conftest import Recorded

DRIVERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))


def has_vulkan() -> bool:
    return any(folder.is_dir() and any(folder.iterdir()) for folder in DRIVERS)


@pytest.mark.slow
@pytest.mark.timeout(120)
@pytest.mark.skipif(
    not (sys.platform == "linux" and has_vulkan()),
    reason="no Vulkan driver: the dashboard cannot be rendered (mesa-vulkan-drivers has one)",
)
@pytest.mark.parametrize("name", ["recorded", "failed"])
def test_dashboard_renders_without_a_complaint(
    name: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    from dashboards.viewer import take_picture

    run: Recorded = request.getfixturevalue(name)
    picture = tmp_path / "dashboard.png"

    complaints = take_picture(run.folder / "run.rrd", picture)

    assert complaints == []
    header = picture.read_bytes()[:24]
    assert header[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", header[16:24]) == (1920, 1200)
    assert picture.stat().st_size > 200_000  # an empty dashboard has a tenth of it
