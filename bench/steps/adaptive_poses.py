"""Calibrate in one pose after the other until the heading is known well enough."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from bench.calibration.fit import Cause
from bench.errors import BenchError, BenchNotReady, ConfigError, FieldChanged
from bench.pose import Attitude
from bench.quantity import Degrees, Milligauss, Seconds
from bench.steps.step import OnMiss, PlannedPose, Step

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from bench.adaptive_tour import AdaptiveTour
    from bench.calibration.fit import CalibrationData
    from bench.calibration.heading_claim import ClaimedFit
    from bench.run_context import RunContext

MORE_MAY_HELP: Final = (Cause.FIELD_DISTURBED, Cause.RESIDUAL_TOO_LARGE)
"""Refusals of a few disturbed poses, which further ones outvote."""
FIRST_POSES: Final = 8
"""Fewest poses that leave 20 degrees of freedom."""
MOST_FIRST_POSES: Final = 14
MOST_POSES: Final = 36


class AdaptivePoses(Step):
    """Poses chosen as the run goes; ends where the claimed heading error is as small as wanted.

    Claimed is the largest heading error of the coefficients over the verification grid, at 95 %.
    A unit whose readings scatter too much for that, within the most poses, misses its limit.
    """

    kind: Literal["adaptive_poses"]
    on_miss: OnMiss = "stop"
    wanted: Degrees
    """Largest heading error of the coefficients, at 95 %."""
    tilt: Annotated[Degrees, Field(ge=15.0, le=60.0)] = 30.0
    """Largest tilt of a pose."""
    least: Annotated[int, Field(ge=FIRST_POSES, le=MOST_FIRST_POSES)] = FIRST_POSES
    """Poses to begin with."""
    most: Annotated[int, Field(ge=FIRST_POSES, le=MOST_POSES)] = 20
    """Poses after which it ends in any case."""
    dwell: Seconds = 0.5
    """Time over which a reading is averaged."""
    horizontal: Annotated[Milligauss, Field(ge=20.0, le=500.0)] = 250.0
    """Horizontal field for which poses are chosen; the claim is made with the station's own."""
    dip: Annotated[Degrees, Field(ge=-80.0, le=80.0)] = 60.0
    """Dip for which poses are chosen."""

    @model_validator(mode="after")
    def _ends_after_it_begins(self) -> Self:
        if self.wanted <= 0.0:
            message = f"wanted must be above zero; instead received {self.wanted:g} deg"
            raise ValueError(message)
        if self.most < self.least:
            message = f"most must be at least {self.least} poses (least); instead {self.most}"
            raise ValueError(message)
        return self

    @property
    def tour(self) -> AdaptiveTour:
        """The rule by which one pose follows another."""
        from bench.adaptive_tour import adaptive_tour

        return adaptive_tour(self.least, self.tilt, self.horizontal, self.dip)

    def candidates(self) -> Sequence[Attitude]:
        """Return every pose that the step may visit."""
        return self.tour.candidates

    def poses(self) -> list[PlannedPose]:
        """Return the poses to expect where the readings are as noisy as stated.

        Raises
        ------
        ConfigError
            If the most poses would not do.
        """
        from bench.adaptive_tour import expected_count, foreseen_poses

        count = expected_count(self.tour, self.wanted, self.most)
        if count is None:
            reached_deg = self.tour.claimed_deg(foreseen_poses(self.tour, self.most))
            message = (
                f"step {self.name}: wanted must be at least the {reached_deg:.3f} deg that "
                f"{self.most} poses reach; instead received {self.wanted:g} deg"
            )
            raise ConfigError(message)
        return self.longest_poses()[:count]

    def longest_poses(self) -> list[PlannedPose]:
        """Return the poses of a run that ends at the most of them."""
        from bench.adaptive_tour import foreseen_poses

        return [self._planned(one) for one in foreseen_poses(self.tour, self.most)]

    def run(self, context: RunContext) -> None:
        """Visit poses and fit after each one; judge the peaks and what is claimed at the end.

        A fit that refuses the readings ends the step: the fit step judges it.

        Raises
        ------
        FieldChanged
            If poses were lost to a disturbed field, so that the rest cannot tell enough.
        BenchNotReady
            If they cannot in the station's field, where that is weaker than the step's.
        RigFault, ModuleSilent
            If a pose is not reached or the module stops sending.
        """
        from bench.acceptance.fit_evaluation import evaluate_claim
        from bench.acceptance.sensor_evaluation import evaluate_peaks

        first = len(context.calibration_positions)
        last = self._visited(context)
        positions = context.calibration_positions[first:]
        context.judge(evaluate_peaks(context.step_name, context.readings_at(positions)))
        if last.claim is None:
            return
        if last.claim.largest_deg > self.wanted and last.claim.stated_deg > self.wanted:
            raise self._not_told(context.step_name, len(positions), last)
        context.judge(evaluate_claim(context.step_name, last.claim, len(positions)))

    def _not_told(self, name: str, count: int, last: ClaimedFit) -> BenchError:
        """Return why readings as quiet as stated would not do either: no fault of the unit."""
        assert last.claim is not None  # noqa: S101
        told = (
            f"step {name}: poses must tell the heading to {self.wanted:g} deg; instead the {count} "
            f"visited tell it to {last.claim.stated_deg:.3f} deg"
        )
        if last.left_out:
            lost = f"{len(last.left_out)} of them were left out as disturbed"
            return FieldChanged(f"{told}, as {lost}: look for what moves near the rig")
        return BenchNotReady(f"{told} in this station's field: allow more poses, or ask for less")

    def _visited(self, context: RunContext) -> ClaimedFit:
        """Visit poses until the claim is small enough, or no more of them can help."""
        from bench.calibration.heading_claim import claimed

        first = len(context.calibration_positions)
        context.visit([self._planned(one) for one in self.tour.first], calibrates=True)
        claims: list[dict[str, object]] = []
        while True:
            readings = context.readings_at(context.calibration_positions)
            last = context.compute(partial(claimed, self._data(context, readings)))
            positions = context.calibration_positions[first:]
            if last.claim is not None:
                told = {"largest_deg": last.claim.largest_deg, "sigma": last.claim.sigma}
                claims.append({"position": positions[-1], "poses": len(positions), **told})
                context.event("claimed", step=context.step_name, **claims[-1])
            ended = self._ended(last, len(positions))
            if ended:
                section = {"wanted_deg": self.wanted, "ended": ended, "claims": claims}
                context.recorder.set("adaptive", section)
                return last
            visited = _attitudes(readings, last.left_out)
            following = self.tour.following(visited, context.require_rig().attitude)
            context.visit([self._planned(following)], calibrates=True)

    def _ended(self, last: ClaimedFit, count: int) -> str:
        """Return why no further pose is visited, empty where one is."""
        if last.claim is not None and last.claim.largest_deg <= self.wanted:
            return "wanted_reached"
        if last.claim is None and last.fit.cause not in MORE_MAY_HELP:
            return "fit_refused"
        return "most_poses" if count >= self.most else ""

    def _planned(self, attitude: Attitude) -> PlannedPose:
        return PlannedPose(attitude=attitude, direction=1, dwell_s=self.dwell)

    def _data(self, context: RunContext, readings: NDArray[np.void]) -> CalibrationData:
        from bench.acceptance.site import calibration_data

        return calibration_data(readings, context.station, paired=not context.synthesised)

    def measured(self) -> tuple[str, ...]:
        """Return the names of what is judged here."""
        return ("peak_reading", "predicted_uncertainty")


def _attitudes(readings: NDArray[np.void], left_out: frozenset[int]) -> list[Attitude]:
    """Return the rig's attitudes at the readings that count."""
    return [
        Attitude(
            azimuth_deg=float(reading["rig_azimuth_deg"]),
            pitch_deg=float(reading["rig_pitch_deg"]),
            roll_deg=float(reading["rig_roll_deg"]),
        )
        for row, reading in enumerate(readings)
        if row not in left_out
    ]
