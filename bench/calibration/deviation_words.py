"""Deviation of a compass in words: which errors it tells of, or why there is none."""

from __future__ import annotations

import math
from typing import Final

from bench.calibration.fit import Cause

SPOKEN_DEG: Final = 0.1
_MEANINGS: Final = (
    ("A", "constant error (lubber line, mounting azimuth or declination)"),
    ("BC", "hard iron, one cycle per turn"),
    ("DE", "soft iron or unequal gains, two cycles per turn"),
    ("34", "third and fourth harmonics: non-linearity or cross-axis effect of the sensor"),
)
SENTENCES: Final = {
    Cause.TOO_FEW: "at least 8 headings round the circle are needed, at 5 places or more",
    Cause.NO_TURN: "the headings leave a gap of more than 90 deg: swing through the whole circle",
    Cause.HARD_IRON_TOO_LARGE: "hard iron reverses the horizontal field: degauss, or look for a "
    "magnet",
    Cause.NOT_CONVERGED: "the deviations fit no hard and soft iron: the headings do not belong "
    "together",
}


def error_words(coefficients_deg: tuple[float, ...], harmonics_deg: list[float]) -> tuple[str, ...]:
    """Return which errors a compass has, the largest first; or that there is none.

    Parameters
    ----------
    coefficients_deg : tuple of 5 floats
        A, B, C, D, E.
    harmonics_deg : list of 2 floats
        Amplitudes of the third and fourth harmonics of what is left.

    Examples
    --------
    >>> error_words((0.0, 3.0, 4.0, 0.0, 0.0), [0.0, 0.0])
    ('hard iron, one cycle per turn: 5.00 deg',)
    """
    a, b, c, d, e = coefficients_deg
    sizes = (abs(a), math.hypot(b, c), math.hypot(d, e), math.hypot(*harmonics_deg))
    spoken = sorted(
        ((size, meaning) for size, (_, meaning) in zip(sizes, _MEANINGS, strict=True)),
        reverse=True,
    )
    words = tuple(f"{meaning}: {size:.2f} deg" for size, meaning in spoken if size >= SPOKEN_DEG)
    return words or (f"no error of {SPOKEN_DEG:.1f} deg or more",)
