"""Cho & Park, "A Calibration Technique for a Two-Axis Magnetic Compass", 2005, on the bench."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

from bench.reproduction.cho_park_experiments import run_experiments
from bench.reproduction.cho_park_figures import (
    draw_blind_map,
    draw_fig_1,
    draw_fig_4,
    draw_fig_5,
    draw_fig_6,
    draw_table_1,
    draw_turn,
)
from bench.reproduction.cho_park_numbers import numbers_of
from bench.reproduction.cho_park_site import dips_of_seoul, dips_over_latitude
from bench.reproduction.cho_park_table import exact_dip_deg, predicted_spread
from bench.reproduction.result import PaperFigure, Reproduction

if TYPE_CHECKING:
    from bench.reproduction.cho_park_experiments import Experiments
    from bench.reproduction.cho_park_table import Spread
    from bench.reproduction.laboratory import OpenLaboratory

TITLE: Final = (
    'S. Y. Cho and C. G. Park, "A Calibration Technique for a Two-Axis Magnetic Compass in '
    'Telematics Devices", 2005'
)


def reproduce(open_laboratory: OpenLaboratory) -> Reproduction:
    """Measure and judge the paper's numbers and figures."""
    found = run_experiments(open_laboratory)
    spread = predicted_spread()
    return Reproduction(
        paper="cho_park",
        title=TITLE,
        numbers=numbers_of(found, spread),
        figures=[*_dip_figures(found), *_sweep_figures(found, spread), *_turn_figures(found)],
        remarks=_remarks(found),
    )


def _remarks(found: Experiments) -> list[str]:
    return [
        "The paper's module: two magnetic axes, two accelerometers, and a third magnetic axis "
        "that only checks the estimate. The site has a dip of 48.72 deg and 300 mG of horizontal "
        "field. One setting serves all experiments: noise of 2 mG in each set and reset reading "
        "(0.6 mG in the mean of the five pairs of a pose) and of 0.002 g in the force, which is "
        "the data sheet's for the paper's accelerometer at 60 Hz; hard iron of 30 and -20 mG, "
        "gains 5 % above and below nominal, zeros of the accelerometers at 0.010 and -0.006 g, "
        "all taken out by one level turn. An azimuth set by hand is off by 2 deg (standard "
        "deviation), drawn once for each row of Table 1 and unknown to the estimates. The paper "
        "states none of these.",
        "Rows (e) and (f) tilt one axis after the other. Tilted together both can pass a blind "
        "azimuth: at pitch = roll = 30 deg it lies at 49 deg, beside the 45 deg of row (e).",
        "(26) carries tan(azimuth) and cannot be used at 90 and 270 deg. The product multiplies "
        "it by cos(azimuth), sums over all samples with weights from their noise, and refuses "
        "where no sample shows the dip. The scatter of the six rows falls from "
        f"{found.adopted_deg.std(ddof=1):.2f} to {found.fitted_deg.std(ddof=1):.2f} deg, because "
        "samples of large tilt, where the azimuth's error acts least, count most; row (e), whose "
        "tilts end at 48 deg, gains nothing.",
    ]


def _dip_figures(found: Experiments) -> list[PaperFigure]:
    seoul = dips_of_seoul()
    pitch_deg, twist_deg = found.both_sides.pitch_deg, float(found.twist_deg[0])
    return [
        PaperFigure(
            name="cho-park-fig-1",
            title="Fig. 1 and (25): dip angle against latitude",
            caption="(25) is the law of a dipole in its own latitude. Fed with the geographic "
            f"latitude of Seoul it gives {seoul.geographic_deg:.2f} deg; the geomagnetic latitude "
            f"gives {seoul.geomagnetic_deg:.1f} and the World Magnetic Model "
            f"{seoul.model_deg:.1f}, grey along Seoul's meridian. The paper measured 48.72.",
            draw=lambda: draw_fig_1(dips_over_latitude(), seoul),
        ),
        PaperFigure(
            name="cho-park-fig-4",
            title="Fig. 4: error of the calculated dip angle against pitch",
            caption=f"Azimuth 45 deg, off by {twist_deg:.1f} deg that (26) does not know. Near "
            "level (26) divides by nothing and runs through all that an arctangent can give: "
            "from 138.7 deg below the site's dip, where the printed axis ends, to 41.3 above. "
            "Right: an azimuth error acts with the sign of the pitch, so that tilts to both "
            "sides cancel it.",
            draw=lambda: draw_fig_4(found.both_sides, exact_dip_deg(pitch_deg, twist_deg)),
        ),
    ]


def _sweep_figures(found: Experiments, spread: Spread) -> list[PaperFigure]:
    return [
        PaperFigure(
            name="cho-park-fig-5",
            title="Fig. 5: roll, pitch and calculated dip angle",
            caption="The six sweeps of Table 1 in four-degree steps, there and back, to the tilts "
            "that the printed axes reach; the paper does not say to which side. The grey line is "
            "the site's dip.",
            draw=lambda: draw_fig_5(found.tiltings),
        ),
        PaperFigure(
            name="cho-park-table-1",
            title="Table 1: extended dip angles",
            caption="Bars are 2 standard deviations of each row, from repeats with the stated "
            "noise. The shaded band is the claim of less than 1 deg: four of the six published "
            "rows lie outside. The bars of (e) are long because its tilts end at 48 deg. It is "
            "rolled to the other side than it is pitched: to the same side an azimuth error would "
            "cancel, and noise alone would be far from the published 47.24.",
            draw=lambda: draw_table_1(found.tiltings, spread),
        ),
    ]


def _turn_figures(found: Experiments) -> list[PaperFigure]:
    turn = found.turn
    return [
        PaperFigure(
            name="cho-park-fig-6",
            title="Fig. 6: heading error when tilt is not compensated",
            caption="A turn at a pitch of 30 deg. The exact curve reaches 41.7 deg, more than the "
            "printed axis shows.",
            draw=lambda: draw_fig_6(turn),
        ),
        PaperFigure(
            name="cho-park-fig-7",
            title="Fig. 7: dip angle from the latitude",
            caption="The same turn with a dip of 56.91 deg. Left: the third axis, measured and "
            "estimated, over the field; right: the heading. The exact error is up to 13.2 deg, "
            "beyond the printed axis of 10; nothing was tuned to stay inside.",
            draw=partial(draw_turn, turn, turn.latitude, own=False),
        ),
        PaperFigure(
            name="cho-park-fig-8",
            title="Fig. 8: estimated dip angle",
            caption=f"The same turn with {turn.estimated.dip_deg:.2f} deg, the mean of the six "
            "rows by least squares. Normalisation and dip were written to the module over CAN; "
            "the heading that it then sends stands beside the bench's. Right: the printed axis "
            "reaches 10 deg, this one 2.",
            draw=partial(draw_turn, turn, turn.estimated, own=True),
        ),
        PaperFigure(
            name="cho-park-blind",
            title="Blind azimuths, which the paper does not mention",
            caption="How well one pose shows the dip when its azimuth is known to 2 deg. On the "
            "red lines, and at tan(azimuth) = tan(roll)/sin(pitch) in general, a tilt says "
            "nothing of the dip: pure pitch at 0 and 180 deg, pure roll at 90 and 270. Each map is "
            "smoothed between 63 measured poses. Right: degrees of heading for a degree of dip, "
            "measured at tilts of 30 deg; where a line crosses zero (circles) the azimuth is "
            "blind.",
            draw=lambda: draw_blind_map(found.blind),
        ),
    ]
