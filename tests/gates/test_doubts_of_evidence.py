"""Each rule where it speaks and where it must not, on criteria as gates write them."""

import evidence
import pytest
from test_differences import REPORT
from test_verdicts import criterion

from gates.card.card import caveats_of
from gates.claim import MEDIAN_PASSES, SHOWN
from gates.doubt import Doubt
from gates.doubts import doubts_of, for_a_card
from gates.doubts_of_evidence import FEW, ONE_MODE
from gates.proof import judge
from gates.stress.contact import UNTOUCHED
from gates.words import percent, share_of


def answer(verdict="PASS", candidate="flow", name="x", **changes):
    return criterion(verdict, candidate, name).model_copy(update=changes)


def said(kind, *answers, **changes):
    """Doubts of one kind about a gate of these criteria."""
    report = REPORT.model_copy(update={"criteria": answers, "caveats": (), **changes})
    return [doubt for doubt in doubts_of(report) if doubt.kind == kind]


HARDLY = "not measured: hardly exercised: contact on 2 of 90 starts, in any condition"
NEVER = "not measured: not exercised: recovery began on 0 starts, in any condition"


@pytest.mark.parametrize(("caveat", "kind"), [
    (HARDLY, "hardly exercised"), (NEVER, "never exercised"),
])  # fmt: skip
def test_what_no_rollout_tried_is_not_called_unmeasured(caveat, kind):
    open_one = answer("INCONCLUSIVE", name="force", caveat=caveat)
    (doubt,) = said(kind, open_one)
    assert doubt.criteria == ("force",) and caveat[1:] in doubt.text
    assert not said("not measured", open_one)


@pytest.mark.parametrize("other", [
    answer("INCONCLUSIVE", caveat="not measured: no rows"),
    answer("PASS", caveat="contact on 88 starts; not exercised"),
    answer("PASS", caveat=HARDLY),
])  # fmt: skip
def test_what_was_tried_or_lacks_for_another_reason_was_not_left_unexercised(other):
    assert not said("never exercised", other) and not said("hardly exercised", other)
    assert bool(said("not measured", other)) == (other.verdict == "INCONCLUSIVE")


AROUND = (
    "flow: the card's box reaches up to 20 mm beyond what was visited (-y 20 mm), so that a trial "
    "may go where no rollout was."
)


def test_a_box_that_was_not_visited_is_a_doubt_and_no_general_caveat():
    (doubt,) = said("not visited", caveats=(AROUND, "Simulation."))
    assert doubt == Doubt("A", "not visited", AROUND, (), "flow")
    (rest,) = said("not shown", caveats=(AROUND, "Simulation."))
    assert rest.text == "Simulation."
    assert not said("not visited", caveats=("Simulation.",))


UNSEEN = "flow: no contact in 1,080 of 1,080 rollouts, so that no force of it was ever seen."


def test_a_candidate_that_touched_nothing_is_a_doubt_and_no_general_caveat():
    assert UNTOUCHED.match(UNSEEN)
    (doubt,) = said("never exercised", caveats=(UNSEEN, "Simulation."))
    assert doubt == Doubt("A", "never exercised", UNSEEN, (), "flow")
    (rest,) = said("not shown", caveats=(UNSEEN, "Simulation."))
    assert rest.text == "Simulation."
    touched = UNSEEN.replace("no contact", "contact")
    assert not said("never exercised", caveats=(touched,))


def test_a_card_carries_that_nothing_was_touched():
    report = REPORT.model_copy(update={
        "criteria": (answer(name="x"),), "verdict": "PASS", "promoted": "flow",
        "candidates": {"flow": "PASS"}, "caveats": (UNSEEN,),
    })  # fmt: skip
    assert UNSEEN in caveats_of({"D": report})


@pytest.mark.parametrize(("answered", "text"), [
    (answer("INCONCLUSIVE", None, "unasked_checks", caveat="not asked: past.a (no history)"),
     "Not asked: past.a (no history)."),
    (answer("PASS", None, caveat="all 80 detected; of them not asked of this task: a.b (no part)"),
     "This task has no case of a.b (no part)."),
])  # fmt: skip
def test_a_question_without_a_case_is_not_testable(answered, text):
    (doubt,) = said("not testable", answered)
    assert doubt.text == f"? {text}"
    assert not said("not measured", answered)


WAIVED = {"waived_checks": {"model": {"past.a": "no history"}, "safety": {"clock.b": "one clock"}}}


@pytest.mark.parametrize(("caveat", "silent"), [
    ("11 questions, 2 of them waived", "past.a, clock.b"),
    ("11 questions, 1 of them waived; waived without need here: clock.b", "past.a"),
    ("11 questions; waived without need here: clock.b, past.a", ""),
])  # fmt: skip
def test_a_waiver_of_what_could_not_be_asked_is_not_testable(caveat, silent):
    """A waiver that the data did not need hides nothing."""
    found = said("not testable", answer("PASS", None, "unasked_checks", caveat=caveat),
                 settings=WAIVED)  # fmt: skip
    assert [f"{silent[:1].upper()}{silent[1:]} could not be asked" in d.text for d in found] == (
        [True] if silent else []
    )
    assert not said("not testable", answer("PASS", None, "another", caveat=caveat), settings=WAIVED)
    if not silent:
        return
    report = REPORT.model_copy(update={
        "criteria": (answer("PASS", None, "unasked_checks", caveat=caveat),), "settings": WAIVED,
    })  # fmt: skip
    assert any(text.startswith("Gate A, not testable") for text in for_a_card(report, "flow"))


LATE = "worst in nominal: 100 ms; cold at most 1.2 s, beyond the maximum action age"


def test_a_first_answer_that_comes_too_late_is_a_cold_start():
    (doubt,) = said("cold start", answer(name="latency_p95_s", caveat=f"{LATE} of 450 ms"))
    assert "up to 1.2 s" in doubt.text and "older than 450 ms" in doubt.text
    assert doubt.candidate == "flow" and doubt.criteria == ("latency_p95_s",)
    assert not said("cold start", answer(caveat="at most 200 ms; cold at most 400 ms"))


def test_a_mean_that_one_condition_does_not_share_is_an_average():
    (doubt,) = said("an average", answer(caveat="worst in camera_delay -12.5 points over bc"))
    assert "in camera_delay it is -12.5 points" in doubt.text
    assert not said("an average", answer(caveat="worst in camera_delay +12.5 points over bc"))
    assert not said(
        "an average", answer("FAIL", caveat="worst in camera_delay -100 points over bc")
    )


@pytest.mark.parametrize(("counted", "few"), [
    (f"{FEW - 1} starts", True), (f"{FEW} starts", False), (f"24 of {FEW - 1} episodes", True),
    (f"3 of {FEW} episodes", False), (f"{FEW} and 3 processes", True),
    (f"{FEW} and {FEW} processes", False), ("", False), ("3 episodes of the rarer mode", True),
    ("12 held-out episodes, 80 recorded moments", True),
    ("40 held-out episodes, 8 recorded moments", False), ("2 times", False),
])  # fmt: skip
@pytest.mark.parametrize("verdict", ["PASS", "FAIL", "INCONCLUSIVE"])
def test_a_number_of_few_units_is_one_of_which_little_can_be_said(counted, few, verdict):
    found = said("small n", answer(verdict, counted=counted))
    assert len(found) == (few and verdict != "INCONCLUSIVE")
    if found:
        assert f"x ({counted})" in found[0].text


def test_the_fewest_are_named_first_and_each_criterion_once():
    many = [answer(name=f"n{n}", counted=f"{n} starts") for n in (9, 3, 5, 7)]
    twice = answer(candidate="act", name="n9", counted="2 starts")
    (doubt,) = said("small n", *many, twice)
    listed = "n9 (2 starts), n3 (3 starts), n5 (5 starts) and 1 more"
    assert doubt.text == f"4 criteria rest on fewer than {FEW} units: {listed}"
    (doubt,) = said("small n", many[1])
    assert doubt.text.startswith("1 criterion rests on")


def test_a_candidate_that_was_trained_once_is_named():
    one = "540 starts by state hash, of 1 training seed; chunked_bc 0"
    (doubt,) = said("one training seed", answer(caveat=one), answer(candidate="act", caveat=one))
    assert doubt.text.startswith("flow, act: trained once")
    assert not said("one training seed", answer(caveat=one.replace("1 training seed", "11 training"
                                                                   " seeds")))  # fmt: skip


@pytest.mark.parametrize("caveat", [
    "bc_noise with 0.43 of 223 situations, 4 candidates each (a 0.4), of 1 training seed; upper",
    "80 samples of 1 training seed, 0 not bit-equal",
])  # fmt: skip
def test_gates_a_and_b_say_that_they_saw_one_training_too(caveat):
    (doubt,) = said("one training seed", answer(candidate=None, name="remedy", caveat=caveat))
    assert doubt.text.startswith("the simpler policies that this gate judges: trained once")
    assert doubt.criteria == ("remedy",) and doubt.candidate == ""
    many = caveat.replace("1 training seed", "3 training seeds")
    assert not said("one training seed", answer(candidate=None, caveat=many))


def test_the_ladder_of_one_seed_says_so_at_each_gate_that_has_trained_policies(judged):
    for gate in "ABD":
        report = judged(gate)
        (found,) = [d for d in doubts_of(report) if d.kind == "one training seed"]
        assert len(found.criteria) == 1


def median_of(passed, of):
    return f"share 1; the {MEDIAN_PASSES} {share_of(passed, of)} ({SHOWN})"


def one_mode_of(share):
    return f"of 9; bound; one_mode_bc in {percent(share)} ({SHOWN}: with one valid mode it stays"


@pytest.mark.parametrize(("caveat", "passes"), [
    (median_of(349, 360), True),
    (median_of(1080, 1080), True),
    (median_of(179, 360), False),
    (median_of(0, 360), False),
    (median_of(0, 0), False),
    (one_mode_of(0.987), True),
    (one_mode_of(0.487), False),
    ("0.4 of 9; bound", False),
])  # fmt: skip
@pytest.mark.parametrize("verdict", ["PASS", "INCONCLUSIVE"])
def test_a_simpler_rule_that_is_only_shown_is_a_doubt_where_it_passes(caveat, passes, verdict):
    found = said("a simpler rule passes", answer(verdict, None, caveat=caveat, interval=(0.0, 1.0)))
    assert len(found) == passes
    for doubt in found:
        assert any(told in doubt.text for told in ("349 of 360", "1,080 of 1,080", "98.7 %"))
        assert SHOWN in doubt.text


def test_gate_a_writes_what_the_rule_of_simpler_rules_reads(ladder, judged):
    """By the evidence: wherever the median of all passes, and one mode alone acts validly."""
    before = [d for d in doubts_of(judged("A")) if d.kind == "a simpler rule passes"]
    evidence.edit_table(ladder, "audit/neighbourhoods.parquet",
                        lambda f: f.assign(median_admissible=True))  # fmt: skip
    report = judge(ladder, "A")
    after = [d for d in doubts_of(report) if d.kind == "a simpler rule passes"]
    new = [d for d in after if d not in before]
    assert [d.criteria[0] for d in new] == ["mean_defeated_share"]
    caveats = {c.id: c.caveat for c in report.criteria}
    assert ONE_MODE.search(caveats["remedy_valid_share"])
    assert ONE_MODE.search(caveats["remedy_valid_share"])[1] == "one_mode_bc"


def test_terms_that_somebody_wrote_down_are_counted_once():
    text = "6 of 11 terms declared, not measured: exposure, capture; nothing is done where"
    (doubt,) = said("declared", answer(caveat=text), answer(candidate="act", caveat=text))
    assert doubt.text == "6 of 11 latency terms are declared, not measured: exposure, capture"
    assert not said("declared", answer(caveat="0 of 11 terms declared, not measured: none"))
