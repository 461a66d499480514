"""What a procedure will do, without a bus: poses, travel, time, cable, load, accuracy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from bench.errors import ConfigError
from bench.pose import Attitude
from bench.steps.adaptive_poses import AdaptivePoses
from bench.steps.fit import FitMethods
from bench.steps.poses import Poses
from bench.steps.sweep import Sweep
from bench.travel import RIG_PROFILE, SETTLE_S, azimuth_path_deg, require_reachable, travel_time_s

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from bench.calibration.method_names import MethodName
    from bench.calibration.planned_poses import Prediction
    from bench.procedure import Procedure
    from bench.station import Station
    from bench.steps.step import PlannedPose, Step

LEVEL_ONLY: Final[frozenset[MethodName]] = frozenset(
    {"set_reset", "min_max", "four_position", "soft_iron", "three_headings"}
)
"""Methods whose prediction is for a level module: they calibrate neither z nor the tilt."""
LOAD_LIMIT_PERCENT: Final = 70.0
"""Most load at worst-case stuffing that a procedure may start on."""
SAMPLES_PER_S: Final = 100.0
BITRATE: Final = 500_000
STANDARD_LENGTH: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedMove:
    """One dwell with the way to it.

    Attributes
    ----------
    azimuth_wound_deg : float
        Azimuth with whole turns, as the cable sees it.
    travel_s, dwell_s : float
        Time of the move with settling, and of the dwell.
    """

    position: int
    step: str
    attitude: Attitude
    direction: int
    azimuth_wound_deg: float
    travel_s: float
    dwell_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedStep:
    """One step with its number of dwells and its time.

    `most_poses` and `longest_s` differ from those to expect where the run decides itself when to
    end.
    """

    name: str
    kind: str
    poses: int
    duration_s: float
    most_poses: int
    longest_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A procedure laid out.

    Attributes
    ----------
    duration_s : float
        Expected time of the whole run, parking included.
    longest_s : float
        The same where every step that decides itself when to end goes on to its most poses.
    wound_low_deg, wound_high_deg : float
        How far the azimuth winds the cable.
    samples : int
        Samples that the dwells will hold.
    """

    procedure: str
    version: str
    steps: tuple[PlannedStep, ...]
    moves: tuple[PlannedMove, ...]
    duration_s: float
    longest_s: float
    wound_low_deg: float
    wound_high_deg: float
    samples: int


def plan_of(procedure: Procedure, *, with_reference: bool = True) -> Plan:
    """Lay a procedure out.

    Where the station has no reference magnetometer, sentinel poses are visited as well.

    Raises
    ------
    ConfigError
        If a pose is outside the rig's limits.
    """
    steps: list[PlannedStep] = []
    moves: list[PlannedMove] = []
    present = Attitude(azimuth_deg=0.0)
    for step in procedure.walk():
        if step.children():
            continue
        dwells = step.dwells(with_reference=with_reference)
        own = _moves(len(moves), step, dwells, present)
        most = own
        if isinstance(step, AdaptivePoses):
            most = _moves(len(moves), step, step.longest_poses(), present)
        steps.append(
            PlannedStep(
                name=step.name,
                kind=step.kind,
                poses=len(own),
                duration_s=step.duration_s() + _seconds(own),
                most_poses=len(most),
                longest_s=step.duration_s() + _seconds(most),
            )
        )
        moves += own
        present = _wound(own[-1]) if own else present
    parking_s = travel_time_s(present, Attitude(azimuth_deg=0.0)) if moves else 0.0
    wound_deg = [0.0, *(move.azimuth_wound_deg for move in moves)]
    return Plan(
        procedure=procedure.name,
        version=procedure.version,
        steps=tuple(steps),
        moves=tuple(moves),
        duration_s=sum(step.duration_s for step in steps) + parking_s,
        longest_s=sum(step.longest_s for step in steps) + parking_s,
        wound_low_deg=min(wound_deg),
        wound_high_deg=max(wound_deg),
        samples=round(sum(move.dwell_s for move in moves) * SAMPLES_PER_S),
    )


def _moves(
    position: int, step: Step, poses: Sequence[PlannedPose], present: Attitude
) -> list[PlannedMove]:
    moves: list[PlannedMove] = []
    for pose in poses:
        moves.append(_move(position + len(moves), step, pose, present))
        present = _wound(moves[-1])
    return moves


def _seconds(moves: Iterable[PlannedMove]) -> float:
    return sum(move.travel_s + move.dwell_s for move in moves)


def _move(position: int, step: Step, pose: PlannedPose, present: Attitude) -> PlannedMove:
    try:
        require_reachable(pose.attitude)
    except ConfigError as error:
        message = f"step {step.name}: {error}"
        raise ConfigError(message) from error
    direction = pose.direction or None
    path = azimuth_path_deg(present.azimuth_deg, pose.attitude.azimuth_deg, direction)
    return PlannedMove(
        position=position,
        step=step.name,
        attitude=pose.attitude,
        direction=pose.direction,
        azimuth_wound_deg=path[-1],
        travel_s=travel_time_s(present, pose.attitude, direction, RIG_PROFILE) + SETTLE_S,
        dwell_s=pose.dwell_s,
    )


def _wound(move: PlannedMove) -> Attitude:
    return Attitude(
        azimuth_deg=move.azimuth_wound_deg,
        pitch_deg=move.attitude.pitch_deg,
        roll_deg=move.attitude.roll_deg,
    )


def calibration_attitudes(procedure: Procedure) -> list[Attitude]:
    """Return the attitudes that the procedure's fits will see, as far as they can be foreseen."""
    return [
        pose.attitude
        for step in procedure.walk()
        if isinstance(step, Sweep | Poses | AdaptivePoses)
        for pose in step.poses()
    ]


def predictions(
    procedure: Procedure, station: Station, *, judged_only: bool = False
) -> list[Prediction]:
    """Return what each method of the procedure can observe on its poses, and how well.

    Nothing is returned for a procedure without calibration poses or fits; with `judged_only`,
    only the methods that a fit judges.
    """
    import numpy as np

    from bench.acceptance.site import field_rig_mg
    from bench.calibration.fit import (
        POSE_ACCEL_SD_G,
        POSE_FIELD_SD_MG,
        POSE_RIG_SD_DEG,
        CalibrationData,
    )
    from bench.calibration.planned_poses import predict

    attitudes = calibration_attitudes(procedure)
    if not attitudes:
        return []
    like = CalibrationData(
        field_mg=np.zeros((len(attitudes), 3)),
        accel_g=np.zeros((len(attitudes), 3)),
        offset_mg=np.zeros((len(attitudes), 3)),
        field_sd_mg=POSE_FIELD_SD_MG,
        accel_sd_g=POSE_ACCEL_SD_G,
        rig_sd_deg=POSE_RIG_SD_DEG,
        station_field_mg=field_rig_mg(station),
    )
    methods = dict.fromkeys(
        name
        for step in procedure.walk()
        if isinstance(step, FitMethods)
        for name in (step.judged if judged_only else step.methods)
    )
    return [predict(attitudes, name, like) for name in methods]


def require_observable(procedure: Procedure, predicted: Iterable[Prediction]) -> None:
    """Check that perfect readings at the planned poses would be accepted where a fit is judged.

    Raises
    ------
    ConfigError
        If every judged method of a fit would refuse them, for instance at tilts whose azimuths
        are all blind for the dip.
    """
    by_method = {prediction.method: prediction for prediction in predicted}
    for step in procedure.walk():
        if not isinstance(step, FitMethods) or not by_method:
            continue
        refused = [by_method[name] for name in step.judged if by_method[name].cause is not None]
        if len(refused) == len(step.judged):
            message = (
                f"step {step.name}: poses must suffice for a judged method; instead "
                f"{refused[0].method} would refuse them ({refused[0].cause}): {refused[0].message}"
            )
            raise ConfigError(message)


def expected_load_percent(
    *,
    modules: int = 1,
    module_rate_hz: float = 100.0,
    with_rig: bool = True,
    with_reference: bool = True,
    bitrate: int = BITRATE,
) -> float:
    """Return the load of one bus at worst-case stuffing, in per cent.

    Every module sends four protected frames a cycle, status and vehicle direction at 10 Hz;
    SYNC, three drives' positions and the reference magnetometer's field come at 100 Hz,
    heartbeats at 10 and 2 Hz.
    """
    from protocols.bus_load import bus_load_percent

    frames = _frames(modules, module_rate_hz, with_rig=with_rig)
    if with_reference:
        from protocols.reference_field import REFERENCE_ADDRESS, reference_field_id

        frames[reference_field_id(REFERENCE_ADDRESS)] = (STANDARD_LENGTH, 100.0)
    return bus_load_percent(frames, bitrate, worst=True)


def require_load(load_percent: float) -> None:
    """Check the expected load.

    Raises
    ------
    ConfigError
        If it is above `LOAD_LIMIT_PERCENT`.
    """
    if load_percent > LOAD_LIMIT_PERCENT:
        message = (
            f"bus load must be at most {LOAD_LIMIT_PERCENT:g} % at worst-case stuffing; instead "
            f"received {load_percent:.0f} %: raise the bitrate, "
            "slow the modules down or use a second bus"
        )
        raise ConfigError(message)


def _frames(modules: int, module_rate_hz: float, *, with_rig: bool) -> dict[int, tuple[int, float]]:
    from protocols.canopen import AXIS_NODES, BENCH_NODE, heartbeat_id
    from protocols.compass import (
        STATUS_PERIOD_TICKS,
        acceleration_id,
        heading_id,
        mag_reset_id,
        mag_set_id,
        status_id,
        vehicle_direction_id,
    )
    from protocols.j1939 import MODULE_ADDRESS
    from protocols.sync import SYNC_ID

    cyclic = (mag_set_id, mag_reset_id, acceleration_id, heading_id)
    slow = (status_id, vehicle_direction_id)
    frames: dict[int, tuple[int, float]] = {SYNC_ID: (1, 100.0)}
    frames[heartbeat_id(BENCH_NODE)] = (1, 10.0)
    for address in range(MODULE_ADDRESS, MODULE_ADDRESS + modules):
        frames |= {make(address): (STANDARD_LENGTH, module_rate_hz) for make in cyclic}
        slow_hz = min(module_rate_hz, 100.0 / STATUS_PERIOD_TICKS)
        frames |= {make(address): (STANDARD_LENGTH, slow_hz) for make in slow}
    if with_rig:
        from protocols.canopen import tpdo1_id

        frames |= {tpdo1_id(node): (6, 100.0) for node in AXIS_NODES}
        frames |= {heartbeat_id(node): (1, 2.0) for node in AXIS_NODES}
    return frames
