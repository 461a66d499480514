"""Caruso, calibration motions: three headings, a level circle, 24 orientations; what each is worth.

One unit with hard and soft iron is calibrated by each motion, with the product's methods, and
then judged at other poses, level and tilted. The time of each motion is the rig's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from bench.calibration.compensation import compensated_heading_deg
from bench.calibration.methods import fit_named
from bench.reproduction.caruso_budget import LIMIT_MG
from bench.reproduction.caruso_turn import HORIZONTAL_MG, section
from bench.reproduction.figures import BLUE, GREY, ORANGE, note, panels
from bench.reproduction.result import PaperFigure, Published
from bench.reproduction.setup import Setup
from bench.reproduction.turns import calibration_data, error_deg, headings, largest, rms, turn

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bench.calibration.fit import Fit
    from bench.pose import Attitude
    from bench.reproduction.laboratory import OpenLaboratory
    from bench.reproduction.result import Reproduction

TILT_DEG: Final = 30.0
CHECK_TILT_DEG: Final = 20.0
DWELL_S: Final = 0.3
UNIT: Final = Setup(
    horizontal_mg=HORIZONTAL_MG,
    dip_deg=60.0,
    hard_iron_mg=(60.0, -45.0, 35.0),
    soft_iron=(1.06, 0.03, -0.02, 0.03, 0.95, 0.04, -0.02, 0.04, 1.01),
    noise_mg=LIMIT_MG["noise"],
    hysteresis_mg=LIMIT_MG["hysteresis"] / 2.0,
    repeatability_mg=LIMIT_MG["repeatability"],
    accel_noise_g=0.001,
    bits=14,
)
"""Symmetric soft iron: an antisymmetric part would be a constant error that no turn can see."""
METHODS: Final = {
    "three headings": ("three_headings",),
    "level circle": ("min_max", "soft_iron"),
    "24 orientations": ("ellipsoid", "truth_aided"),
}
"""Methods of the product by motion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Achieved:
    """What one motion and method achieve.

    Attributes
    ----------
    motion, method : str
    rig_s : float
        Time of the motion on the rig, dwells of 0.3 s included.
    level_rms_deg, level_max_deg, tilt_rms_deg, tilt_max_deg : float
        Heading errors at 12 level and 32 tilted poses that no fit used.
    above_one_deg : int
        At how many of them the error exceeds 1 deg.
    """

    motion: str
    method: str
    rig_s: float
    level_rms_deg: float
    level_max_deg: float
    tilt_rms_deg: float
    tilt_max_deg: float
    above_one_deg: int


def motions() -> dict[str, list[Attitude]]:
    """Return the poses of each calibration motion."""
    orientations = turn(8)
    for tilt_deg in (TILT_DEG, -TILT_DEG):
        orientations += turn(4, tilt_deg, 0.0) + turn(4, 0.0, tilt_deg)
    return {
        "three headings": headings([0.0, 120.0, 240.0]),
        "level circle": turn(24),
        "24 orientations": orientations,
    }


def measure_motions(open_laboratory: OpenLaboratory) -> list[Achieved]:
    """Calibrate one unit by each motion and judge each method, raw first."""
    with open_laboratory(UNIT) as laboratory:
        fits: list[tuple[str, Fit, float]] = []
        for motion, poses in motions().items():
            laboratory.measure(headings([0.0]))
            start_s = laboratory.now_s
            readings = laboratory.measure(poses, dwell_s=DWELL_S)
            rig_s = laboratory.now_s - start_s
            data = calibration_data(readings, UNIT)
            fits += [(motion, fit_named(method, data), rig_s) for method in METHODS[motion]]
        level = laboratory.measure(turn(12, start_deg=7.5), dwell_s=DWELL_S)
        tilted = laboratory.measure(_tilted(), dwell_s=DWELL_S)
    raw = _achieved("none", None, 0.0, level, tilted)
    return [raw, *(_achieved(motion, fit, rig_s, level, tilted) for motion, fit, rig_s in fits)]


def _tilted() -> list[Attitude]:
    poses = []
    for tilt_deg in (CHECK_TILT_DEG, -CHECK_TILT_DEG):
        poses += turn(8, tilt_deg, 0.0, start_deg=10.0)
        poses += turn(8, 0.0, tilt_deg, start_deg=10.0)
    return poses


def _achieved(
    motion: str,
    fit: Fit | None,
    rig_s: float,
    level: NDArray[np.void],
    tilted: NDArray[np.void],
) -> Achieved:
    errors_deg = [
        error_deg(compensated_heading_deg(fit, poses["field_mg"], poses["accel_g"]), poses)
        for poses in (level, tilted)
    ]
    return Achieved(
        motion=motion,
        method="raw" if fit is None else fit.method,
        rig_s=rig_s,
        level_rms_deg=rms(errors_deg[0]),
        level_max_deg=largest(errors_deg[0]),
        tilt_rms_deg=rms(errors_deg[1]),
        tilt_max_deg=largest(errors_deg[1]),
        above_one_deg=int((np.abs(np.concatenate(errors_deg)) > 1.0).sum()),
    )


def reproduce_motions(open_laboratory: OpenLaboratory) -> Reproduction:
    """Measure what the calibration motions are worth."""
    achieved = measure_motions(open_laboratory)
    by_method = {one.method: one for one in achieved}
    circle, whole = by_method["soft_iron"], by_method["ellipsoid"]
    remarks = [
        "Calibration motions on one unit with hard and soft iron, level and tilted RMS: "
        + "; ".join(
            f"{one.motion} ({one.method}) {one.level_rms_deg:.2f} and {one.tilt_rms_deg:.2f} deg "
            f"in {one.rig_s:.0f} s"
            for one in achieved[1:]
        )
        + ".",
    ]
    figure = PaperFigure(
        name="caruso-motions",
        title="Calibration motions: heading error achieved and time on the rig",
        caption=(
            "One unit at Table 1's limits with hard iron of (60, -45, 35) mG and soft iron of up "
            "to 6 %, dip 60 deg, calibrated by each motion and judged at 12 level and 32 tilted "
            "poses (20 deg) that no fit used. Dots: RMS; lines reach to the largest error. The "
            f"ellipse of a level circle leaves {circle.level_rms_deg:.2f} deg while level, where "
            f"24 orientations leave {whole.level_rms_deg:.2f}, but {circle.tilt_rms_deg:.1f} deg "
            f"with tilt, where these leave {whole.tilt_rms_deg:.2f}: as the paper says of a "
            "compass that samples the horizontal components only."
        ),
        draw=lambda: _draw(achieved),
    )
    return section([_number(whole)], [figure], remarks)


def _number(whole: Achieved) -> Published:
    return Published(
        where="Abstract",
        quantity="poses of 44 with a heading error above 1 deg after 24 orientations",
        unit="",
        published=0.0,
        ours=float(whole.above_one_deg),
        tolerance=0.5,
        reason="a count",
        note=(
            "'accurate to one degree, or better'; the largest is "
            f"{max(whole.level_max_deg, whole.tilt_max_deg):.2f} deg"
        ),
    )


def _draw(achieved: list[Achieved]) -> Figure:
    figure, (axes,) = panels(1, 1, height_in=2.9)
    places = np.arange(len(achieved))[::-1]
    for y, one in zip(places.tolist(), achieved, strict=True):
        for color, shift, rms_deg, max_deg in (
            (BLUE, 0.12, one.level_rms_deg, one.level_max_deg),
            (ORANGE, -0.12, one.tilt_rms_deg, one.tilt_max_deg),
        ):
            axes.plot([rms_deg, max_deg], [y + shift] * 2, color=color, linewidth=1.0)
            axes.plot(rms_deg, y + shift, marker="o", markersize=5.0, color=color)
        if one.rig_s:
            note(axes, 42.0, y, f"{one.rig_s:.0f} s", ha="left")
    note(axes, 42.0, places[0] + 0.45, "rig time", color=GREY)
    raw = achieved[0]
    note(axes, raw.level_max_deg * 1.1, places[0] + 0.13, "level", color=BLUE)
    note(axes, raw.tilt_max_deg * 1.08, places[0] - 0.14, "tilted", color=ORANGE)
    axes.axvline(1.0, color=GREY, linewidth=0.8, linestyle=(0, (1.0, 2.0)))
    note(axes, 0.96, -0.62, "one degree", color=GREY, ha="right")
    axes.set_xscale("log")
    axes.set_xlim(0.03, 90.0)
    axes.set_xticks([0.1, 1.0, 10.0], ["0.1", "1", "10"])
    axes.set_ylim(-0.8, len(achieved) - 0.35)
    names = ["not calibrated", *(f"{one.motion}: {one.method}" for one in achieved[1:])]
    axes.set_yticks(places, names)
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0.0)
    axes.set_xlabel("heading error (deg)")
    return figure
