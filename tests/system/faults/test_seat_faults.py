"""A turned seat and iron in the fixture: no run on the seat sees them, a reversal does.

The hidden error is held against the truth that only the simulator knows: the unit with the
coefficients that were written, on a perfect rig, without seat and fixture.
"""

from __future__ import annotations

import json
from datetime import date
from types import SimpleNamespace

import numpy as np
import pytest

from bench.acceptance.two_axis_evaluation import fit_of
from bench.calibration.compensation import compensated_heading_deg
from bench.cli.run_command import RunRequest
from bench.cli.verify_command import VerifyRequest, verify_bench
from bench.record.entries import coefficients_of
from bench.station import load_station
from devices import rotation
from devices.field import EarthField
from devices.sensors import Sensors
from devices.simulator import FIXTURE_IRON_MG, TURNED_DEG
from devices.unit import draw_unit
from devices.world import World
from protocols.angles import wrap_180_deg

SERIAL = "SN0001"
FAULTS = ("seat_turned", "fixture_iron")
DAY = date(2026, 11, 22)


class HeldRig:
    """A perfect rig that stands where it is told."""

    def __init__(self) -> None:
        self.azimuth = SimpleNamespace(angle_deg=0.0)
        self._matrix = rotation.IDENTITY

    def stand(self, azimuth_deg: float) -> None:
        self.azimuth = SimpleNamespace(angle_deg=azimuth_deg)
        self._matrix = rotation.ned_from_body(azimuth_deg, 0.0, 0.0)

    def ned_from_body(self) -> rotation.Matrix:
        return self._matrix

    def step(self, dt_s: float) -> None:
        del dt_s


def errors_without_seat_deg(written: dict) -> np.ndarray:
    """Return the heading errors of the unit out of the fixture, level, at 24 headings."""
    rig = HeldRig()
    unit = draw_unit(SERIAL, 1)
    sensors = Sensors(unit, World(EarthField(), rig), np.random.default_rng(3))
    fit = fit_of(coefficients_of(written))
    headings_deg = np.arange(0.0, 360.0, 15.0)
    found = []
    for number, azimuth_deg in enumerate(headings_deg):
        rig.stand(azimuth_deg)
        counts = np.array([sensors.sample(300.0 + number) for _ in range(50)], dtype=float)
        field_mg = (counts[:, 0] - counts[:, 1]) / 2.0 * unit.mag_mg_per_count
        force_g = counts[:, 2] * unit.accel_g_per_count
        mean = field_mg.mean(axis=0), force_g.mean(axis=0)
        found.append(float(compensated_heading_deg(fit, mean[0][None], mean[1][None])[0]))
    return wrap_180_deg(np.array(found) - headings_deg)


@pytest.fixture(scope="module")
def verified(tmp_path_factory):
    """Return (exit code, record, station file) of a verification of the faulty bench."""
    out = tmp_path_factory.mktemp("verify")
    run = RunRequest(
        procedure="bench_verify", serial="GOLD1", faults=FAULTS, out=out, no_input=True,
        dashboard=False, quiet=True,
    )  # fmt: skip
    path = out / "station.yaml"
    code = verify_bench(VerifyRequest(run=run, write=path), day=lambda: DAY)
    record = json.loads((out / "latest" / "record.json").read_text(encoding="utf-8"))
    return code, record, path


@pytest.fixture(scope="module")
def sound_deg(bench, short_procedure):
    """Return the errors that the same unit has from a square seat without iron."""
    run = bench.run(procedure=short_procedure)
    return errors_without_seat_deg(run.record["coefficients"]["written"])


@pytest.fixture(scope="module")
def hidden(bench, short_procedure):
    return bench.run(*FAULTS, procedure=short_procedure)


@pytest.fixture(scope="module")
def corrected(bench, short_procedure, verified):
    return bench.run(*FAULTS, procedure=short_procedure, site=verified[2])


def test_a_run_on_the_seat_passes_with_an_error_that_it_cannot_see(hidden, sound_deg):
    assert hidden.outcome == "PASS", hidden.reason
    assert hidden.value("level_max") < 0.5

    error_deg = errors_without_seat_deg(hidden.record["coefficients"]["written"]) - sound_deg

    assert abs(error_deg.mean()) == pytest.approx(TURNED_DEG, abs=0.05)
    assert np.ptp(error_deg) / 2.0 == pytest.approx(
        np.rad2deg(np.hypot(*FIXTURE_IRON_MG[:2]) / 250.0), rel=0.1
    )


def test_the_reversal_finds_what_was_broken_within_its_uncertainty(verified):
    code, record, _ = verified
    found = record["reversal"]["found"]
    truth = {"index": TURNED_DEG, "pitch": 0.0, "roll": 0.0, "field_azimuth": 0.0, "dip": 60.0}
    truth |= dict(zip(("iron_x", "iron_y", "iron_z"), FIXTURE_IRON_MG, strict=True))

    assert code == 5
    assert record["first_failure"] == "seat_index_change"
    for name, value in truth.items():
        assert found[name]["told"]
        assert abs(found[name]["value"] - value) < 1.5 * found[name]["u"], name
    assert found["index"]["u"] < 0.03
    assert found["iron_x"]["u"] < 0.2


def test_the_station_file_takes_what_was_found_with_day_and_golden_unit(verified):
    _, record, path = verified
    found = record["reversal"]["found"]

    station = load_station(str(path))

    assert station.seat.index_deg == pytest.approx(found["index"]["value"], abs=1e-4)
    assert station.seat.iron_mg[1] == pytest.approx(found["iron_y"]["value"], abs=1e-3)
    assert station.seat.u_index_deg == pytest.approx(found["index"]["u"], abs=1e-4)
    assert station.u_field_azimuth_deg == pytest.approx(found["field_azimuth"]["u"], abs=1e-4)
    assert (station.seat.verified, station.seat.golden) == (DAY, "GOLD1")
    assert station.dip_deg == load_station("default").dip_deg


def test_a_run_with_the_verified_station_writes_what_a_sound_seat_would(
    corrected, sound_deg, verified
):
    assert corrected.outcome == "PASS", corrected.reason
    assert corrected.record["station"]["seat"]["verified"] == DAY.isoformat()

    error_deg = errors_without_seat_deg(corrected.record["coefficients"]["written"]) - sound_deg

    station = load_station(str(verified[2]))
    iron_u_deg = np.rad2deg(station.seat.u_iron_mg / station.horizontal_mg)
    assert abs(error_deg.mean()) < 2.0 * station.seat.u_index_deg
    assert np.abs(error_deg - error_deg.mean()).max() < 2.0 * iron_u_deg


def test_the_verified_station_is_verified_by_the_next_reversal(verified, tmp_path):
    run = RunRequest(
        procedure="bench_verify", serial=None, faults=FAULTS, out=tmp_path, no_input=True,
        dashboard=False, quiet=True, site=verified[2],
    )  # fmt: skip

    assert verify_bench(VerifyRequest(run=run)) == 0


def test_a_run_with_a_corrected_seat_is_judged_again_to_the_same_numbers(corrected):
    from bench.rejudge import rejudge

    assert rejudge(corrected.folder).differing == []


def test_a_reversal_is_judged_again_to_the_same_numbers(verified):
    from bench.rejudge import rejudge

    again = rejudge((verified[2].parent / "latest").resolve())

    assert again.differing == []
    assert str(again.recorded) == "ERROR"
