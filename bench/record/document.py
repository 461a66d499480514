"""record.json, schema `compass-bench/record/1`, as pydantic models.

Fields that depend on the wall clock end in `_utc` or begin with `wall_`; all others are the
same in two runs with one seed. Numbers are finite; what could not be measured is null.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self

from pydantic import Field, Strict, ValidationError, model_validator

from bench.acceptance.outcome import Outcome  # noqa: TC001
from bench.errors import ConfigError
from bench.record.bridge_section import BridgeTermEntry  # noqa: TC001
from bench.record.section import OpenSection, StrictSection
from bench.record.uncertainty_section import UncertaintySection

if TYPE_CHECKING:
    from pathlib import Path

SCHEMA: Final = "compass-bench/record/1"
RECORD_FILE: Final = "record.json"

Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Matrix = Annotated[list[Vector], Field(min_length=3, max_length=3)]


class RunSection(StrictSection):
    """What was run, when, how long. `id` names what was run; with `started_utc` it is unique."""

    id: str
    procedure: str
    procedure_version: str = ""
    serial: str
    started_utc: str
    ended_utc: str | None = None
    simulated_s: float | None = None
    wall_s: float | None = None
    ticks: int | None = None
    seed: int | None = None
    status: Literal["running", "complete", "aborted", "error"] = "running"


class SoftwareSection(OpenSection):
    """The software that measured and judged."""

    version: str = ""
    python: str = ""
    packages: dict[str, str] = {}
    sha256: str = ""


class ConfigSection(OpenSection):
    """The files that the run was held against."""

    procedure_sha256: str = ""
    limits_id: str = ""
    limits_version: str = ""
    limits_sha256: str = ""
    station_sha256: str = ""


class BusSection(OpenSection):
    """The bus and what was lost on it."""

    interface: str | None = None
    channel: str | None = None
    mode: str | None = None
    bitrate: int | None = None
    frames: int | None = None
    lost: int | None = None
    dropped: int | None = None
    faults: dict[str, int] = {}
    load_percent: float | None = None
    load_worst_percent: float | None = None
    e2e: dict[str, Any] = {}


class StationSection(OpenSection):
    """What the bench holds for true, with uncertainties as further `u_` entries."""

    name: str = ""
    horizontal_mg: float | None = None
    dip_deg: float | None = None
    declination_deg: float | None = None
    field_azimuth_deg: float | None = None


class ModuleSection(OpenSection):
    """The unit, as it names itself."""

    serial: str | None = None
    part: str | None = None
    hardware: str | None = None
    firmware: str | None = None
    mag_mg_per_count: float | None = None
    accel_g_per_count: float | None = None
    synthesised: bool | None = None


class PoseEntry(StrictSection):
    """One dwell, as it was commanded."""

    position: int
    step: str
    azimuth_deg: float
    pitch_deg: float
    roll_deg: float
    direction: int
    attempt: int = 1


class StepEntry(StrictSection):
    """One attempt of one step."""

    name: str
    kind: str
    started_s: float
    ended_s: float | None = None
    outcome: Outcome | None = None
    message: str = ""
    attempt: int = 1


class MeasurementEntry(StrictSection):
    """One measurement with its limits; `value` is null where it could not be measured.

    `rule`, `tur` and `conformity` are the decision rule, the test uncertainty ratio and the
    conformity probability (JCGM 106), null where they do not apply.
    """

    name: str
    step: str
    value: float | None
    unit: str
    low: float | None
    high: float | None
    uncertainty: float | None
    guard_band: float | None
    rule: str | None = None
    tur: float | None = None
    conformity: float | None = None
    outcome: Outcome | None
    missed: Outcome | None
    description: str
    action: str
    attempt: int
    from_samples: bool
    note: str


class AchievedHeading(StrictSection):
    """Heading error of one method's coefficients on the verification poses."""

    level_rms_deg: float | None = None
    level_max_deg: float | None = None
    tilt_rms_deg: float | None = None
    tilt_max_deg: float | None = None


class FitEntry(StrictSection):
    """Result of one calibration method; a refused one has a cause and no coefficients."""

    method: str
    cause: str | None
    message: str
    samples: int
    offset_mg: Vector | None
    matrix: Matrix | None
    accel_offset_g: Vector | None
    accel_matrix: Matrix | None
    accel_from: str = ""
    field_mg: float | None
    dip_deg: float | None
    extended_dip_deg: Annotated[float, Strict(), Field(gt=-90.0, lt=90.0)] | None = None
    hk_mg: Vector | None = None
    parameters: list[str]
    covariance: list[list[float | None]] | None
    residual_rms_mg: float | None
    accel_residual_rms_g: float | None
    chi2_reduced: float | None
    dof: int | None
    rank: int | None
    condition: float | None
    coverage: float | None
    predicted_heading_rms_deg: float | None
    predicted_heading_max_deg: float | None
    extra: dict[str, float | None]
    achieved: AchievedHeading

    @model_validator(mode="after")
    def _coefficients_are_whole(self) -> Self:
        if self.matrix is not None and self.offset_mg is None:
            message = f"fit {self.method} with a matrix must have offset_mg"
            raise ValueError(message)
        if self.extended_dip_deg is not None and not (self.extra.get("horizontal_mg") or 0.0) > 0.0:
            message = f"fit {self.method} with an extended dip must have extra.horizontal_mg"
            raise ValueError(message)
        return self


class ReadingNoise(StrictSection):
    """RMS heading error that the noise of one pose's reading alone makes."""

    level_deg: float | None = None
    tilt_deg: float | None = None


class StudySection(StrictSection):
    """All methods on the verification poses: raw readings beside each method in each order.

    `tilt_from` says whose accelerometer coefficients a method used (`ranking.Study`). `expected`
    is what the unit's model said of raw readings and of every method before the verification
    (`expectation`), null where there was no model; `claim_without` what a method's own predicted
    error leaves out.
    """

    raw: AchievedHeading = AchievedHeading()
    tilt_from: dict[str, str] = {}
    orders: dict[str, dict[str, AchievedHeading]] = {}
    expected: dict[str, AchievedHeading] | None = None
    expected_noise: ReadingNoise = ReadingNoise()
    expected_zero_change_g: float = 0.0
    claim_without: dict[str, str] = {}


class ClaimEntry(StrictSection):
    """What the coefficients of the poses so far were claimed to be worth, after one pose."""

    position: int
    poses: int
    largest_deg: float
    sigma: float


class AdaptiveSection(StrictSection):
    """Poses that went on until the claimed heading error was small enough, and why they ended."""

    wanted_deg: float | None = None
    ended: Literal["", "wanted_reached", "most_poses", "fit_refused"] = ""
    claims: list[ClaimEntry] = []


class SpoiledEntry(StrictSection):
    """A dwell that a change of the field spoiled; `repeated_as` is the dwell in its place."""

    position: int
    step: str
    change_mg: float
    source: Literal["reference", "sentinel"]
    repeated_as: int | None = None


class SentinelEntry(StrictSection):
    """A visit to a sentinel pose: change of the module's raw field there since its first visit."""

    position: int
    step: str
    change_mg: float


class FieldWatchSection(StrictSection):
    """Whether the field was the same through the run, as seen by the source.

    Changes are the largest on any axis: `drift_mg` in the last good dwell, `largest_change_mg` in
    any, spoiled ones too. Spoiled positions and those of sentinels are used for nothing else.
    """

    source: Literal["reference", "sentinel", "none"] = "none"
    baseline_mg: Vector | None = None
    largest_change_mg: float | None = None
    drift_mg: float | None = None
    spoiled: list[SpoiledEntry] = []
    sentinels: list[SentinelEntry] = []


class VerdictSection(StrictSection):
    """The verdict in words."""

    outcome: Outcome
    reason: str
    next_action: str
    rule: str


class RecordDocument(StrictSection):
    """record.json as a whole."""

    schema_: Literal["compass-bench/record/1"] = Field(alias="schema")
    run: RunSection
    software: SoftwareSection
    config: ConfigSection
    bus: BusSection
    station: StationSection
    module: ModuleSection
    rig: dict[str, Any]
    poses: list[PoseEntry]
    steps: list[StepEntry]
    measurements: list[MeasurementEntry]
    fits: list[FitEntry]
    ranking: list[Any]
    study: StudySection = StudySection()
    bridge_terms: dict[str, BridgeTermEntry] = {}
    adaptive: AdaptiveSection = AdaptiveSection()
    uncertainty: UncertaintySection = UncertaintySection()
    field_watch: FieldWatchSection = FieldWatchSection()
    reversal: dict[str, Any] = {}
    coefficients: dict[str, Any]
    deviation: dict[str, dict[str, Any]]
    first_failure: str | None
    verdict: VerdictSection | None
    injected_faults: list[Any]
    files: dict[str, Any]


def read_record(run_dir: Path) -> dict[str, Any]:
    """Return the record of a run folder, checked against the schema.

    Raises
    ------
    ConfigError
        If there is no record, or it is not one of this schema.
    """
    path = run_dir / RECORD_FILE
    try:
        record: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as fault:
        message = f"{run_dir} must be the folder of a run; instead it has no {RECORD_FILE}"
        raise ConfigError(message) from fault
    except (OSError, ValueError) as fault:
        message = f"{path} must be a readable JSON document; instead received {fault}"
        raise ConfigError(message) from fault
    validate_record(record, str(path))
    return record


def validate_record(record: object, name: str = RECORD_FILE) -> None:
    """Check a record against the schema.

    Raises
    ------
    ConfigError
        If it does not fit; the sentence names the first entry that does not.
    """
    try:
        RecordDocument.model_validate(record)
    except ValidationError as fault:
        first = fault.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "the document"
        message = f"{name} must follow {SCHEMA}; instead {where}: {first['msg']}"
        raise ConfigError(message) from fault


def record_json_schema() -> dict[str, Any]:
    """Return the JSON Schema of record.json."""
    return RecordDocument.model_json_schema(by_alias=True)
