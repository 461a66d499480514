"""The cross-axis term of the bridges, estimated from a calibration's pairs and taken out of it.

Half the sum of a pair holds b - H C/Hk (`set_reset`), so that the offsets of all poses tell Hk to
half a percent; half its difference holds H/(1 - (C/Hk)^2), which is up to 2 mG too much and bends
every reading where there is hard iron. A method that is linear in the readings leaves it in its
residual and, through its coefficients, in headings at other tilts. So it is taken out of the
readings before any method fits them, and the module takes it out with the same Hk.

The rule: an axis is corrected where its slope stands out from the noise of the half sums beyond
what chance gives once in a thousand (Student's t), has the sign of the physics, and belongs to a
film that is not broken. Below twice its standard deviation a slope would add more than it takes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.crossed_field import without_cross_axis
from bench.calibration.set_reset import SMALLEST, set_reset_batch

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bench.calibration.fit import CalibrationData, Fit

CHANCE: Final = 1e-3
"""Chance that noise alone is taken for a cross-axis term, each axis."""
LEAST_HK_MG: Final = 2000.0
"""A film of less is broken, and the term is no longer of second order."""
UNKNOWN_THEN: Final = "the run was made before the term was known"
NO_PAIRS: Final = "the readings are no set/reset pairs"
TOO_FEW: Final = f"fewer than {SMALLEST} pairs"
NO_HEALTH: Final = "an axis is saturated or its strap does not flip it"
NOT_EXCITED: Final = "the poses do not excite it"
NOT_SEEN: Final = "it does not stand out from the noise"
BROKEN: Final = f"a film of less than {LEAST_HK_MG / 1000.0:g} G is broken"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CrossAxis:
    """What the pairs of a calibration tell of the anisotropy fields of x, y and z.

    Attributes
    ----------
    hk_mg : ndarray, shape (3,)
        With which the readings are corrected, in the reading of the axis across; 0 where an axis
        is not.
    seen_mg, sd_mg : ndarray, shape (3,)
        Estimate and its standard deviation; NaN where there is none.
    why_not : tuple of str
        Why an axis is not corrected; empty where it is.
    """

    hk_mg: NDArray[np.float64]
    seen_mg: NDArray[np.float64]
    sd_mg: NDArray[np.float64]
    why_not: tuple[str, str, str]

    @property
    def corrected(self) -> bool:
        """Whether any axis is corrected."""
        return bool(self.hk_mg.any())


def no_cross_axis(why_not: str) -> CrossAxis:
    """Return that no axis is corrected, for one reason."""
    nothing = np.full(3, np.nan)
    whys = (why_not, why_not, why_not)
    return CrossAxis(hk_mg=np.zeros(3), seen_mg=nothing, sd_mg=nothing, why_not=whys)


def cross_axis_of(data: CalibrationData) -> CrossAxis:
    """Return what the pairs of a calibration tell of the cross-axis terms."""
    if data.offset_mg is None:
        return no_cross_axis(NO_PAIRS)
    if len(data) < SMALLEST:
        return no_cross_axis(TOO_FEW)
    fits = set_reset_batch(data.field_mg, data.offset_mg)
    if fits.cause != 0:
        return no_cross_axis(NO_HEALTH)
    slope, sd = -fits.cross_per_mg, fits.cross_sd_per_mg
    freedom = len(data) - 1 - fits.cross_fitted.astype(int) - fits.gain_fitted
    seen = fits.cross_fitted & (slope > _standing_out(freedom) * sd)
    hk_mg = 1.0 / np.where(seen, slope, 1.0)
    whole = hk_mg >= LEAST_HK_MG
    whys = np.where(~fits.cross_fitted, NOT_EXCITED, np.where(seen, BROKEN, NOT_SEEN))
    why_x, why_y, why_z = (
        "" if fine else str(why) for fine, why in zip(seen & whole, whys, strict=True)
    )
    return CrossAxis(
        hk_mg=np.where(seen & whole, hk_mg, 0.0),
        seen_mg=np.where(seen, hk_mg, np.nan),
        sd_mg=np.where(seen, sd * hk_mg**2, np.nan),
        why_not=(why_x, why_y, why_z),
    )


def corrected(data: CalibrationData, cross: CrossAxis) -> CalibrationData:
    """Return calibration data whose field readings are without the cross-axis term."""
    if not cross.corrected:
        return data
    return replace(data, field_mg=without_cross_axis(data.field_mg, cross.hk_mg))


def knowing(fit: Fit, cross: CrossAxis) -> Fit:
    """Return a fit of `corrected` data as one of the raw readings: it corrects them first."""
    if fit.matrix is None or not cross.corrected:
        return fit
    return replace(fit, hk_mg=cross.hk_mg)


def _standing_out(freedom: NDArray[np.int_]) -> NDArray[np.float64]:
    """Return the standard deviations that chance exceeds once in a thousand."""
    from scipy.special import stdtrit

    return np.asarray(stdtrit(np.maximum(freedom, 1), 1.0 - CHANCE))
