"""All methods of a run on one set of verification poses: what each achieves, and their ranking.

The judged method's heading is computed here from the raw readings, as `judge` does it again
from the samples. Every other method is applied to the same readings (`bench.calibration.ranking`).
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Final

from bench.acceptance.heading_evaluation import error_measurements
from bench.acceptance.measurement import Measurement
from bench.acceptance.site import calibration_data, is_level
from bench.calibration.compensation import Order
from bench.calibration.expectation import CLAIM_WITHOUT, expectation
from bench.calibration.ranking import Study, borrowed_tilt, heading_errors_deg, study

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from bench.acceptance.site import SiteField
    from bench.calibration.fit import CalibrationData, Fit

LARGEST: Final = ("level_max_deg", "tilt_max_deg")

Achieved = dict[str, dict[str, float]]
"""{level,tilt}_{rms,max}_deg by method; empty where it was refused."""


def comparison_data(
    readings: NDArray[np.void], site: SiteField, fits: Mapping[str, Fit]
) -> CalibrationData:
    """Return the readings as the comparison of methods takes them.

    On level poses, where no accepted fit calibrates the accelerometer, the tilt is the rig's: 30
    mg of raw bias cost 3 deg of heading at dip 60 and would hide what the methods differ in.
    """
    accepted = [fit for fit in fits.values() if not fit.refused]
    without = bool(accepted) and all(fit.accel_matrix is None for fit in accepted)
    given = without and bool(is_level(readings).all())
    return calibration_data(readings, site, with_acceleration=not given)


def study_of(fits: Mapping[str, Fit], readings: NDArray[np.void], site: SiteField) -> Study:
    """Return what raw readings and every accepted method achieve on verification poses."""
    return study(fits, comparison_data(readings, site, fits))


def expected_of(
    fits: Mapping[str, Fit],
    readings: NDArray[np.void],
    site: SiteField,
    zero_change_g: float = 0.0,
) -> dict[str, Any]:
    """Return what the record's study says of errors to expect, from the attitudes alone.

    `zero_change_g` is what the accelerometer's zero moves until then (`uncertainty.zero_change`).

    Returns
    -------
    dict
        ``expected``: errors by method, None where no accepted truth-aided fit models the unit;
        ``expected_noise``: the part of one reading's noise; ``expected_zero_change_g``:
        `zero_change_g`; ``claim_without``: what the own predicted error of each method leaves out.
    """
    found = expectation(fits, comparison_data(readings, site, fits), zero_change_g)
    without = {name: CLAIM_WITHOUT[name] for name in fits}
    if found is None:
        return {"expected": None, "claim_without": without}
    parts = found.as_dict()
    return {
        "expected": parts["errors"],
        "expected_noise": parts["noise"],
        "expected_zero_change_g": zero_change_g,
        "claim_without": without,
    }


def achieved_by(fits: Mapping[str, Fit], compared: Study) -> Achieved:
    """Return each method's errors in the product's order of compensation."""
    return {
        name: {
            key: value
            for key, value in asdict(compared.orders[name][str(Order.BODY)]).items()
            if value is not None
        }
        if name in compared.orders
        else {}
        for name in fits
    }


def ranking(achieved: Mapping[str, Mapping[str, float]]) -> list[str]:
    """Return the methods from best to worst by the worse of their level and tilted maximum.

    Methods without an achieved error (refused) come last, in the order given.
    """
    return sorted(achieved, key=lambda method: _largest_deg(achieved[method]))


def evaluate_comparison(
    step: str,
    judged: str,
    fits: Mapping[str, Fit],
    readings: NDArray[np.void],
    site: SiteField,
) -> list[Measurement]:
    """Return achieved_level_max, achieved_level_rms, achieved_tilt_max and achieved_tilt_rms, deg.

    Parameters
    ----------
    judged : str
        Method whose heading is judged.
    fits : mapping of str to Fit
        All fits of the run; a magnetometer's fit borrows its tilt from another.
    readings : ndarray of READING, shape (n,)
        Poses that no fit has used; of a kind that is missing nothing is returned.
    """
    fit = fits[judged]
    if fit.refused:
        return []
    data = comparison_data(readings, site, fits)
    source, tilt = borrowed_tilt(fit, fits, data)
    error_deg = heading_errors_deg(data, fit, tilt=tilt)
    level = is_level(readings)
    found: list[Measurement] = []
    for name, mask in (("achieved_level", level), ("achieved_tilt", ~level)):
        if mask.any():
            note = f"{judged}, tilt {source}"
            found += error_measurements(name, step, error_deg[mask], readings[mask], note=note)
    return found


def evaluate_rank(
    step: str, judged: str, achieved: Mapping[str, Mapping[str, float]]
) -> list[Measurement]:
    """Return behind_best, deg: largest error of the judged method less that of the best one.

    It informs: 0 where the judged method is the best, and the note says which one is.
    """
    if not achieved.get(judged):
        return []
    best = ranking(achieved)[0]
    behind_deg = _largest_deg(achieved[judged]) - _largest_deg(achieved[best])
    return [
        Measurement(
            name="behind_best", value=behind_deg, step=step, unit="deg", note=f"best: {best}"
        )
    ]


def _largest_deg(of_method: Mapping[str, float]) -> float:
    return max((of_method[key] for key in LARGEST if key in of_method), default=float("inf"))
