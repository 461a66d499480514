"""A tenth of the study of good units: `python benchmarks/good_units.py` makes the whole."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

STUDY = Path(__file__).resolve().parents[2] / "benchmarks" / "good_units.py"
UNITS = 20


@pytest.fixture(scope="module")
def study() -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, STUDY, "--units", str(UNITS), "--workers", "1"],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_good_units_pass_and_none_is_perfect(study: subprocess.CompletedProcess[str]) -> None:
    assert study.returncode == 0, study.stdout + study.stderr
    assert "NOT MET" not in study.stdout


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_raw_headings_of_good_units_are_tens_of_degrees_off(
    study: subprocess.CompletedProcess[str],
) -> None:
    row = re.search(r"^raw_max\s+([\d.]+)", study.stdout, re.MULTILINE)

    assert row is not None, study.stdout
    assert 20.0 <= float(row[1]) <= 60.0
