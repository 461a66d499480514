"""Skula's Fig. 1: the set/reset routine, and what equation (1) makes of a turn."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from bench.calibration.set_reset import check_set_reset
from bench.pose import Attitude
from bench.reproduction.setup import Setup
from bench.reproduction.turns import turn

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from bench.reproduction.laboratory import OpenLaboratory

BRIDGE_MG: Final = 60.0
MODULE: Final = Setup(offset_mg=(BRIDGE_MG, -40.0, 0.0))
FILM: Final = replace(MODULE, hard_iron_mg=(100.0, 80.0, 0.0), hk_mg=8000.0)
"""A film of 8 G and hard iron of 100 and 80 mG."""
POSITIONS: Final = 36
LISTENED_S: Final = 0.2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Routine:
    """Set and reset readings of x.

    Attributes
    ----------
    t_s, set_mg, reset_mg : ndarray, shape (n,)
        Measuring cycles of a module at rest.
    offset_mg : float
        Mean of (set + reset)/2 of them: V_off of (1).
    azimuth_deg, plain_mg, crossed_mg : ndarray, shape (m,)
        (set + reset)/2 over a turn, without and with the cross-axis term.
    regressed_mg : float
        Offset of the bridge by the product's regression of `crossed_mg`.
    """

    t_s: NDArray[np.float64]
    set_mg: NDArray[np.float64]
    reset_mg: NDArray[np.float64]
    offset_mg: float
    azimuth_deg: NDArray[np.float64]
    plain_mg: NDArray[np.float64]
    crossed_mg: NDArray[np.float64]
    regressed_mg: float


def measured_routine(open_laboratory: OpenLaboratory) -> Routine:
    """Hear a module at rest, and turn it with and without the cross-axis term."""
    with open_laboratory(MODULE) as laboratory:
        laboratory.rig.move_to(Attitude(azimuth_deg=40.0))
        samples = laboratory.listen(LISTENED_S)
        plain = laboratory.measure(turn(POSITIONS))
    with open_laboratory(FILM) as laboratory:
        crossed = laboratory.measure(turn(POSITIONS))
    check = check_set_reset(crossed["set_mg"], crossed["reset_mg"])
    set_mg, reset_mg = samples["set_mg"][:, 0], samples["reset_mg"][:, 0]
    return Routine(
        t_s=samples["t_s"],
        set_mg=set_mg,
        reset_mg=reset_mg,
        offset_mg=float((set_mg + reset_mg).mean()) / 2.0,
        azimuth_deg=plain["rig_azimuth_deg"],
        plain_mg=plain["offset_mg"][:, 0],
        crossed_mg=crossed["offset_mg"][:, 0],
        regressed_mg=float(check.bridge_offset_mg[0]),
    )
