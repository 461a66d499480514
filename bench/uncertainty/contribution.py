"""One line of an uncertainty budget, and what it does to the heading at each pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Contribution:
    """One source of uncertainty.

    Attributes
    ----------
    name : str
    source : str
        "A" evaluated from the run's own readings, "B" from a record or a data sheet (GUM 4.2,
        4.3).
    distribution : str
        In words, with its divisor where the value was a limit.
    group : str
        "unit": belongs to what the unit shows of itself, and to the certificate alone; "bench":
        belongs to the test, and to both.
    shared : bool
        Whether it is one draw at all poses, or at all that come back to the same angle.
    value, unit : float, str
        Standard uncertainty of the quantity.
    columns_deg : ndarray, shape (n, f)
        Standard contribution to the heading error of n poses by each of f independent draws; the
        covariance is columns_deg columns_deg^T.
    """

    name: str
    source: Literal["A", "B"]
    distribution: str
    group: Literal["unit", "bench"]
    shared: bool
    value: float
    unit: str
    columns_deg: NDArray[np.float64]

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the heading errors, shape (n, n), deg^2."""
        return np.asarray(self.columns_deg @ self.columns_deg.T)

    def rms_deg(self, mask: NDArray[np.bool_]) -> float | None:
        """Return the root mean square standard contribution over poses; None of no poses."""
        if not mask.any():
            return None
        return float(np.sqrt(np.mean(np.sum(self.columns_deg[mask] ** 2, axis=1))))


def own(value_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return columns, shape (n, n), of contributions that are drawn anew at each pose.

    >>> own(np.array([0.1, 0.2])).tolist()
    [[0.1, 0.0], [0.0, 0.2]]
    """
    return np.diag(value_deg)


def own_axes(by_axis_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return columns, shape (n, n), of three independent axes drawn anew at each pose.

    `by_axis_deg`, shape (n, 3), are the axes' standard contributions.
    """
    return own(np.linalg.norm(by_axis_deg, axis=1))


def once_an_angle(value_deg: float, angle_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return columns, shape (n, m), of a contribution that is the same wherever an angle is.

    >>> once_an_angle(0.1, np.array([5.0, 20.0, 365.0])).tolist()
    [[0.1, 0.0], [0.0, 0.1], [0.1, 0.0]]
    """
    turned = np.round(np.mod(angle_deg, 360.0), 1) % 360.0
    _, which = np.unique(turned, return_inverse=True)
    return np.asarray(value_deg * np.eye(int(which.max(initial=-1)) + 1)[which])
