from __future__ import annotations

from dashboards.verdict_text import deviation_markdown, methods_markdown, verdict_markdown


def measurement(name: str, outcome: str, **limits: float | None) -> dict[str, object]:
    row = {"name": name, "value": 0.25, "unit": "deg", "low": None, "high": None}
    return {**row, "outcome": outcome, **limits}


def test_missed_limits_stand_first() -> None:
    record = {
        "run": {"serial": "SN7"},
        "verdict": {"outcome": "FAIL", "reason": "b is above", "next_action": "red bin"},
        "measurements": [
            measurement("a", "PASS", high=0.5),
            measurement("b", "FAIL", high=0.2),
            measurement("informs", "PASS"),
        ],
    }

    text = verdict_markdown(record)

    assert text.startswith("# FAIL  `SN7`")
    assert text.index("| b |") < text.index("| a |")
    assert "informs" not in text


def test_headings_stand_before_what_else_passed() -> None:
    rows = [measurement("noise_x", "PASS", high=1.0), measurement("level_max", "PASS", high=0.5)]

    text = verdict_markdown({"measurements": rows})

    assert text.index("| level_max |") < text.index("| noise_x |")


def test_limits_are_told_by_their_sides() -> None:
    record = {
        "measurements": [
            measurement("below", "PASS", high=0.5),
            measurement("above", "PASS", low=0.1),
            measurement("between", "PASS", low=0.1, high=0.5),
        ]
    }

    text = verdict_markdown(record)

    assert "| below | 0.25 | ≤ 0.5 |" in text
    assert "| above | 0.25 | ≥ 0.1 |" in text
    assert "| between | 0.25 | 0.1 … 0.5 |" in text


def test_uncertainty_conformity_and_spoiled_poses_are_told() -> None:
    spoiled = {
        "position": 3, "step": "verify", "change_mg": 2.0, "source": "reference", "repeated_as": 9,
    }  # fmt: skip
    row = measurement("level_max", "PASS", high=0.5) | {"uncertainty": 0.08, "conformity": 0.987}
    watch = {"source": "reference", "spoiled": [spoiled]}

    text = verdict_markdown({"measurements": [row], "field_watch": watch})

    assert "| level_max | 0.25 | ≤ 0.5 | deg | 0.08 | 98.7 % | pass |" in text
    assert "The field changed at 1 pose; repeated" in text


def test_methods_say_claim_expected_and_achieved_and_which_claim_is_wrong() -> None:
    fit = {
        "method": "four_position", "cause": None, "predicted_heading_rms_deg": 0.053,
        "achieved": {"level_rms_deg": 1.4, "tilt_rms_deg": 4.7},
    }  # fmt: skip
    study = {
        "expected": {"four_position": {"level_rms_deg": 1.37, "tilt_rms_deg": 4.67}},
        "expected_noise": {"level_deg": 0.09, "tilt_deg": 0.09},
        "claim_without": {"four_position": "level only"},
    }

    text = methods_markdown({"fits": [fit], "study": study})

    assert "| four positions | **0.053 !** | 1.37 / 4.67 | 1.40 / 4.70 |" in text
    assert "wrong without saying so" in text


def test_run_without_a_verdict_is_told_as_broken_off() -> None:
    assert "broken off" in verdict_markdown({"run": {"serial": "SN7"}})


def test_methods_stand_in_the_order_of_their_rank_and_refusals_say_why() -> None:
    good = {"method": "good", "cause": None, "achieved": {"level_max_deg": 0.2}}
    refused = {"method": "refused", "cause": "no_turn", "achieved": {}}

    text = methods_markdown({"fits": [refused, good], "ranking": ["good", "refused"]})

    assert text.index("| good |") < text.index("| refused |")
    assert "| refused | refused: no turn |" in text


def test_raw_readings_stand_before_the_methods_and_the_orders_after_them() -> None:
    best = {"method": "truth_aided", "cause": None, "achieved": {"level_max_deg": 0.2}}
    study = {
        "raw": {"level_max_deg": 36.0},
        "tilt_from": {"truth_aided": "own"},
        "orders": {
            "truth_aided": {
                "tilt_first": {"level_max_deg": 0.2, "tilt_max_deg": 11.0},
                "body": {"level_max_deg": 0.2, "tilt_max_deg": 0.3},
            }
        },
    }

    text = methods_markdown({"fits": [best], "ranking": ["truth_aided"], "study": study})

    assert text.index("| raw readings | – | – / – | – / – | 36.0 / – |") < text.index(
        "| truth aided | – | – / – | – / – | 0.200 / – | its own |"
    )
    assert "| method | hard, soft, tilt | tilt, hard, soft |" in text
    assert "| truth aided | 0.200 / 0.300 | 0.200 / 11.0 |" in text


def test_deviation_shows_standard_errors_and_words() -> None:
    raw = {
        "A": 1.0,
        "B": 12.0,
        "C": 8.0,
        "D": 5.0,
        "E": 1.5,
        "se": {"A": 0.1},
        "words": "hard iron",
    }

    text = deviation_markdown({"deviation": {"raw": raw}})

    assert "| A | 1 ± 0.1 |" in text
    assert "**Raw:** hard iron" in text
