from __future__ import annotations

from bench.record.bridge_words import adaptive_words, bridge_rows

TERMS = {
    "hk_mg": {"value": [7900.0, 8100.0, None], "sd": [8.0, 9.0, None], "corrected": True},
    "hysteresis_mg": {"value": [None] * 3, "sd": [None] * 3, "corrected": False},
    "sensitivity_tempco_per_c": {"value": [-0.003], "sd": [0.001], "corrected": False},
}
REASON = "it cancels in the heading"


def record_of(terms):
    return {"bridge_terms": {name: {"why_not": REASON, **term} for name, term in terms.items()}}


def test_each_term_is_shown_by_axis_in_its_own_unit_with_what_was_done():
    cross_axis, hysteresis, tempco = bridge_rows(record_of(TERMS))

    assert cross_axis.seen == ("7.9000 ± 0.0080", "8.1000 ± 0.0090", "\N{EN DASH}")
    assert (cross_axis.unit, cross_axis.done) == ("G", "corrected, in bench and module")
    assert (hysteresis.seen, hysteresis.done) == (("not seen",), REASON)
    assert tempco.seen == ("\N{MINUS SIGN}0.30 ± 0.10",)


def test_a_record_without_these_sections_shows_neither():
    assert bridge_rows({}) == []
    assert adaptive_words({}) == adaptive_words({"adaptive": {"claims": []}}) == ""


def test_poses_that_did_not_suffice_say_why_there_are_no_more():
    claims = [{"poses": 8, "largest_deg": 0.5}]
    adaptive = {"wanted_deg": 0.2, "ended": "most_poses", "claims": claims}

    words = adaptive_words({"adaptive": adaptive})

    assert words == (
        "8 poses: the claimed largest error is 0.500 deg, where 0.2 deg was wanted; "
        "no more poses are allowed."
    )
