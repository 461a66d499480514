"""What the report says of the field through the run."""

from __future__ import annotations

from bench.record.field_watch_words import field_watch


def spoiled(position, repeated_as=None, source="reference"):
    return {
        "position": position, "step": "verify", "change_mg": 1.9, "source": source,
        "repeated_as": repeated_as,
    }  # fmt: skip


def test_a_run_that_nothing_watched_says_nothing():
    assert field_watch({}) is None
    assert field_watch({"field_watch": {"source": "none"}}) is None


def test_a_quiet_field_is_told_with_its_drift():
    found = field_watch({"field_watch": {"source": "reference", "drift_mg": 0.0422}})

    assert found["source"] == "watched by the reference magnetometer"
    assert found["words"].startswith("The field spoiled no pose.")
    assert "0.042 mG" in found["words"]


def test_spoiled_poses_are_counted_with_those_repeated():
    watch = {"source": "sentinel", "spoiled": [spoiled(3, 9), spoiled(4, source="sentinel")]}

    found = field_watch({"field_watch": watch})

    assert "at 2 poses; 1 of them repeated" in found["words"]
    assert [row["noticed_by"] for row in found["spoiled"]] == [
        "the reference magnetometer", "sentinel poses of the module itself",
    ]  # fmt: skip


def test_all_repeated_is_said_so():
    watch = {"source": "reference", "spoiled": [spoiled(3, 9)]}

    assert "at 1 pose; repeated" in field_watch({"field_watch": watch})["words"]
