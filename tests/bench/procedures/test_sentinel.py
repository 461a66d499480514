"""Where the visits to a sentinel pose stand among the poses of a step."""

from __future__ import annotations

import pytest

from bench.pose import Attitude
from bench.steps.sentinel import Sentinel
from bench.steps.step import PlannedPose

SENTINEL = Sentinel.model_validate({"every": 3, "azimuth": "5 deg"})


def poses_of(count):
    return [
        PlannedPose(attitude=Attitude(azimuth_deg=30.0 * number), dwell_s=0.5)
        for number in range(1, count + 1)
    ]


@pytest.mark.parametrize(
    ("count", "visits"), [(1, "s1s"), (3, "s123s"), (4, "s123s4s"), (7, "s123s456s7s")]
)
def test_the_sentinel_comes_first_after_every_few_poses_and_last(count, visits):
    planned = poses_of(count)

    found = SENTINEL.among(planned, with_reference=False)

    words = {SENTINEL.planned().attitude: "s"}
    words |= {pose.attitude: str(number) for number, pose in enumerate(planned, 1)}
    assert "".join(words[pose.attitude] for pose in found) == visits


def test_a_reference_magnetometer_or_no_pose_leaves_the_sentinel_out_unless_always():
    always = SENTINEL.model_copy(update={"always": True})

    assert SENTINEL.among([], with_reference=False) == []
    assert len(SENTINEL.among(poses_of(3), with_reference=True)) == 3
    assert len(always.among(poses_of(3), with_reference=True)) == 5
