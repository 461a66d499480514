"""Whole runs of a synthetic unit, made once for all that read them."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="session")
def kept_runs(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture
def good_run(make_run, kept_runs):
    if not (kept_runs / "good" / "latest").exists():
        make_run(kept_runs / "good").execute()
    return (kept_runs / "good" / "latest").resolve()


@pytest.fixture
def bad_run(make_run, kept_runs):
    if not (kept_runs / "bad" / "latest").exists():
        make_run(kept_runs / "bad", move_hard_iron_mg=3.0).execute()
    return (kept_runs / "bad" / "latest").resolve()
