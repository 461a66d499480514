"""The azimuths at which a tilt says nothing of the dip; Cho & Park do not mention them.

By how many degrees a heading from two axes moves for a degree of dip is measured at each
attitude: where it does not move, (26) divides zero by zero, and where it moves by g, an azimuth
that is wrong by e makes the angle wrong by e / g.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.fit import Fit
from bench.pose import Attitude
from bench.reproduction.cho_park_table import HORIZONTAL_MG, SITE_DIP_DEG
from bench.reproduction.setup import Setup
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.reproduction.laboratory import Laboratory

AZIMUTH_DEG: Final = np.arange(0.0, 361.0, 45.0)
TILT_DEG: Final = np.arange(-60.0, 61.0, 20.0)
CUT_DEG: Final = 30.0
CUT_AZIMUTH_DEG: Final = np.arange(0.0, 360.0, 15.0)
DIP_STEP_DEG: Final = 0.5
PERFECT: Final = Setup(part="CB-AMR2", horizontal_mg=HORIZONTAL_MG, dip_deg=SITE_DIP_DEG)
_FIT: Final = Fit(
    method="two_axis",
    offset_mg=np.zeros(3),
    matrix=np.eye(3),
    extended_dip_deg=SITE_DIP_DEG,
    extra={"horizontal_mg": HORIZONTAL_MG},
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlindMap:
    """Heading over dip, deg per deg, measured.

    Attributes
    ----------
    by_pitch, by_roll : ndarray, shape (9, 7)
        At `AZIMUTH_DEG` and `TILT_DEG`.
    cuts : dict
        At `CUT_AZIMUTH_DEG` for a tilt of 30 deg: "pitch", "roll", "pitch and roll".
    """

    by_pitch: NDArray[np.float64]
    by_roll: NDArray[np.float64]
    cuts: dict[str, NDArray[np.float64]]

    def blind_deg(self, cut: str) -> NDArray[np.float64]:
        """Return the azimuths in [0, 360) where a cut passes through zero."""
        from scipy.interpolate import CubicSpline

        azimuth_deg = np.append(CUT_AZIMUTH_DEG, 360.0)
        values = np.append(self.cuts[cut], self.cuts[cut][0])
        roots = CubicSpline(azimuth_deg, values, bc_type="periodic").roots(extrapolate=False)
        return np.unique(np.asarray(roots).round(6) % 360.0)


def map_blind_azimuths(lab: Laboratory) -> BlindMap:
    """Measure the maps on a module without errors."""
    cuts = {"pitch": (1.0, 0.0), "roll": (0.0, 1.0), "pitch and roll": (1.0, 1.0)}
    return BlindMap(
        by_pitch=_map(lab, 1.0, 0.0),
        by_roll=_map(lab, 0.0, 1.0),
        cuts={
            name: _heading_by_dip(
                lab, [_pose(a, CUT_DEG * pitch, CUT_DEG * roll) for a in CUT_AZIMUTH_DEG]
            )
            for name, (pitch, roll) in cuts.items()
        },
    )


def _map(lab: Laboratory, pitch: float, roll: float) -> NDArray[np.float64]:
    """Measure one axis' map, up and down in turns so that the rig travels little."""
    rows = []
    for index, azimuth_deg in enumerate(AZIMUTH_DEG):
        order = slice(None, None, -1 if index % 2 else 1)
        poses = [_pose(azimuth_deg, pitch * t, roll * t) for t in TILT_DEG[order]]
        rows.append(_heading_by_dip(lab, poses)[order])
    return np.array(rows)


def _pose(azimuth_deg: float, pitch_deg: float, roll_deg: float) -> Attitude:
    return Attitude(
        azimuth_deg=float(azimuth_deg), pitch_deg=float(pitch_deg), roll_deg=float(roll_deg)
    )


def _heading_by_dip(lab: Laboratory, poses: Sequence[Attitude]) -> NDArray[np.float64]:
    readings = lab.measure(poses, dwell_s=0.03)
    low, high = (
        compensated_heading_deg(
            replace(_FIT, extended_dip_deg=SITE_DIP_DEG + step_deg),
            readings["field_mg"],
            readings["accel_g"],
        )
        for step_deg in (-DIP_STEP_DEG, DIP_STEP_DEG)
    )
    return wrap_180_deg(high - low) / (2.0 * DIP_STEP_DEG)
