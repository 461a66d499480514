"""Deviation A to E of a level turn, as the record keeps it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from bench.acceptance.site import SiteField


def deviation_entry(
    heading_deg: NDArray[np.float64], readings: NDArray[np.void], site: SiteField
) -> dict[str, Any]:
    """Return coefficients in degrees, their standard errors and the errors in words.

    Parameters
    ----------
    heading_deg : ndarray, shape (n,)
        Heading of each pose by the compass.
    readings : ndarray of READING, shape (n,)
        The poses; only level ones count.

    Returns
    -------
    dict
        ``A`` to ``E``, ``se`` by letter, and ``words``; only words where the exact form cannot
        be fitted, for instance under a hard iron that reverses the field.
    """
    from bench.acceptance.site import is_level, reference_heading_deg
    from bench.calibration.deviation import NAMES, exact_deviation

    level = is_level(readings)
    magnetic_deg = reference_heading_deg(readings[level], site)
    deviation = exact_deviation(heading_deg[level], magnetic_deg)
    if deviation.cause is not None:
        return {"words": list(deviation.words)}
    return {
        **dict(zip(NAMES, deviation.coefficients_deg, strict=True)),
        "se": dict(zip(NAMES, deviation.sd_deg, strict=True)),
        "words": list(deviation.words),
    }


def raw_deviation_entry(readings: NDArray[np.void], site: SiteField) -> dict[str, Any]:
    """Return the same for the heading that raw readings give without any coefficients."""
    from bench.calibration.tilt import tilt_compensated_heading_deg

    heading_deg = tilt_compensated_heading_deg(readings["field_mg"], readings["accel_g"])
    return deviation_entry(heading_deg, readings, site)
