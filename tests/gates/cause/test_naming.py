"""The cause from numbers alone: first red layer first, one limit each, NaN never holds."""

import json
from dataclasses import replace

import pytest
from planted import BROKEN, LIMITS, OFFSET, VALID, counts, limit, named

from gates.cause import (
    CauseName,
    Topic,
    deciding_answer,
)
from gates.cause.confidence import UNSEEN
from gates.cause.numbers import Kept, Labels, Residual
from gates.words import share_of
from genpolicy.audit.rows import Finding
from genpolicy.errors import ConfigError

ABSENT = counts(two_mode_episodes=0, two_mode=0)
WHITE = counts(two_mode_episodes=0, noise_ratio=0.9, white_share=0.3)


def test_all_green_is_valid_modes():
    cause = named(VALID)
    assert (cause.name, cause.topic, cause.text) == ("valid_modes", Topic.NONE, "valid_modes")
    judged = [answer for answer in cause.answers if answer.question != "component_modes"]
    assert all(answer.holds for answer in judged)
    assert json.loads(json.dumps([a.as_json() for a in cause.answers]))


def test_an_earlier_red_layer_is_believed_before_a_later_one():
    both = replace(BROKEN["hidden"][0], findings=(OFFSET,))
    assert named(both).name is CauseName.DATA_DEFECT
    # Below its limit the offset is no fault, and the next red layer decides.
    assert named(both, limit(clock_residual_s=0.05)).name is CauseName.HIDDEN_STATE


def test_a_frozen_stream_is_a_defect_beyond_its_own_limit_and_no_other():
    stuck = Finding("frozen", "camera", "ep1", "frozen_s", 0.5, 0.35, "s", "Leave it out.")
    cause = named(replace(VALID, findings=(stuck,)))
    assert (cause.name, cause.variable, cause.kind) == (CauseName.DATA_DEFECT, "camera", "frozen")
    assert named(replace(VALID, findings=(stuck,)), limit(frozen_s=0.5)).topic is Topic.NONE
    with pytest.raises(ConfigError, match="frozen_s"):
        named(VALID, limit(frozen_s=0.25))  # below what the audit looks for


@pytest.mark.parametrize(
    ("numbers", "kind"),
    [(counts(analysed=99), "neighbourhoods"), (counts(queries=2000), "neighbourhoods"),
     (replace(VALID, kept=Kept(0.95, 0.6, 29)), "persistence"),
     (counts(persistent=29), "persistence"),
     (counts(two_mode_episodes=0, queries=500), "neighbourhoods"),
     (replace(VALID, labels=Labels(10, 0)), "replay"),
     (replace(VALID, modes=VALID.modes[:1], alternatives=()), "linking")],
)  # fmt: skip
def test_too_little_is_said_to_be_too_little(numbers, kind):
    cause = named(numbers)
    assert (cause.name, cause.kind) == (CauseName.INSUFFICIENT_SUPPORT, kind)


def test_clusters_that_do_not_persist_and_white_spread_are_noise():
    fading = replace(VALID, kept=Kept(0.65, 0.6, 118))
    assert named(fading).name is CauseName.POINTWISE_NOISE
    assert named(fading, limit(persistence_margin=0.04)).name is CauseName.VALID_MODES
    white = counts(two_mode_episodes=0, noise_ratio=0.9, white_share=0.3)
    assert named(white).name is CauseName.POINTWISE_NOISE
    quiet = counts(two_mode_episodes=0, noise_ratio=0.9, white_share=0.3, noise_spread=0.001)
    assert named(quiet).name is CauseName.UNIMODAL
    # In pixels a metre is a thousand of them, and a spread of a hundredth of one is nothing.
    assert named(replace(white, metre=1000.0)).name is CauseName.UNIMODAL


@pytest.mark.parametrize("said", [VALID, BROKEN["hidden"][0], ABSENT, WHITE])
def test_what_most_resampled_audits_contradict_is_not_said(said):
    fault, label, thin = (BROKEN[layer][0] for layer in ("data", "labels", "support"))
    half = named(said, draws=[said] * 10 + [fault] * 10)
    assert half.name is named(said).name and half.agreeing == (10, 20)
    most = named(said, draws=[said] * 9 + [fault] * 8 + [label] * 3 + [thin] * 4)
    assert (most.name, most.kind) == (CauseName.INSUFFICIENT_SUPPORT, "unstable")
    assert (most.topic.value, most.agreeing) == ("agreement", (11, 24))
    assert most.confidence == pytest.approx((1.0 - UNSEEN) * 11 / 25)
    assert f"9 say {named(said).name}, 11 another cause" in most.next_action
    assert f"8 of them data_defect({named(fault).variable}, clock). If" in most.next_action
    assert named(fault).next_action in most.next_action
    # Leaving it open contradicts nothing.
    for draws in ([said] * 2 + [thin] * 18, [thin] * 20):
        assert named(said, draws=draws).name is named(said).name
    # What stands in the rows stands, and so does what is missing.
    for layer in ("data", "labels", "support"):
        found = BROKEN[layer][0]
        assert named(found, draws=[VALID] * 20).name is named(found).name


def test_which_of_two_variables_is_named_is_no_other_cause():
    one = BROKEN["hidden"][0]
    other = replace(one, strata=tuple(replace(row, variable="zq7") for row in one.strata))
    cause = named(one, draws=[one] * 9 + [other] * 11)
    assert (cause.name, cause.agreeing) == (CauseName.HIDDEN_STATE, (9, 20))


def test_confidence_rests_on_the_share_of_draws_that_name_the_same():
    draws = [VALID] * 3 + [BROKEN["hidden"][0]]
    assert named(VALID, draws=draws).confidence == pytest.approx((1.0 - UNSEEN) * 3 / 5)
    assert named(VALID, draws=draws).agreeing == (3, 4)
    assert named(VALID).confidence is None
    # Of no number of draws is one sure, since all of them look where the whole audit looked.
    sure = named(VALID, draws=[VALID] * 200).confidence
    assert sure == pytest.approx((1.0 - UNSEEN) * 200 / 201) and sure < 0.96


@pytest.mark.parametrize(
    ("labels", "name", "kind"),
    [
        (Labels(0, 0), "valid_modes", ""), (Labels(1, 0), "insufficient_support", "replay"),
        (Labels(10, 0), "insufficient_support", "replay"),
        (Labels(10, 1), "label_contamination", "replay"), (Labels(60, 1), "valid_modes", ""),
    ],
)  # fmt: skip
def test_labels_are_contaminated_from_one_disagreement_on(labels, name, kind):
    cause = named(replace(VALID, labels=labels))
    assert (cause.name.value, cause.kind) == (name, kind)
    (answer,) = [a for a in cause.answers if a.question == "label_disagreement"]
    assert (answer.limit is None) == (answer.measured is None) == (labels.replays == 0)
    assert answer.interval is None or answer.interval[1] == answer.measured
    assert (answer.interval is None) == (labels.replays == 0)
    told = share_of(labels.disagreements, labels.replays, "replayed")
    assert answer.note == (told if labels.replays else "no replay: labels are taken as they are")


def _offset(measured, **changes):
    return replace(OFFSET, measured=measured, **changes)


def test_the_answer_on_which_a_question_rests_is_the_one_furthest_beyond_its_limit():
    def asked(*found, residual=None):
        residuals = {"clock_residual_s": Residual(residual, "not measured")}
        numbers = replace(VALID, findings=found, residuals=residuals)
        answer = deciding_answer("clock_residual_s", numbers, limit(clock_residual_s=0.02))
        return answer.measured

    small, large = _offset(0.05), _offset(0.07)
    assert asked(small, large) == asked(large, small) == 0.07
    # One that is not known comes before those that keep the limit, and after those that do not.
    assert asked(_offset(0.01)) is None and asked(_offset(0.01), residual=0.015) == 0.015
    assert asked(_offset(0.015), residual=0.01) == 0.015
    assert asked(small) == 0.05
    assert asked(residual=0.02) == 0.02 and asked(residual=0.0201) is None
    assert deciding_answer("clock_residual_s", VALID, limit()) is None


def test_of_what_is_beyond_what_is_open_and_what_holds_the_worst_decides():
    """A mode far beyond, one just beyond, one not known and one that holds, in any order."""
    good, blank = VALID.modes[0], replace(VALID.modes[0], mode="blank", episodes=0, successes=0)
    bad = replace(VALID.modes[0], mode="bad", successes=30)
    worse = replace(bad, mode="worse", successes=20)

    def asked(*modes):
        for order in (modes, modes[::-1]):
            numbers = replace(VALID, modes=order, alternatives=())
            yield deciding_answer("mode_success_lower", numbers, limit()).what.split()[2]

    assert set(asked(good, blank, bad, worse)) == {"worse,"}
    assert set(asked(good, blank, bad)) == {"bad,"}
    assert set(asked(good, blank)) == {"blank,"}


def test_of_two_defects_the_first_is_named_and_both_are_shown():
    other = _offset(0.09, variable="camera")
    cause = named(replace(VALID, findings=(OFFSET, other)))
    assert cause.variable == OFFSET.variable
    assert sum(answer.red for answer in cause.answers) == 2
    harmless = _offset(0.01, variable="camera")
    assert named(replace(VALID, findings=(harmless, OFFSET))).variable == OFFSET.variable


@pytest.mark.parametrize("metre", [1.0, 1000.0])
def test_a_length_is_held_to_its_limit_in_the_unit_of_the_data(metre):
    at = LIMITS["calibration_residual_m"] * metre
    frame = _offset(at, question="calibration_residual_m", kind="calibration", floor=0.0, unit="m")
    for measured, red in ((at, False), (1.01 * at, True)):
        moved = replace(frame, measured=measured)
        cause = named(replace(VALID, findings=(moved,), metre=metre))
        assert (cause.name is CauseName.DATA_DEFECT) == red
        residuals = {"calibration_residual_m": Residual(measured)}
        answer = deciding_answer(
            "calibration_residual_m", replace(VALID, residuals=residuals, metre=metre), limit()
        )
        assert answer.measured == (None if red else at)
    clock = replace(VALID, findings=(_offset(0.011),), metre=metre)
    assert named(clock).name is CauseName.DATA_DEFECT


def test_an_unstable_cause_asks_those_that_name_one_alone():
    hidden, thin = BROKEN["hidden"][0], BROKEN["support"][0]
    assert named(VALID, draws=[VALID] + [hidden] + [thin] * 8).name is CauseName.VALID_MODES
    assert named(VALID, draws=[VALID] + [hidden] * 2 + [thin] * 8).kind == "unstable"
    assert named(VALID, draws=[hidden]).kind == "unstable"
    # Ten of eighteen are most of them, and less than three quarters.
    most = [VALID] * 10 + [hidden] * 8 + [thin] * 2
    (answer,) = [a for a in named(VALID, draws=most).answers if a.question == "cause_agreement"]
    assert answer.measured == pytest.approx(10 / 18) and answer.holds
    assert named(VALID, limit(cause_agreement=0.75), draws=most).kind == "unstable"
