"""Simple methods that were not met show nothing; what a candidate may not do is told of them."""

import evidence
import pytest
from asked import found_in, settings_of
from editing import cells

from gates.evidence import Evidence, MissingEvidenceError
from gates.proof import judge
from gates.stress.simple import require_met

ROLLOUTS = "stress/rollouts.parquet"
SIMPLE = "chunked_bc"
HELD = "Of the simple methods"


def of(frame, condition=None):
    mine = frame["method"] == SIMPLE
    return mine if condition is None else mine & (frame["perturbation"] == condition)


def silenced(root, condition):
    """It holds for the whole time, is late with everything and succeeds nowhere."""
    for column, value in (("fallback_ticks", 0), ("hold_ticks", 160), ("action_ticks", 0)):
        change = cells(column, value, where=lambda f: of(f, condition))
        evidence.edit_table(root, ROLLOUTS, change)


def asked(root, **update):
    settings = settings_of(root, "D")
    require_met(Evidence(root), settings.model_copy(update=update) if update else settings)


def gains(report):
    return {c.candidate: c for c in found_in(report, "promotion_e_value")}


def test_simple_methods_that_were_met_stop_nobody(ladder):
    asked(ladder)
    report = judge(ladder, "D")
    assert report.verdict == "PASS" and not any(text.startswith(HELD) for text in report.caveats)


@pytest.mark.parametrize("condition", ["nominal", "envelope"])
def test_nobody_is_promoted_over_who_commanded_nothing_in_one_condition(ladder, condition):
    silenced(ladder, condition)
    report = judge(ladder, "D")
    assert report.promoted is None and report.verdict == "INCONCLUSIVE"
    for criterion in gains(report).values():
        assert criterion.verdict == "INCONCLUSIVE"
        assert f"{SIMPLE} commanded nothing in {condition}: nothing" in criterion.caveat


INVOCATIONS = "stress/invocations.parquet"


def condition_lost(frame):
    return of(frame, "envelope")


def start_lost(frame):
    return of(frame, "envelope") & (frame["start"] == 4)


def answer_lost(frame):
    return start_lost(frame) & (frame["invocation"] == 2)


@pytest.mark.parametrize(
    ("lost", "told"),
    [
        (of, f"no rows of {SIMPLE}"),
        (condition_lost, f"rollout {SIMPLE}, envelope, start 0 states 20, recorded are 0"),
        (start_lost, f"rollout {SIMPLE}, envelope, start 4 states 20, recorded are 0"),
        (answer_lost, f"rollout {SIMPLE}, envelope, start 4 states 20, recorded are 19"),
    ],
)
def test_a_simple_method_of_whose_invocations_some_lack_was_not_compared(ladder, lost, told):
    evidence.edit_table(ladder, INVOCATIONS, lambda f: f[~lost(f)])
    with pytest.raises(MissingEvidenceError, match=told):
        asked(ladder)


def test_nobody_is_promoted_over_who_has_no_invocations_in_one_condition(ladder):
    """Its rollouts say that it commanded there; who was asked, and how long it took, nobody knows.

    A rehearsal is refused too: hardly trained networks are asked as any others.
    """
    evidence.edit_table(ladder, INVOCATIONS, lambda f: f[~condition_lost(f)])
    report = judge(ladder, "D")
    assert report.promoted is None and report.verdict == "INCONCLUSIVE"
    for criterion in gains(report).values():
        assert criterion.verdict == "INCONCLUSIVE" and "recorded are 0" in criterion.caveat
    evidence.write_params(ladder, lambda p: p.update(rehearsal=True))
    with pytest.raises(MissingEvidenceError, match="recorded are 0"):
        asked(ladder)


def test_one_command_is_one(ladder):
    silenced(ladder, "nominal")
    one = cells("action_ticks", 1, where=lambda f: of(f, "nominal") & (f["start"] == 4))
    evidence.edit_table(ladder, ROLLOUTS, one)
    asked(ladder)


def test_a_rehearsal_is_told_of_who_commanded_nothing_and_not_refused(ladder):
    evidence.write_params(ladder, lambda p: p.update(rehearsal=True))
    silenced(ladder, "nominal")
    report = judge(ladder, "D")
    assert {c.verdict for c in gains(report).values()} == {"PASS"}
    (said,) = [text for text in report.caveats if text.startswith(HELD)]
    assert f"{SIMPLE} stands in 100 % of its ticks in nominal (limit 25 %)" in said


@pytest.mark.parametrize(
    ("table", "change", "said"),
    [
        ("stub", lambda f: f[~of(f)], f"no rows of {SIMPLE}"),
        ("stub", lambda f: f[~of(f, "push") & ~of(f, "envelope")], "envelope"),
        ("conservation", lambda f: f[~of(f, "envelope")], "envelope"),
        ("counts", lambda f: f[~of(f)], f"no rows of {SIMPLE}"),
        ("stub", cells("stale", 1, where=lambda f: of(f, "nominal")), f"1 stale .* of {SIMPLE}"),
        ("stub", cells("invalid", 2, where=lambda f: of(f, "nominal")), "2 stale or invalid"),
        ("conservation", cells("executed", 85, where=lambda f: of(f, "nominal")), "3 actions of"),
        ("counts", cells("count", 6, where=lambda f: of(f, "nominal")), f"4 actions of {SIMPLE}"),
    ],
)
def test_a_simple_method_without_stub_or_balance_was_not_compared(ladder, table, change, said):
    evidence.edit_table(ladder, f"stress/{table}.parquet", change)
    with pytest.raises(MissingEvidenceError, match=said):
        asked(ladder)
    report = judge(ladder, "D")
    assert report.promoted is None
    assert {c.verdict for c in gains(report).values()} == {"INCONCLUSIVE"}


@pytest.mark.parametrize(
    ("column", "value", "told"),
    [
        ("hold_ticks", 41, "stands in 25.6 % of its ticks in envelope (limit 25 %)"),
        ("deadline_misses", 3, "is late with 15 % of its answers in envelope (limit 10 %)"),
        ("rejections", 5, "has 25 % of its answers rejected in envelope (limit 20 %)"),
    ],
)
def test_a_simple_method_that_a_candidate_could_not_be_is_told_and_compared(
    ladder, column, value, told
):
    change = cells(column, value, where=lambda f: of(f, "envelope"))
    evidence.edit_table(ladder, ROLLOUTS, change)
    report = judge(ladder, "D")
    assert report.verdict == "PASS"
    (said,) = [text for text in report.caveats if text.startswith(HELD)]
    assert said.startswith(f"{HELD} {SIMPLE} {told}. A candidate would be refused for it")


def test_of_several_the_furthest_beyond_its_limit_is_told_once(ladder):
    for condition, value in (("nominal", 80), ("envelope", 100)):
        change = cells("hold_ticks", value, where=lambda f, c=condition: of(f, c))
        evidence.edit_table(ladder, ROLLOUTS, change)
    evidence.edit_table(ladder, ROLLOUTS, cells("deadline_misses", 2, where=of))
    (said,) = [text for text in judge(ladder, "D").caveats if text.startswith(HELD)]
    assert "stands in 62.5 % of its ticks in envelope" in said
    assert "nominal" not in said and "late" not in said


def test_at_the_limit_nothing_is_told(ladder):
    evidence.edit_table(ladder, ROLLOUTS, cells("hold_ticks", 40, where=of))
    assert not any(text.startswith(HELD) for text in judge(ladder, "D").caveats)
