"""Caruso, variation of the Earth's field: declination and the geomagnetic pole."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.geomagnetic import EPOCH, geomagnetic_pole_deg, true_heading_deg
from bench.reproduction.caruso_turn import COUNTS, HORIZONTAL_MG, section
from bench.reproduction.result import Published, claimed_zero
from bench.reproduction.setup import Setup
from bench.reproduction.turns import error_deg, largest, turn

if TYPE_CHECKING:
    from bench.reproduction.laboratory import OpenLaboratory
    from bench.reproduction.result import Reproduction

EAST_DEG: Final = (25.0, -25.0)
"""Declinations: 'sometimes being as large as 25 deg', easterly and westerly."""
WHERE: Final = "Variation of the Earth's field"


def reproduce_variation(open_laboratory: OpenLaboratory) -> Reproduction:
    """Measure true headings by the printed rule and by ours."""
    numbers = []
    for east_deg in EAST_DEG:
        printed_deg, ours_deg = _left_deg(open_laboratory, east_deg)
        side = "easterly" if east_deg > 0.0 else "westerly"
        numbers += [
            claimed_zero(
                WHERE,
                f"error by the printed rule, 25 deg {side}",
                "deg",
                printed_deg,
                COUNTS,
                exact=2.0 * abs(east_deg),
                note="'add if Westerly, subtract if Easterly' is the wrong way round",
            ),
            claimed_zero(
                WHERE,
                f"error of magnetic + east declination, 25 deg {side}",
                "deg",
                ours_deg,
                COUNTS,
            ),
        ]
    numbers.append(_pole_number())
    remarks = [
        "True heading is magnetic heading plus declination, east positive; the printed rule errs "
        f"by twice the declination, {numbers[0].ours:.1f} deg where it is 25 deg.",
    ]
    return section(numbers, [], remarks)


def _left_deg(open_laboratory: OpenLaboratory, east_deg: float) -> tuple[float, float]:
    """Return the largest error of the printed rule and of ours; the rig's zero is true north."""
    setup = Setup(horizontal_mg=HORIZONTAL_MG, declination_deg=east_deg)
    with open_laboratory(setup) as laboratory:
        readings = laboratory.measure(turn(8))
    magnetic_deg = compensated_heading_deg(None, readings["field_mg"], readings["accel_g"])
    printed_deg = magnetic_deg - east_deg
    ours_deg = true_heading_deg(magnetic_deg, east_deg)
    return largest(error_deg(printed_deg, readings)), largest(error_deg(ours_deg, readings))


def _pole_number() -> Published:
    latitude_deg, _ = geomagnetic_pole_deg(EPOCH)
    return Published(
        where=WHERE,
        quantity="angle between the geomagnetic and the geographic pole, in 2025",
        unit="deg",
        published=11.5,
        ours=90.0 - latitude_deg,
        tolerance=0.06,
        reason="the pole of 2025 is published to 0.1 deg",
        exact=9.2,
        note="from the coefficients of the World Magnetic Model, not from the bench; the angle "
        "was 11.5 in the 1960s and 10.5 in 2000, the paper's year",
    )
