"""A synthetic unit on a perfect rig, and whole runs of it, without a bus."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bench.acceptance.fit_evaluation import evaluate_fit
from bench.acceptance.heading_evaluation import (
    bench_heading_deg,
    evaluate_returns,
    evaluate_temperature,
    evaluate_verification,
)
from bench.acceptance.measurement import Limit, Measurement
from bench.acceptance.method_comparison import achieved_by, expected_of, ranking, study_of
from bench.acceptance.outcome import Outcome
from bench.acceptance.sensor_evaluation import (
    evaluate_noise,
    evaluate_peaks,
    evaluate_senses,
    evaluate_set_reset,
    evaluate_sweep,
)
from bench.acceptance.site import calibration_data
from bench.acceptance.verdict import judge_measurement, verdict_of
from bench.calibration.deviation import exact_deviation
from bench.calibration.fixture import SeatFound
from bench.calibration.methods import METHODS, fit_named
from bench.calibration.tilt import ned_from_body
from bench.pose import Attitude, Pose
from bench.record.recorder import RunRecorder
from bench.sample_file import SampleFile
from bench.samples import COMPLETE, SAMPLE, readings_of
from protocols.clock import SimulatedClock
from protocols.uds import DEFAULT_COEFFICIENTS, Coefficients

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

SITE = SimpleNamespace(horizontal_mg=250.0, dip_deg=60.0, field_azimuth_deg=1.25, seat=SeatFound())
FIELD_MG = np.array(
    [
        250.0 * np.cos(np.deg2rad(1.25)),
        250.0 * np.sin(np.deg2rad(1.25)),
        250.0 * np.tan(np.deg2rad(60.0)),
    ]
)
SAMPLES_A_POSE = 50


@dataclass
class SyntheticUnit:
    """Sensor model of the tests: raw = gain @ body field + hard iron, on a bridge with Hk.

    (set + reset)/2 = bridge_offset - field_own field_neighbour / hk.
    """

    gain: NDArray[np.float64] = field(
        default_factory=lambda: np.array(
            [[1.1, 0.08, -0.05], [0.06, 0.9, 0.04], [-0.03, 0.05, 1.0]]
        )
    )
    hard_iron_mg: NDArray[np.float64] = field(default_factory=lambda: np.array([90.0, -60.0, 40.0]))
    bridge_offset_mg: NDArray[np.float64] = field(
        default_factory=lambda: np.array([30.0, -20.0, 10.0])
    )
    hk_mg: float = 8000.0
    noise_mg: float = 0.1
    repeatability_mg: float = 0.3
    flip: NDArray[np.float64] = field(default_factory=lambda: np.ones(3))
    accel_gain: NDArray[np.float64] = field(
        default_factory=lambda: np.array(
            [[1.01, 0.01, 0.0], [-0.01, 0.99, 0.005], [0.0, 0.01, 1.0]]
        )
    )
    accel_bias_g: NDArray[np.float64] = field(default_factory=lambda: np.array([0.02, -0.03, 0.01]))
    coefficients: Coefficients = DEFAULT_COEFFICIENTS
    temperature_c: float = 25.0
    seed: int = 7

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(self.seed)

    def samples(self, poses: list[Pose], *, start_s: float = 0.0) -> NDArray[np.void]:
        """Return 50 complete samples of each pose, one every 10 ms."""
        return np.concatenate([self._dwell(pose, start_s) for pose in poses])

    def _dwell(self, pose: Pose, start_s: float) -> NDArray[np.void]:
        rng, at = self._rng, pose.attitude
        count = SAMPLES_A_POSE
        samples = np.zeros(count, dtype=SAMPLE)
        ticks = pose.position * 100 + np.arange(count)
        samples["tick"], samples["t_s"] = ticks, start_s + ticks * 0.01
        samples["group"], samples["complete"] = ticks % 16, COMPLETE
        samples["position"], samples["quality"] = pose.position, 3
        samples["temperature_c"] = self.temperature_c
        samples["rig_azimuth_deg"] = at.azimuth_deg
        samples["rig_pitch_deg"], samples["rig_roll_deg"] = at.pitch_deg, at.roll_deg
        body_from_ned = ned_from_body(at.azimuth_deg, at.pitch_deg, at.roll_deg).T
        film_mg = self.gain @ (body_from_ned @ FIELD_MG) + self.hard_iron_mg
        film_mg = film_mg + rng.normal(0.0, self.repeatability_mg, 3)
        half_mg = film_mg * self.flip + rng.normal(0.0, self.noise_mg, (count, 3))
        cross_mg = film_mg * film_mg[[1, 0, 0]] / self.hk_mg
        mean_mg = self.bridge_offset_mg - cross_mg + film_mg * (1.0 - self.flip)
        samples["set_mg"], samples["reset_mg"] = mean_mg + half_mg, mean_mg - half_mg
        force_g = self.accel_gain @ (body_from_ned @ np.array([0.0, 0.0, -1.0])) + self.accel_bias_g
        samples["accel_g"] = force_g + rng.normal(0.0, 0.002, (count, 3))
        heading_deg = bench_heading_deg(samples, self.coefficients)
        samples["heading_deg"] = np.round(heading_deg * 65536.0 / 360.0) % 65536 * 360.0 / 65536.0
        return samples


def ring(
    first: int,
    step: str,
    azimuths: list[float],
    pitch: float = 0.0,
    roll: float = 0.0,
    turn: int = 0,
) -> list[Pose]:
    """Return poses of one ring, counted from `first`."""
    return [
        Pose(
            position=first + index,
            step=step,
            attitude=Attitude(azimuth_deg=azimuth, pitch_deg=pitch, roll_deg=roll),
            direction=turn,
        )
        for index, azimuth in enumerate(azimuths)
    ]


def tilted(first: int, step: str, count: int, offset_deg: float = 0.0) -> list[Pose]:
    """Return rings of `count` headings at pitch and roll of +-30 deg, staggered."""
    poses: list[Pose] = []
    for index, (pitch, roll) in enumerate([(30.0, 0.0), (-30.0, 0.0), (0.0, 30.0), (0.0, -30.0)]):
        azimuths = [(offset_deg + index * 15.0 + k * 360.0 / count) % 360.0 for k in range(count)]
        poses += ring(first + len(poses), step, azimuths, pitch, roll)
    return poses


HEADINGS = [15.0 * k for k in range(24)]


def procedure_poses() -> dict[str, list[Pose]]:
    """Return the poses of a whole run by step."""
    poses: dict[str, list[Pose]] = {}
    rows = ring(0, "set_reset", HEADINGS[::3]) + tilted(8, "set_reset", 2)
    poses["set_reset"] = rows
    first = len(rows)
    poses["noise"] = ring(first, "noise", [0.0])
    first += 1
    poses["sweep"] = ring(first, "sweep", [*HEADINGS, 0.0], turn=1)
    poses["sweep"] += ring(first + 25, "sweep", [*HEADINGS[:0:-1], 0.0], turn=-1)
    first += 49
    poses["tilted_poses"] = tilted(first, "tilted_poses", 6)
    first += 24
    poses["verify"] = ring(first, "verify", [h + 7.0 for h in HEADINGS])
    poses["verify"] += tilted(first + 24, "verify", 6, offset_deg=9.0)
    first += 48
    poses["returns"] = ring(first, "returns", [20.0, 110.0, 200.0, 290.0] * 4)
    return poses


def limits() -> dict[str, Limit]:
    """Return limits of the synthetic runs."""
    rows: list[tuple[str, str, float | None, float | None, float, Outcome]] = [
        *((f"noise_{a}", "mG", None, 0.6, 0.02, Outcome.FAIL) for a in "xyz"),
        *((f"set_reset_amplitude_{a}", "%", 40.0, 200.0, 2.0, Outcome.FAIL) for a in "xyz"),
        *((f"set_reset_symmetry_{a}", "%", None, 5.0, 0.5, Outcome.FAIL) for a in "xyz"),
        *((f"bridge_offset_{a}", "mG", -60.0, 60.0, 0.5, Outcome.FAIL) for a in "xyz"),
        *((f"hk_{a}", "G", 4.0, None, 0.5, Outcome.FAIL) for a in "xyz"),
        *((f"axis_sense_{a}", "", 0.7, None, 0.01, Outcome.FAIL) for a in "xyz"),
        *((f"accel_sense_{a}", "", 0.9, None, 0.01, Outcome.FAIL) for a in "xyz"),
        ("peak_reading", "mG", None, 720.0, 1.0, Outcome.FAIL),
        ("hysteresis", "mG", None, 3.0, 0.3, Outcome.FAIL),
        ("return_to_start", "mG", None, 2.0, 0.3, Outcome.FAIL),
        ("fit_accepted", "", 1.0, 1.0, 0.0, Outcome.FAIL),
        ("fit_residual", "mG", None, 0.6, 0.02, Outcome.FAIL),
        ("field_azimuth_difference", "deg", None, 0.1, 0.04, Outcome.ERROR),
        ("dip_difference", "deg", None, 0.1, 0.03, Outcome.ERROR),
        ("accel_bias", "mg", None, 60.0, 1.0, Outcome.FAIL),
        ("read_back", "", 1.0, 1.0, 0.0, Outcome.FAIL),
        ("level_max", "deg", None, 0.5, 0.08, Outcome.FAIL),
        ("tilt_max", "deg", None, 0.8, 0.1, Outcome.FAIL),
        ("bench_against_module", "deg", None, 0.02, 0.003, Outcome.FAIL),
        ("repeatability", "deg", None, 0.2, 0.01, Outcome.FAIL),
        ("closing_error", "deg", None, 0.1, 0.02, Outcome.FAIL),
        ("temperature_change", "deg C", None, 0.25, 0.05, Outcome.ERROR),
        ("frames_lost", "frames", None, 0.0, 0.0, Outcome.ERROR),
        ("bus_load", "%", None, 70.0, 1.0, Outcome.ERROR),
    ]
    return {
        name: Limit(
            name=name, unit=unit, low=low, high=high, uncertainty=u, missed=missed,
            guard_band=0.02 if name in ("level_max", "tilt_max") else 0.0,
            action=f"Look at {name} in the fault guide.",
        )
        for name, unit, low, high, u, missed in rows
    }  # fmt: skip


class WallClock:
    """A wall clock that advances by 10 ms whenever it is read."""

    def __init__(self, start: datetime = datetime(2026, 11, 22, 10, 15, tzinfo=UTC)) -> None:
        self._now = start

    def __call__(self) -> datetime:
        self._now += timedelta(milliseconds=10)
        return self._now


@dataclass
class SyntheticRun:
    """A whole run of a synthetic unit, recorded as the executor would."""

    out_dir: Path
    unit: SyntheticUnit = field(default_factory=SyntheticUnit)
    limits: dict[str, Limit] = field(default_factory=limits)
    wall_clock: WallClock = field(default_factory=WallClock)
    move_hard_iron_mg: float = 0.0

    def execute(self) -> Path:
        """Record the run and return its folder."""
        self.clock = SimulatedClock()
        self.recorder = RunRecorder(
            self.out_dir, "SN0001", "eol_three_axis", clock=self.clock, wall_clock=self.wall_clock,
            procedure_version="1.0", seed=1,
        )  # fmt: skip
        self.judged: list[Measurement] = []
        self.poses = procedure_poses()
        self.all_samples: list[NDArray[np.void]] = []
        self._identify()
        self._measure_sensor()
        self._calibrate()
        self._verify()
        file = SampleFile(self.recorder.path("samples.parquet"), {})
        file.write(np.concatenate(self.all_samples))
        file.close()
        return self.recorder.close(verdict_of(self.judged))

    def _step(self, name: str, kind: str) -> None:
        self.recorder.step_started(name, kind)

    def _end(self, name: str, measurements: list[Measurement]) -> None:
        outcomes = []
        for measurement in measurements:
            judged = judge_measurement(replace(measurement, step=name), self.limits)
            self.recorder.measurement(judged)
            self.judged.append(judged)
            outcomes.append(judged.outcome or Outcome.PASS)
        worst = max(outcomes, key=lambda o: o.severity, default=Outcome.PASS)
        self.recorder.step_ended(name, worst)

    def _visit(self, step: str) -> NDArray[np.void]:
        for pose in self.poses[step]:
            self.recorder.pose(pose)
            self.clock.advance(1_800_000_000)
        samples = self.unit.samples(self.poses[step])
        self.all_samples.append(samples)
        return samples

    def _identify(self) -> None:
        set_ = self.recorder.set
        set_("software", {"version": "0.1.0", "python": "3.11", "sha256": "5" * 64})
        set_("config", {"limits_id": "eol", "limits_version": "1.0", "limits_sha256": "a" * 64})
        set_(
            "bus", {"interface": "lockstep", "channel": "bench", "mode": "lockstep", "frames": 9e4}
        )
        set_("bus", {"frames": 90210, "lost": 0})
        set_(
            "module",
            {"serial": "SN0001", "part": "CB-AMR3", "hardware": "1.0", "firmware": "1.0.0"},
        )
        set_("station", {"name": "default", **vars(SITE), "u_field_azimuth_deg": 0.05})
        self._step("bus", "check_bus")
        self.clock.advance(500_000_000)
        load = Measurement(name="bus_load", value=24.6, step="bus", unit="%", from_samples=False)
        self._end("bus", [load])

    def _measure_sensor(self) -> None:
        poses = [pose for rows in self.poses.values() for pose in rows]
        self._step("set_reset", "set_reset")
        readings = readings_of(self._visit("set_reset"))
        found = [*evaluate_peaks("set_reset", readings)]
        found += evaluate_set_reset("set_reset", readings, SITE)
        self._end("set_reset", found + evaluate_senses("set_reset", readings, SITE))
        self._step("noise", "noise")
        self._end("noise", evaluate_noise("noise", readings_of(self._visit("noise"))))
        self._step("sweep", "sweep")
        self.sweep = readings_of(self._visit("sweep"))
        self._end("sweep", evaluate_sweep("sweep", self.sweep, poses))
        self._step("tilted_poses", "poses")
        rows = readings_of(self._visit("tilted_poses"))
        self._end("tilted_poses", evaluate_peaks("tilted_poses", rows))
        self.calibration = np.concatenate([self.sweep, rows])

    def _calibrate(self) -> None:
        self._step("fit", "fit")
        data = calibration_data(self.calibration, SITE)
        self.fits = {name: fit_named(name, data) for name in METHODS}
        for fit in self.fits.values():
            self.recorder.fit(fit)
        fit = self.fits["truth_aided"]
        self._end("fit", evaluate_fit("fit", fit, SITE))
        self._step("write", "write")
        if not fit.refused:
            self.unit.coefficients = Coefficients(
                version=1,
                mag_offset_mg=tuple(np.ravel(fit.offset_mg).tolist()),
                mag_matrix=tuple(np.ravel(fit.matrix).tolist()),
                accel_offset_g=tuple(np.ravel(fit.accel_offset_g).tolist()),
                accel_matrix=tuple(np.ravel(fit.accel_matrix).tolist()),
            )
        written = {"before": DEFAULT_COEFFICIENTS, "written": self.unit.coefficients}
        self.recorder.set("coefficients", {**written, "read_back_equal": True})
        equal = Measurement(name="read_back", value=1.0, step="write", from_samples=False)
        self._end("write", [equal])

    def _verify(self) -> None:
        self.unit.hard_iron_mg = self.unit.hard_iron_mg + [self.move_hard_iron_mg, 0.0, 0.0]
        self._step("verify", "verify")
        samples = self._visit("verify")
        readings = readings_of(samples)
        found = self._headings(readings, samples)
        self._end("verify", found + evaluate_temperature("verify", self.calibration, readings))
        compared = study_of(self.fits, readings, SITE)
        achieved = achieved_by(self.fits, compared)
        for name, fit in self.fits.items():
            self.recorder.fit(fit, achieved[name])
        expected = expected_of(self.fits, readings, SITE)
        self.recorder.set("study", {**compared.as_dict(), **expected})
        self.recorder.set("ranking", ranking(achieved))
        self._deviation(readings)
        self._step("returns", "returns")
        rows = readings_of(self._visit("returns"))
        self._end("returns", evaluate_returns("returns", rows, self.poses["returns"], SITE))

    def _headings(self, rows: NDArray[np.void], samples: NDArray[np.void]) -> list[Measurement]:
        return evaluate_verification("verify", rows, samples, self.unit.coefficients, SITE)

    def _deviation(self, readings: NDArray[np.void]) -> None:
        raw_deg = np.rad2deg(
            np.arctan2(-self.sweep["field_mg"][:, 1], self.sweep["field_mg"][:, 0])
        )
        rows = {
            "raw": exact_deviation(raw_deg, self.sweep["rig_azimuth_deg"] - 1.25),
            "compensated": exact_deviation(
                readings["heading_deg"][:24], readings["rig_azimuth_deg"][:24] - 1.25
            ),
        }
        entries = {
            name: {
                **dict(zip("ABCDE", deviation.coefficients_deg, strict=True)),
                "se": dict(zip("ABCDE", deviation.sd_deg, strict=True)),
                "words": list(deviation.words),
            }
            for name, deviation in rows.items()
        }
        self.recorder.set("deviation", entries)


@pytest.fixture
def site() -> SimpleNamespace:
    return SITE


@pytest.fixture
def unit() -> SyntheticUnit:
    return SyntheticUnit()


@pytest.fixture
def make_unit() -> type[SyntheticUnit]:
    return SyntheticUnit


@pytest.fixture
def poses_of_run() -> dict[str, list[Pose]]:
    return procedure_poses()


@pytest.fixture
def make_run() -> type[SyntheticRun]:
    return SyntheticRun


@pytest.fixture
def wall_clock() -> WallClock:
    return WallClock()
