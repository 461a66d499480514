"""Seat index, fixture iron and field azimuth apart, by one unit in several mountings of one seat.

A run on one seat cannot tell a turned seat from a unit whose axes are turned, nor iron of the
fixture from that of the unit. Remounted by 180 deg the unit takes its own errors along and leaves
those of the seat behind. `turned` about down shows the seat's pitch and roll and the iron forward
and right; `turned_over` about forward shows index and pitch and the iron right and down. The
azimuth and the dip of the field are seen by the rig's tilts, in every mounting.

References
----------
.. [1] US Army TM 11-4920-292-15, Magnetic Compass Calibrator Set MC-2: the reference is mounted
   upside down, and half the difference of its indices is the error of the mounting.
.. [2] JCGM 100:2008 (GUM), 5.2 and F.1.2: uncertainties that readings share are not averaged.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.fit import rows_of
from bench.calibration.fixture import SQUARE
from bench.calibration.mountings import SEAT_FROM_UNIT, Mounting, nearest_mounting
from bench.calibration.reversal_effects import GROUPS, BenchDoubts, seating_axes
from bench.calibration.reversal_model import (
    SEAT,
    SEAT_NAMES,
    SeatState,
    mounted,
    seat_rotation,
)
from bench.calibration.reversal_solver import SeatSolution, solved_seat
from bench.calibration.truth_aided import fit_truth_aided

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData, Fit
    from bench.calibration.fixture import SeatPosition
    from bench.calibration.reversal_model import Mounted

COVERAGE_FACTOR: Final = 2.0
"""k of every expanded uncertainty, here and in the station's record."""
LARGEST_CHI2: Final = 4.0
"""Reduced chi-square from which on the readings contradict the model."""
_AZIMUTH, _DIP = 24, 25


class ReversalCause(StrEnum):
    """Why a reversal was refused."""

    TOO_FEW_MOUNTINGS = "too_few_mountings"
    NO_FIT = "no_fit"
    WRONG_MOUNTING = "wrong_mounting"
    NOT_CONVERGED = "not_converged"
    RESIDUAL_TOO_LARGE = "residual_too_large"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reversal:
    """What the mountings told; of a refused one only `cause` and `message` count.

    Attributes
    ----------
    index_deg, pitch_deg, roll_deg, iron_mg
        The seat; what is not in `observed` is the former value.
    field_azimuth_deg, dip_deg : float
        Field at the seat, against the rig's zero and the horizontal.
    u : dict
        Expanded uncertainty (k = 2) by name: `SEAT_NAMES` that were observed (deg, mG),
        ``field_azimuth`` and ``dip``.
    budget : dict
        For each name of `u`, the expanded uncertainty by group of effects, and ``noise``.
    gain, offset_mg : ndarray, shape (3, 3) and (3,)
        The unit's own coefficients, raw = gain @ v + offset, without the fixture.
    seating_deg : tuple of float
        How far each mounting seems turned against the others, in order.
    left_out : int
        Poses that contradicted the others of their mounting.
    """

    cause: ReversalCause | None = None
    message: str = ""
    index_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    iron_mg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    field_azimuth_deg: float = 0.0
    dip_deg: float = 0.0
    u: dict[str, float] = field(default_factory=dict)
    budget: dict[str, dict[str, float]] = field(default_factory=dict)
    gain: NDArray[np.float64] | None = None
    offset_mg: NDArray[np.float64] | None = None
    seating_deg: tuple[float, ...] = ()
    residual_rms_mg: float = 0.0
    chi2_reduced: float = 0.0
    dof: int = 0
    left_out: int = 0

    @property
    def refused(self) -> bool:
        """Whether there is no result."""
        return self.cause is not None

    @property
    def observed(self) -> tuple[str, ...]:
        """Names of the seat's parameters that the mountings told."""
        return tuple(name for name in SEAT_NAMES if name in self.u)


def reversal(
    mountings: Sequence[tuple[Mounting, CalibrationData]],
    *,
    doubts: BenchDoubts | None = None,
    former: SeatPosition = SQUARE,
) -> Reversal:
    """Separate the seat from the unit.

    One generalised least squares over all poses of all mountings: 24 coefficients of the unit,
    field azimuth and dip, two levels of the base, three angles and three iron components of the
    seat. Encoder, squareness, seating, field and what a linear sensor is not are random effects
    that poses share (`reversal_effects`); the covariance is scaled by chi-square where that
    exceeds one.

    Parameters
    ----------
    mountings : sequence of (Mounting, CalibrationData)
        In order; rows are poses with the rig's own angles, acceleration and station's field.
    doubts : BenchDoubts, optional
        Standard uncertainties of the station.
    former : SeatPosition, optional
        Seat of the station's file: start, and value of what cannot be separated.

    Returns
    -------
    Reversal
        Refused with TOO_FEW_MOUNTINGS, NO_FIT (a mounting alone gives no calibration),
        WRONG_MOUNTING (the unit sits otherwise than was said), NOT_CONVERGED or
        RESIDUAL_TOO_LARGE.
    """
    if len({name for name, _ in mountings}) < 2:
        message = "a reversal needs at least two different mountings of the unit"
        return Reversal(cause=ReversalCause.TOO_FEW_MOUNTINGS, message=message)
    doubts = doubts or BenchDoubts()
    kept, fits = [], []
    for name, data in mountings:
        fit = fit_truth_aided(data)
        wrong = _not_usable(name, fit, data)
        if wrong is not None:
            return wrong
        kept.append((name, _undisturbed(data, fit)))
        fits.append(fit)
    first_name, first = mountings[0]
    assert first.station_field_mg is not None  # noqa: S101
    together = mounted(kept, float(np.linalg.norm(first.station_field_mg)))
    solution = solved_seat(_start(fits[0], first_name, former), together, doubts)
    left_out = sum(len(data) for _, data in mountings) - len(together.raw)
    return _result(solution, together, doubts, left_out)


def _not_usable(name: Mounting, fit: Fit, data: CalibrationData) -> Reversal | None:
    if fit.refused or data.accel_g is None or data.station_field_mg is None:
        message = f"mounting {name}: " + (
            f"{fit.cause}: {fit.message}"
            if fit.refused
            else "a reversal needs acceleration and the station's field"
        )
        return Reversal(cause=ReversalCause.NO_FIT, message=message)
    assert fit.matrix is not None  # noqa: S101
    left, _, right = np.linalg.svd(np.linalg.inv(fit.matrix))
    found, _ = nearest_mounting(left @ right)
    if found is not name:
        message = (
            f"the unit must sit {_words(name)}; instead its readings say {_words(found)}: "
            "put it in again and repeat"
        )
        return Reversal(cause=ReversalCause.WRONG_MOUNTING, message=message)
    return None


def _words(name: Mounting) -> str:
    return name.value.replace("_", " ")


def _undisturbed(data: CalibrationData, fit: Fit) -> CalibrationData:
    """Return the poses that the fit of their mounting did not leave out as disturbed."""
    parts = [key.split("_") for key in fit.extra if key.startswith("disturbed_")]
    out = [int(each[1]) for each in parts if each[-1] == "sigmas"]
    return rows_of(data, ~np.isin(np.arange(len(data)), out)) if out else data


def _start(fit: Fit, name: Mounting, former: SeatPosition) -> SeatState:
    """Return the state that the first mounting's own fit gives, with the former seat."""
    assert fit.matrix is not None  # noqa: S101
    assert fit.offset_mg is not None  # noqa: S101
    assert fit.accel_matrix is not None  # noqa: S101
    assert fit.accel_offset_g is not None  # noqa: S101
    seat = seat_rotation(former.index_deg, former.pitch_deg, former.roll_deg)
    iron_mg = np.array(former.iron_mg, dtype=float)
    seat_unit = SEAT_FROM_UNIT[name]
    gain = np.linalg.inv(fit.matrix) @ seat @ seat_unit
    return SeatState(
        gain=gain,
        offset_mg=fit.offset_mg - gain @ seat_unit.T @ iron_mg,
        accel_gain=np.linalg.inv(fit.accel_matrix) @ seat @ seat_unit,
        accel_offset_g=np.array(fit.accel_offset_g, dtype=float),
        azimuth_rad=float(np.deg2rad(fit.extra["field_azimuth_deg"])),
        dip_rad=float(np.deg2rad(fit.extra["dip_deg"])),
        north_rad=float(np.deg2rad(fit.extra["base_level_north_deg"])),
        east_rad=float(np.deg2rad(fit.extra["base_level_east_deg"])),
        inner_from_seat=seat,
        iron_mg=iron_mg,
    )


def _result(solution: SeatSolution, data: Mounted, doubts: BenchDoubts, left_out: int) -> Reversal:
    if not solution.converged:
        message = "the reversal did not settle: the rig's angles do not match the readings"
        return Reversal(cause=ReversalCause.NOT_CONVERGED, message=message)
    if solution.chi2_reduced > LARGEST_CHI2:
        message = (
            f"the mountings contradict each other (chi-square {solution.chi2_reduced:.1f} for each "
            f"degree of freedom, at most {LARGEST_CHI2:g}): the field changed, or the unit did "
            "not sit firmly"
        )
        return Reversal(
            cause=ReversalCause.RESIDUAL_TOO_LARGE,
            message=message,
            chi2_reduced=solution.chi2_reduced,
        )
    state = solution.state
    index_deg, pitch_deg, roll_deg = state.seat_deg()
    iron = state.iron_mg
    field_residual = data.raw[:, :3] - solution.rows.modelled[:, :3]
    u, budget = _uncertainties(solution, doubts)
    return Reversal(
        index_deg=index_deg,
        pitch_deg=pitch_deg,
        roll_deg=roll_deg,
        iron_mg=(float(iron[0]), float(iron[1]), float(iron[2])),
        field_azimuth_deg=float(np.rad2deg(state.azimuth_rad)),
        dip_deg=float(np.rad2deg(state.dip_rad)),
        u=u,
        budget=budget,
        gain=state.gain,
        offset_mg=state.offset_mg,
        seating_deg=_seating_deg(solution, data, doubts),
        residual_rms_mg=float(np.sqrt((field_residual**2).mean())),
        chi2_reduced=solution.chi2_reduced,
        dof=solution.dof,
        left_out=left_out,
    )


def _uncertainties(
    solution: SeatSolution, doubts: BenchDoubts
) -> tuple[dict[str, float], dict[str, dict[str, float]]]:
    """Return U (k = 2) of everything that was told, and its parts."""
    names = {_AZIMUTH: "field_azimuth", _DIP: "dip"}
    names |= {SEAT.start + at: name for at, name in enumerate(SEAT_NAMES)}
    widened = max(solution.chi2_reduced, 1.0)
    u, budget = {}, {}
    for at, column in enumerate(solution.free):
        name = names.get(int(column))
        if name is None:
            continue
        iron = name.startswith("iron")
        unit = COVERAGE_FACTOR * (1.0 if iron else float(np.rad2deg(1.0)))
        iron_mg = float(solution.state.iron_mg["xyz".index(name[-1])]) if iron else 0.0
        strength = iron_mg * doubts.strength
        variance = solution.covariance[at, at] * widened + strength**2
        u[name] = unit * float(np.sqrt(variance))
        moved = {
            group: float(np.linalg.norm(solution.estimator[at] @ solution.effect.of(group)))
            for group in GROUPS
        }
        rest = max(float(variance) - sum(part**2 for part in moved.values()), 0.0)
        parts = {**moved, "noise": float(np.sqrt(rest))}
        budget[name] = {group: unit * part for group, part in parts.items()}
    return u, budget


def _seating_deg(solution: SeatSolution, data: Mounted, doubts: BenchDoubts) -> tuple[float, ...]:
    """Return the likeliest turn of each mounting against the others, degrees."""
    columns = seating_axes(solution.effect, len(data.names))
    turns = solution.effect.columns[:, columns.ravel()].T @ solution.weighted
    turns_deg = doubts.seating_deg * turns.reshape(columns.shape)
    return tuple(float(np.linalg.norm(turn)) for turn in turns_deg)
