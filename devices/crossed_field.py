"""The cross-axis term of the module's bridges, taken out in single precision.

Half the difference of set and reset reading holds h/(1 - (Ha/Hk)^2), with Ha the field across the
bridge and Hk the film's anisotropy field. So the module takes from each half difference d its part
d (da/Hk)^2, with da the half difference of the bridge that lies across: what this leaves is
second order in the term itself, 0.02 mG where 500 mG lie across a film of 8 G.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from devices.bridge import ACROSS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from devices.firmware import Converters
    from protocols.uds import Coefficients

_F32 = np.float32
_ACROSS: Final = np.array((*ACROSS, 0, 0, 0))
"""Index of what lies across each of the six values; the three of acceleration have nothing."""


class CrossedField:
    """Anisotropy fields folded with the converter's scale."""

    def __init__(self, coefficients: Coefficients, converters: Converters) -> None:
        mg_per_count = converters.mag_mg_per_count / 2.0
        per_hk = [mg_per_count / hk_mg if hk_mg > 0.0 else 0.0 for hk_mg in coefficients.hk_mg]
        self._per_hk: NDArray[Any] | None = None
        if any(per_hk):
            self._per_hk = np.array((*per_hk, 0.0, 0.0, 0.0), dtype=_F32)

    def taken_out(self, raw: NDArray[Any]) -> NDArray[Any]:
        """Return (set - reset, acceleration) in counts, shape (6,), without the cross-axis term."""
        if self._per_hk is None:
            return raw
        ratio = raw[_ACROSS] * self._per_hk
        return np.asarray(raw - raw * ratio * ratio)
