"""The short table of methods after a run."""

from __future__ import annotations

from typing import Any

from bench.cli.method_table import method_table


def record(**changes: Any) -> dict[str, Any]:
    def fit(method: str, claim_deg: float, level_deg: float, tilt_deg: float) -> dict[str, Any]:
        achieved = {"level_rms_deg": level_deg, "tilt_rms_deg": tilt_deg}
        return {
            "method": method, "cause": None, "achieved": achieved,
            "predicted_heading_rms_deg": claim_deg,
        }  # fmt: skip

    refused = {"method": "ellipsoid", "cause": "no_turn", "message": "turn it", "achieved": {}}
    study = {
        "expected": {"four_position": {"level_rms_deg": 1.37, "tilt_rms_deg": 4.67}},
        "expected_noise": {"level_deg": 0.09, "tilt_deg": 0.09},
        "claim_without": {"four_position": "level only"},
    }
    fits = [fit("truth_aided", 0.035, 0.098, 0.142), fit("four_position", 0.053, 1.4, 4.7), refused]
    return {"fits": fits, "study": study, **changes}


def test_every_accepted_method_has_a_line_with_claim_expected_and_achieved_error() -> None:
    head, best, other, mark = method_table(record())

    assert head.split()[-6:] == ["claim", "expected", "achieved", "the", "claim", "is"]
    assert best.split() == ["truth", "aided", "0.035", "–", "0.098", "/", "0.142"]
    assert "0.053 !" in other
    assert "1.37 / 4.67" in other
    assert other.endswith("1.40 / 4.70   level only")
    assert mark.startswith("! wrong without saying so")


def test_lines_fit_on_a_narrow_terminal() -> None:
    assert max(map(len, method_table(record()))) <= 100


def test_a_run_without_a_model_says_why_nothing_was_expected() -> None:
    study = {"expected": None}

    assert method_table(record(study=study))[-1] == "no expected error: the record has none"


def test_a_run_that_verified_nothing_has_no_table() -> None:
    fits = [{"method": "min_max", "cause": None, "achieved": {}}]

    assert method_table({"fits": fits}) == []
    assert method_table({}) == []
