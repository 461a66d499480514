"""A tenth of the study of good units: `make good-units` makes the whole."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

STUDY = Path(__file__).resolve().parents[2] / "benchmarks" / "good_units.py"
UNITS = 20


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_good_units_pass_none_is_perfect_and_raw_they_are_tens_of_degrees_off() -> None:
    study = subprocess.run(
        [sys.executable, STUDY, "--units", str(UNITS), "--workers", "1"],
        capture_output=True,
        text=True,
        check=False,
    )

    assert study.returncode == 0, study.stdout + study.stderr
    assert "NOT MET" not in study.stdout
    raw_max = re.search(r"^raw_max\s+([\d.]+)", study.stdout, re.MULTILINE)
    assert raw_max is not None, study.stdout
    assert 20.0 <= float(raw_max[1]) <= 60.0
