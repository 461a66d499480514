"""Recordings of real sensors through the whole bench: imported, replayed over CAN, fitted."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest
from typer.testing import CliRunner

from bench.cli.main import app
from bench.recordings import read_recording
from bench.sample_file import read_samples
from protocols.compass import FLAG_SYNTHESISED

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.data


class Replayed(NamedTuple):
    """One recording after its run."""

    csv: Path
    exit_code: int
    folder: Path
    record: dict[str, Any]

    def value(self, name: str) -> float:
        return float(next(m["value"] for m in self.record["measurements"] if m["name"] == name))

    def note(self, name: str) -> str:
        return str(next(m["note"] for m in self.record["measurements"] if m["name"] == name))

    def fit(self, method: str) -> dict[str, Any]:
        return next(fit for fit in self.record["fits"] if fit["method"] == method)


def replayed(folder: Path, *import_arguments: str) -> Replayed:
    csv = folder / "recording.csv"
    imported = CliRunner().invoke(
        app, ["import", import_arguments[0], str(csv), *import_arguments[1:]]
    )
    assert imported.exit_code == 0, imported.output
    arguments = ["run", "recording", "--serial", "REC1", "--replay", str(csv), "--no-input"]
    ran = CliRunner().invoke(app, [*arguments, "--no-dashboard", "--out", str(folder / "runs")])
    run = (folder / "runs" / "latest").resolve()
    return Replayed(csv, ran.exit_code, run, json.loads((run / "record.json").read_text("utf-8")))


@pytest.fixture(scope="module")
def hmc5883l(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Replayed:
    source = recordings / "hmc5883l_sunsided"
    return replayed(
        tmp_path_factory.mktemp("hmc5883l"),
        str(source / "full-sphere_mag.csv"),
        "--preset",
        "hmc5883l_sunsided",
        "--accel",
        str(source / "full-sphere_acc.csv"),
    )


@pytest.fixture(scope="module")
def qmc5883l(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Replayed:
    return replayed(
        tmp_path_factory.mktemp("qmc5883l"),
        str(recordings / "qmc5883l_tomisuarez2_noisy_raw.csv"),
        "--preset",
        "qmc5883l_tomisuarez2",
    )


@pytest.fixture(scope="module")
def magnet(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Replayed:
    return replayed(
        tmp_path_factory.mktemp("magnet"),
        str(recordings / "broad" / "32_disturbed_attached_magnet_1cm.csv"),
        "--preset",
        "broad",
    )


@pytest.mark.timeout(120)
@pytest.mark.parametrize("name", ["hmc5883l", "qmc5883l"])
def test_what_the_bench_receives_is_what_the_file_holds(
    name: str, request: pytest.FixtureRequest
) -> None:
    run: Replayed = request.getfixturevalue(name)
    recording = read_recording(run.csv)
    samples = read_samples(run.folder / "samples.parquet")
    collected = samples[samples["position"] == 0]

    field_mg = (collected["set_mg"] - collected["reset_mg"]) / 2.0
    assert field_mg.shape == recording.field_mg.shape
    assert field_mg == pytest.approx(recording.field_mg, abs=1e-3)
    assert np.all(collected["flags"][:-1] & FLAG_SYNTHESISED)
    assert np.array_equal(collected["set_mg"], -collected["reset_mg"])
    if recording.accel_g is not None:
        assert collected["accel_g"] == pytest.approx(recording.accel_g, abs=1e-6)


@pytest.mark.timeout(120)
def test_full_sphere_is_fitted_to_half_a_percent_of_its_field(hmc5883l: Replayed) -> None:
    assert hmc5883l.exit_code == 0
    assert hmc5883l.value("fit_residual_share") == pytest.approx(0.46, abs=0.02)
    assert hmc5883l.fit("ellipsoid")["coverage"] > 0.95


@pytest.mark.timeout(120)
def test_noisy_unit_is_corrected_as_well_as_with_its_published_parameters(
    qmc5883l: Replayed, recordings: Path
) -> None:
    published = np.loadtxt(recordings / "qmc5883l_tomisuarez2_published_params.csv").ravel()
    recording = read_recording(qmc5883l.csv)
    theirs = recording.field_mg @ published[:9].reshape(3, 3).T + published[9:]
    fit = qmc5883l.fit("ellipsoid")
    ours = (recording.field_mg - fit["offset_mg"]) @ np.array(fit["matrix"]).T

    def spread(corrected: np.ndarray) -> float:
        radius = np.linalg.norm(corrected, axis=1)
        return float(radius.std() / radius.mean())

    assert qmc5883l.exit_code == 0
    assert spread(theirs) == pytest.approx(0.062, abs=0.001)
    assert spread(ours) <= 1.02 * spread(theirs)


@pytest.mark.timeout(120)
def test_recording_with_an_attached_magnet_is_refused_with_the_reason(magnet: Replayed) -> None:
    assert magnet.exit_code == 1
    assert magnet.record["verdict"]["outcome"] == "FAIL"
    assert magnet.record["first_failure"] == "fit_accepted"
    assert "magnet" in magnet.note("fit_accepted")
