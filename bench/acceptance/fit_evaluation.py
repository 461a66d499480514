"""Numbers about a fit: its residual, its agreement with the station's record, the accelerometer."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bench.acceptance.measurement import Measurement
from bench.acceptance.site import total_field_mg
from protocols.angles import wrap_180_deg

if TYPE_CHECKING:
    from bench.acceptance.site import SiteField
    from bench.calibration.fit import Fit
    from bench.calibration.heading_claim import HeadingClaim


def evaluate_fit(step: str, fit: Fit, site: SiteField) -> list[Measurement]:
    """Return what a fit says of itself and of the station.

    - fit_accepted: 1, or 0 where the method refused the data; its note begins with the
      method's name and goes on with the reason. Of a refused fit nothing else is returned.
    - fit_residual (mG), fit_residual_share (% of the field's strength), fit_condition,
      accel_residual (mg), accel_bias (mg, largest axis).
    - sensitivity (%): mean sensitivity of the axes in the module's nominal scale. The fit's
      gain is held against the station's field, so the strength itself says nothing here; it
      is judged on other poses (`evaluate_field_strength`).
    - field_azimuth_difference, dip_difference (deg): fit against the station's record,
      absolute. A difference is the rig's or the field's fault; of a fit for two axes it is that
      of the extended dip, which also takes up what x and y see of z.
    """
    if fit.refused:
        note = f"{fit.method}: {fit.cause}: {fit.message}"
        return [Measurement(name="fit_accepted", value=0.0, step=step, note=note)]
    values = {
        "fit_accepted": (1.0, ""),
        "fit_residual": (fit.residual_rms_mg, "mG"),
        "fit_residual_share": (_residual_percent(fit), "%"),
        "fit_condition": (fit.condition, ""),
        "sensitivity": (_sensitivity_percent(fit, site), "%"),
        "accel_bias": (_accel_bias_mg(fit), "mg"),
        "accel_residual": (_scaled(fit.accel_residual_rms_g, 1000.0), "mg"),
        "field_azimuth_difference": (_azimuth_difference_deg(fit, site), "deg"),
        "dip_difference": (_dip_difference_deg(fit, site), "deg"),
    }
    return [
        Measurement(
            name=name,
            value=float(value),
            step=step,
            unit=unit,
            note=fit.method if name == "fit_accepted" else "",
        )
        for name, (value, unit) in values.items()
        if value is not None
    ]


def evaluate_claim(step: str, claim: HeadingClaim, poses: int) -> list[Measurement]:
    """Return predicted_uncertainty (deg): what the coefficients of so many poses are claimed to be.

    The note says how the readings scatter: a sigma above 1 is the unit's, or a disturbed field's.
    """
    note = f"{poses} poses, scatter {claim.sigma:.2f} of that stated"
    name = "predicted_uncertainty"
    return [Measurement(name=name, value=claim.largest_deg, step=step, unit="deg", note=note)]


def _residual_percent(fit: Fit) -> float | None:
    if fit.residual_rms_mg is None or not fit.field_mg:
        return None
    return 100.0 * fit.residual_rms_mg / fit.field_mg


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def _accel_bias_mg(fit: Fit) -> float | None:
    if fit.accel_offset_g is None:
        return None
    return 1000.0 * float(np.max(np.abs(fit.accel_offset_g)))


def _azimuth_difference_deg(fit: Fit, site: SiteField) -> float | None:
    azimuth_deg = fit.extra.get("field_azimuth_deg")
    if azimuth_deg is None:
        return None
    return abs(float(wrap_180_deg(azimuth_deg - site.field_azimuth_deg)))


def _dip_difference_deg(fit: Fit, site: SiteField) -> float | None:
    dip_deg = fit.extended_dip_deg if fit.two_axis else fit.dip_deg
    return None if dip_deg is None else abs(dip_deg - site.dip_deg)


def _sensitivity_percent(fit: Fit, site: SiteField) -> float | None:
    nominal_mg = fit.extra.get("field_magnitude_mg")
    if nominal_mg is None or not math.isfinite(nominal_mg):
        return None
    return 100.0 * nominal_mg / total_field_mg(site)
