"""A perfect module on a perfect rig, and stations and parts with one thing to doubt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.calibration.fit import Fit
from bench.calibration.tilt import ned_from_body
from bench.samples import READING
from bench.station import Seat, Surroundings, load_station
from bench.uncertainty.heading_budget import heading_budget
from bench.uncertainty.unit_data import UnitData

FIELD_MG = np.array([250.0, 0.0, 250.0 * np.sqrt(3.0)])


@pytest.fixture
def readings():
    """Return what makes noiseless readings of a perfect module at (azimuth, pitch, roll)."""

    def make(poses, *, every_s=1.7):
        angles_deg = np.array(poses, dtype=float)
        rotation = ned_from_body(*angles_deg.T)
        rows = np.zeros(len(angles_deg), dtype=READING)
        rows["position"], rows["count"] = np.arange(len(rows)), 50
        rows["t_s"], rows["temperature_c"] = every_s * np.arange(len(rows)), 25.0
        for column, name in enumerate(("azimuth", "pitch", "roll")):
            rows[f"rig_{name}_deg"] = angles_deg[:, column]
        rows["field_mg"] = np.einsum("nji,j->ni", rotation, FIELD_MG)
        rows["accel_g"] = -rotation[:, 2, :]
        rows["heading_deg"] = angles_deg[:, 0]
        return rows

    return make


@pytest.fixture
def fit():
    """Coefficients of a module that needs none."""
    return Fit(
        method="coefficients",
        offset_mg=np.zeros(3),
        matrix=np.eye(3),
        accel_offset_g=np.zeros(3),
        accel_matrix=np.eye(3),
    )


@pytest.fixture
def station():
    """Return what makes a station without any doubt but what is named."""

    def make(*, u_field_azimuth_deg=0.0, u_rig_deg=0.0, seat=None, surroundings=None):
        return replace(
            load_station("default"),
            u_field_azimuth_deg=u_field_azimuth_deg,
            u_rig_deg=u_rig_deg,
            seat=seat or Seat(),
            surroundings=surroundings or Surroundings(),
        )

    return make


@pytest.fixture
def budget(readings, fit, station):
    """Return what makes the budget of a perfect module at poses."""

    def make(poses, *, unit=None, **doubts):
        return heading_budget(readings(poses), fit, station(**doubts), unit or UnitData())

    return make


@pytest.fixture
def line(budget):
    """Return what makes one line of the budget, by its name."""

    def make(name, poses, **given):
        lines = budget(poses, **given).contributions
        return next(one for one in lines if one.name == name)

    return make
