"""What a reversal says of the station's file: changes over their uncertainty, and new values.

A change is judged by its E_n number (ISO 13528:2022, 9.7): the difference of new and former value
over the root of the sum of the squares of both expanded uncertainties (k = 2). The limits say from
which number on the file is wrong.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Final

from bench.acceptance.measurement import Measurement
from bench.acceptance.site import calibration_data
from bench.calibration.reversal import COVERAGE_FACTOR, reversal
from bench.calibration.reversal_effects import BenchDoubts
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from bench.acceptance.site import SiteField
    from bench.calibration.mountings import Mounting
    from bench.calibration.reversal import Reversal
    from bench.station import Station

CHANGES: Final = {
    "seat_index_change": ("index",),
    "seat_level_change": ("pitch", "roll"),
    "fixture_iron_change": ("iron_x", "iron_y", "iron_z"),
    "field_azimuth_change": ("field_azimuth",),
    "dip_change": ("dip",),
}
"""Names of the measurements and what each is the largest of."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StationValue:
    """One value with its expanded uncertainty (k = 2), in deg or mG.

    `told` says whether the mountings told it; a former value is never.
    """

    value: float
    u: float
    unit: str
    told: bool = False


def former_values(station: Station) -> dict[str, StationValue]:
    """Return what the station's file says of seat and field, by the names of `CHANGES`."""
    seat = station.seat
    forward_mg, right_mg, down_mg = seat.iron_mg
    return {
        "index": StationValue(value=seat.index_deg, u=seat.u_index_deg, unit="deg"),
        "pitch": StationValue(value=seat.pitch_deg, u=seat.u_level_deg, unit="deg"),
        "roll": StationValue(value=seat.roll_deg, u=seat.u_level_deg, unit="deg"),
        "iron_x": StationValue(value=forward_mg, u=seat.u_iron_mg, unit="mG"),
        "iron_y": StationValue(value=right_mg, u=seat.u_iron_mg, unit="mG"),
        "iron_z": StationValue(value=down_mg, u=seat.u_iron_down_mg, unit="mG"),
        "field_azimuth": StationValue(
            value=station.field_azimuth_deg, u=station.u_field_azimuth_deg, unit="deg"
        ),
        "dip": StationValue(value=station.dip_deg, u=station.u_dip_deg, unit="deg"),
    }


def values_of(entry: Mapping[str, Mapping[str, Any]]) -> dict[str, StationValue]:
    """Return the values of a record's entry."""
    return {name: StationValue(**value) for name, value in entry.items()}


def doubts_of(station: Station, seating_u_deg: float) -> BenchDoubts:
    """Return the standard uncertainties that a reversal on a station has to live with.

    Parameters
    ----------
    station : Station
    seating_u_deg : float
        U (k = 2) of each of the three turns of a unit that is put in again.
    """
    around = station.surroundings
    return BenchDoubts(
        one_cycle_deg=around.u_one_cycle_deg / COVERAGE_FACTOR,
        two_cycle_deg=around.u_two_cycle_deg / COVERAGE_FACTOR,
        fine_deg=around.u_fine_deg / COVERAGE_FACTOR,
        squareness_deg=around.u_squareness_deg / COVERAGE_FACTOR,
        seating_deg=seating_u_deg / COVERAGE_FACTOR,
        drift_mg=around.u_drift_mg / COVERAGE_FACTOR,
        gradient_mg=around.u_gradient_mg / COVERAGE_FACTOR,
        strength=station.u_horizontal_mg / station.horizontal_mg / COVERAGE_FACTOR,
    )


def reversal_of(
    mounted: Sequence[tuple[Mounting, NDArray[np.void]]],
    site: SiteField,
    doubts: BenchDoubts,
    *,
    paired: bool = True,
) -> Reversal:
    """Return the reversal of the readings, one array of READING a mounting."""
    data = [
        (name, calibration_data(readings, site, paired=paired, in_seat=False))
        for name, readings in mounted
    ]
    return reversal(data, doubts=doubts, former=site.seat)


def found_values(found: Reversal, former: Mapping[str, StationValue]) -> dict[str, StationValue]:
    """Return the new values; what the mountings could not tell keeps its former value and U."""
    forward_mg, right_mg, down_mg = found.iron_mg
    values = {
        "index": found.index_deg,
        "pitch": found.pitch_deg,
        "roll": found.roll_deg,
        "iron_x": forward_mg,
        "iron_y": right_mg,
        "iron_z": down_mg,
        "field_azimuth": found.field_azimuth_deg,
        "dip": found.dip_deg,
    }
    return {
        name: StationValue(value=values[name], u=found.u[name], unit=before.unit, told=True)
        if name in found.u
        else before
        for name, before in former.items()
    }


def evaluate_reversal(
    step: str, found: Reversal, former: Mapping[str, StationValue]
) -> list[Measurement]:
    """Return what is judged of a reversal.

    - fit_accepted: 1, or 0 where it was refused, with the reason; then nothing else.
    - seat_index_change, seat_level_change, fixture_iron_change, field_azimuth_change,
      dip_change: E_n numbers, the largest of their parts; of what was told.
    - fit_residual (mG): RMS residual of the golden unit over all mountings.
    - seating (deg): how far a single mounting seems turned against the others.
    """
    if found.refused:
        note = f"reversal: {found.cause}: {found.message}"
        return [Measurement(name="fit_accepted", value=0.0, step=step, note=note)]
    note = "reversal" if not found.left_out else f"reversal, {found.left_out} poses left out"
    told = [Measurement(name="fit_accepted", value=1.0, step=step, note=note)]
    now = found_values(found, former)
    for name, parts in CHANGES.items():
        numbers = {part: change_over_u(former[part], now[part]) for part in parts if now[part].told}
        if not numbers:
            continue
        worst = max(numbers, key=lambda part: numbers[part])
        said = in_words(worst, former[worst], now[worst])
        told.append(Measurement(name=name, value=numbers[worst], step=step, note=said))
    seating_deg = max(found.seating_deg)
    return [
        *told,
        Measurement(name="fit_residual", value=found.residual_rms_mg, step=step, unit="mG"),
        Measurement(name="seating", value=seating_deg, step=step, unit="deg"),
    ]


def change_over_u(before: StationValue, now: StationValue) -> float:
    """Return the E_n number of a change.

    >>> before = StationValue(value=0.0, u=0.04, unit="deg")
    >>> round(change_over_u(before, StationValue(value=0.1, u=0.03, unit="deg")), 6)
    2.0
    """
    change = now.value - before.value
    if now.unit == "deg":
        change = float(wrap_180_deg(change))
    return abs(change) / max(math.hypot(before.u, now.u), 1e-9)


def in_words(name: str, before: StationValue, now: StationValue) -> str:
    """Return both values with their uncertainties."""
    digits = 3 if now.unit == "deg" else 2
    return (
        f"{name.replace('_', ' ')} {now.value:+.{digits}f} {now.unit} (U {now.u:.{digits}f}), "
        f"file {before.value:+.{digits}f} (U {before.u:.{digits}f})"
    )


def reversal_section(
    found: Reversal,
    former: Mapping[str, StationValue],
    doubts: BenchDoubts,
    mounted: Sequence[tuple[Mounting, NDArray[np.void]]],
) -> dict[str, Any]:
    """Return the record's section `reversal`."""
    positions = [
        {"mounting": name.value, "positions": [int(p) for p in readings["position"]]}
        for name, readings in mounted
    ]
    section: dict[str, Any] = {
        "mountings": positions,
        "doubts": asdict(doubts),
        "former": {name: asdict(value) for name, value in former.items()},
        "cause": found.cause,
        "message": found.message,
    }
    if found.refused:
        return section
    now = found_values(found, former)
    return section | {
        "found": {name: asdict(value) for name, value in now.items()},
        "budget": found.budget,
        "seating_deg": list(found.seating_deg),
        "chi2_reduced": found.chi2_reduced,
        "dof": found.dof,
        "left_out": found.left_out,
    }
