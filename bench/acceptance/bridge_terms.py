"""Terms of the bridges that a run can see: what they are, how sure, and whether they are corrected.

The cross-axis term is taken out of every calibration reading and, by the same coefficients, in the
module. Hysteresis and temperature are told with their standard deviations for the uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.acceptance.site import (
    expected_field_mg,
    expected_force_g,
    is_level,
    total_field_mg,
)
from bench.calibration.cross_axis import corrected, cross_axis_of, knowing
from bench.calibration.hysteresis import hysteresis_of
from bench.calibration.methods import fit_named
from bench.calibration.temperature import (
    accel_drift_g_per_c,
    offset_tempco_mg_per_c,
    sensitivity_tempco_per_c,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from bench.acceptance.site import SiteField
    from bench.calibration.cross_axis import CrossAxis
    from bench.calibration.fit import CalibrationData, Fit
    from bench.calibration.temperature import Tempco
    from bench.pose import Pose

PLAY_STAYS: Final = (
    "the module does not know from which side a field came, and in the calibration alone the "
    "estimate's own error costs more than the play"
)
OFFSET_CANCELS: Final = "it cancels in half the difference of set and reset"
GAIN_CANCELS: Final = "common to the axes it cancels in the heading; the module has no coefficient"
DRIFT_WANDERS: Final = (
    "a run cannot tell it from the wander of the zero; the module has no coefficient"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeTerm:
    """One term by axis (or for all axes): None where the run cannot see it.

    `why_not` says why it is not corrected, or which axes are not; empty where all are.
    """

    value: tuple[float | None, ...]
    sd: tuple[float | None, ...]
    corrected: bool = False
    why_not: str = ""


class CorrectedFits:
    """Fits of calibration readings without their cross-axis term, each knowing it.

    Parameters
    ----------
    data : CalibrationData
        As read.
    cross : CrossAxis, optional
        What is taken out; by default what the readings themselves tell.
    """

    def __init__(self, data: CalibrationData, cross: CrossAxis | None = None) -> None:
        self.cross = cross_axis_of(data) if cross is None else cross
        self.data = corrected(data, self.cross)

    def fit(self, name: str) -> Fit:
        """Return one method's fit, to be applied to raw readings.

        Raises
        ------
        ValueError
            See `fit_named`.
        """
        return knowing(fit_named(name, self.data), self.cross)


def cross_axis_term(cross: CrossAxis) -> BridgeTerm:
    """Return the anisotropy fields of x, y and z, in mG."""
    whys = [f"{axis}: {why}" for axis, why in zip("xyz", cross.why_not, strict=True) if why]
    same = len(set(cross.why_not)) == 1
    return BridgeTerm(
        value=_listed(cross.seen_mg),
        sd=_listed(cross.sd_mg),
        corrected=cross.corrected,
        why_not=cross.why_not[0] if same else "; ".join(whys),
    )


def calibration_terms(
    readings: NDArray[np.void], poses: Sequence[Pose], cross: CrossAxis
) -> dict[str, BridgeTerm]:
    """Return hk_mg and hysteresis_mg of a calibration's readings.

    Parameters
    ----------
    readings : ndarray of READING, shape (n,)
    poses : sequence of Pose
        Of the run; the level ones approached from both sides tell the play.
    """
    direction_of = {pose.position: pose.direction for pose in poses}
    direction = np.array([direction_of.get(int(p), 0) for p in readings["position"]], dtype=int)
    swept = is_level(readings) & (direction != 0)
    level = readings[swept]
    play = hysteresis_of(level["field_mg"], level["rig_azimuth_deg"], direction[swept])
    return {
        "hk_mg": cross_axis_term(cross),
        "hysteresis_mg": BridgeTerm(
            value=_listed(play.half_width_mg), sd=_listed(play.sd_mg), why_not=PLAY_STAYS
        ),
    }


def temperature_terms(
    readings: NDArray[np.void], fit: Fit | None, site: SiteField, *, drift_sd_mg: float = 0.0
) -> dict[str, BridgeTerm]:
    """Return the temperature coefficients that readings in the order of a run tell.

    Parameters
    ----------
    readings : ndarray of READING, shape (n,)
        All of them: calibration, verification and returns.
    fit : Fit or None
        Accepted fit over three axes; without one the bridge offsets alone are told.
    drift_sd_mg : float
        Standard deviation of the station's field over a run.

    Returns
    -------
    dict
        offset_tempco_mg_per_c by axis, sensitivity_tempco_per_c of all axes (relative), and
        accel_drift_mg_per_c by axis (milli-g).
    """
    temperature_c = readings["temperature_c"]
    offset = offset_tempco_mg_per_c(readings["field_mg"], readings["offset_mg"], temperature_c)
    terms = {"offset_tempco_mg_per_c": _term(offset, OFFSET_CANCELS)}
    if fit is None or fit.refused or fit.two_axis or fit.accel_matrix is None:
        return terms
    there_mg = np.linalg.norm(expected_field_mg(readings, site), axis=1)
    strength = np.linalg.norm(fit.corrected_mg(readings["field_mg"]), axis=1) / there_mg
    gain = sensitivity_tempco_per_c(strength, temperature_c, drift_sd_mg / total_field_mg(site))
    left_g = fit.corrected_g(readings["accel_g"]) - expected_force_g(readings, site.seat)
    drift = accel_drift_g_per_c(left_g, temperature_c, readings["t_s"])
    return terms | {
        "sensitivity_tempco_per_c": _term(gain, GAIN_CANCELS),
        "accel_drift_mg_per_c": _term(drift, DRIFT_WANDERS, scale=1000.0),
    }


def _term(tempco: Tempco, why_not: str, *, scale: float = 1.0) -> BridgeTerm:
    return BridgeTerm(
        value=_listed(scale * tempco.per_c), sd=_listed(scale * tempco.sd_per_c), why_not=why_not
    )


def _listed(values: NDArray[np.float64]) -> tuple[float | None, ...]:
    return tuple(float(value) if np.isfinite(value) else None for value in values)
