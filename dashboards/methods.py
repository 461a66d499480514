"""What every method makes of the same readings: headings, errors, and z where it is estimated."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from bench.acceptance.site import is_level
from bench.calibration.two_axis import checking_z_mg
from bench.record.method_study import method_words
from bench.record.recorded_fits import VERIFIED_KINDS, step_positions
from dashboards import entities
from dashboards.certainty import log_band
from dashboards.columns import dwell_times, send_scalars, style_points
from dashboards.run_view import compensated_field_mg

if TYPE_CHECKING:
    import rerun as rr
    from numpy.typing import NDArray

    from dashboards.entities import Colour
    from dashboards.run_view import RunView

_FEWEST: Final = 3


def log_methods(
    recording: rr.RecordingStream, run: RunView, dwells: NDArray[np.void], ticks: dict[int, int]
) -> None:
    """Log heading and heading error of each dwell by raw and by every method.

    The errors of level and of tilted verification poses stand apart from those of other poses.

    Parameters
    ----------
    dwells : ndarray of READING, shape (n,)
    ticks : dict
        Last tick of each position.
    """
    verified = np.isin(dwells["position"], step_positions(run.record, VERIFIED_KINDS))
    if not verified.any() or not run.fits.by_method:
        return
    level = is_level(dwells)
    times = dwell_times(dwells, ticks)
    for method, heading_deg in run.fits.headings_deg(dwells).items():
        path, name = f"{entities.METHODS}/{method}", method_words(method)
        colour = entities.METHOD_COLOURS.get(method, entities.WHITE)
        style_points(recording, f"{path}/heading_deg", name, colour, 1.5)
        send_scalars(recording, f"{path}/heading_deg", times, heading_deg)
        error_deg = run.heading_errors_deg(heading_deg, dwells)
        for kind, chosen in (
            ("level", verified & level),
            ("tilt", verified & ~level),
            ("other", ~verified),
        ):
            if chosen.any():
                error_path = f"{path}/error_deg/{kind}"
                _style_errors(recording, error_path, name, kind, colour)
                columns = dwell_times(dwells[chosen], ticks)
                send_scalars(recording, error_path, columns, error_deg[chosen])
    _log_expected(recording, run, dwells[verified & level], "level", ticks)
    _log_expected(recording, run, dwells[verified & ~level], "tilt", ticks)


def _log_expected(
    recording: rr.RecordingStream,
    run: RunView,
    rows: NDArray[np.void],
    kind: str,
    ticks: dict[int, int],
) -> None:
    """Log what was expected of each method, as a band of two standard deviations."""
    if run.site is None or not len(rows):
        return
    times = dwell_times(rows, ticks)
    for method, expected in run.fits.expected_errors(rows, run.site).items():
        log_band(
            recording,
            f"{entities.METHODS}/{method}/error_deg/expected_{kind}",
            times,
            expected.mean_deg,
            2.0 * expected.sd_deg,
            name=f"expected, {kind}",
            colour=entities.WHITE,
        )


def _style_errors(
    recording: rr.RecordingStream, path: str, name: str, kind: str, colour: Colour
) -> None:
    """Draw verification poses large, tilted ones as diamonds, all other poses faint."""
    if kind == "other":
        style_points(recording, path, f"{name}, other poses", (*colour[:3], 70), 1.5)
    else:
        marker: Literal["circle", "diamond"] = "diamond" if kind == "tilt" else "circle"
        style_points(recording, path, f"{name}, {kind}", colour, 3.0, marker)


def log_z_estimate(
    recording: rr.RecordingStream, run: RunView, dwells: NDArray[np.void], ticks: dict[int, int]
) -> None:
    """Log z as two axes estimate it beside z as the checking axis measures it, one value a dwell.

    The checking axis is not calibrated: its offset and gain against the estimate are taken out
    by least squares over the poses that no method has fitted.
    """
    verified = np.isin(dwells["position"], step_positions(run.record, VERIFIED_KINDS))
    if run.fit is None or not run.fit.two_axis or verified.sum() < _FEWEST:
        return
    estimated_mg = compensated_field_mg(run.fit, dwells["field_mg"], dwells["accel_g"])[:, 2]
    columns = dwell_times(dwells, ticks)
    raw_z_mg = run.fit.bridge_mg(dwells["field_mg"])[:, 2]
    measured_mg = checking_z_mg(raw_z_mg, estimated_mg, verified)
    for path, name, values, colour, size in (
        (entities.Z_ESTIMATED, "estimated", estimated_mg, entities.AMBER, 4.0),
        (entities.Z_MEASURED, "measured", measured_mg, entities.WHITE, 1.5),
        (
            entities.Z_DIFFERENCE,
            "estimated less measured",
            estimated_mg - measured_mg,
            entities.AMBER,
            2.5,
        ),
    ):
        style_points(recording, path, name, colour, size)
        send_scalars(recording, path, columns, values)
