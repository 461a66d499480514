"""Caruso, "Applications of Magnetic Sensors for Low Cost Compass Systems", on the virtual bench.

Where nothing else is said the site's horizontal field is 200 mG, as in the paper.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from bench.reproduction.caruso_acceleration import reproduce_acceleration
from bench.reproduction.caruso_iron import reproduce_iron
from bench.reproduction.caruso_motions import reproduce_motions
from bench.reproduction.caruso_resolution import reproduce_resolution
from bench.reproduction.caruso_table_1 import reproduce_budget
from bench.reproduction.caruso_temperature import reproduce_temperature
from bench.reproduction.caruso_tilt import reproduce_tilt
from bench.reproduction.caruso_tilt_errors import reproduce_tilt_errors
from bench.reproduction.caruso_transfer import reproduce_transfer
from bench.reproduction.caruso_variation import reproduce_variation
from bench.reproduction.result import Reproduction

if TYPE_CHECKING:
    from bench.reproduction.laboratory import OpenLaboratory

TITLE: Final = (
    'M. J. Caruso, "Applications of Magnetic Sensors for Low Cost Compass Systems", PLANS 2000'
)
SECTIONS: Final = (
    reproduce_tilt,
    reproduce_resolution,
    reproduce_budget,
    reproduce_transfer,
    reproduce_temperature,
    reproduce_iron,
    reproduce_motions,
    reproduce_tilt_errors,
    reproduce_variation,
    reproduce_acceleration,
)
"""The paper's sections, in its order."""
SETUP: Final = (
    "Setup, where a figure says nothing else: 200 mG horizontally, a converter of 16 bits over "
    "+-800 mG, set/reset pairs, five pairs a pose, and no error but the one that is studied. "
    "Headings are those of the product's own compensation."
)


def reproduce(open_laboratory: OpenLaboratory) -> Reproduction:
    """Measure and judge the paper's numbers and figures."""
    parts = [section(open_laboratory) for section in SECTIONS]
    return Reproduction(
        paper="caruso",
        title=TITLE,
        numbers=[number for part in parts for number in part.numbers],
        figures=[figure for part in parts for figure in part.figures],
        remarks=[SETUP, *(remark for part in parts for remark in part.remarks)],
    )
