"""Candidates that were stopped: believed by their rows alone, failed, and never promoted."""

import json

import evidence
import numpy as np
import pytest
from asked import asked, found_in, settings_of

from gates.evidence import Evidence, MissingEvidenceError
from gates.overrides import OVERRIDES
from gates.proof import judge
from gates.stress.gate import promotion_e_value
from gates.stress.rollouts import ROLLOUTS, STRESS, rollouts
from gates.stress.stopped import ROLLOUTS as ASKED
from gates.stress.stopped import StoppedError, ran
from gates.stress.trial import unmatched_starts
from gates.writing import write_gate
from genpolicy.evidence.documents.stress import BLOCKS, Blocks
from genpolicy.statistics.possible import first_out

BLOCK = 20
FLOW, OTHER = "flow", "diffusion"
TABLES = ("rollouts", "invocations", "recoveries", "splices")
METHODS = (*evidence.COMPARED, *evidence.CANDIDATES)
OUT = {FLOW: "promotion_e_value"}


def fails(root, method, share=2):
    """A method that ends in a timeout on all starts but every `share`th."""

    def change(frame):
        of = (frame["method"] == method).to_numpy()
        won = frame["start"].to_numpy() % share == share - 1
        success = np.where(of, won, frame["success"]).astype(bool)
        outcome = np.where(of, np.where(won, "success", "timeout"), frame["outcome"])
        recovered = success & frame["recovery_attempted"].to_numpy()
        return frame.assign(success=success, outcome=outcome, recovered=recovered)

    evidence.edit_table(root, "stress/rollouts.parquet", change)


def cut(root, starts):
    """So many starts of each method that is named there, in every table that knows starts."""
    for name in TABLES:
        path = root / "artifacts" / "stress" / f"{name}.parquet"
        if path.is_file():
            evidence.edit_table(
                root, f"stress/{name}.parquet",
                lambda f: f[f["start"] < f["method"].map(starts).fillna(np.inf)],
            )  # fmt: skip


def say(root, last, out, **other):
    said = {"block": BLOCK, "starts": evidence.STARTS, "last": last, "out": out} | other
    BLOCKS.write(root / STRESS, Blocks(**said))
    evidence.record(root)


def planned(root, block=BLOCK):
    evidence.write_params(root, lambda params: params["stress"].update(block=block))


@pytest.fixture
def blocks(ladder):
    """In blocks of 20 of 80 starts, nobody stopped."""
    planned(ladder)
    say(ladder, dict.fromkeys(METHODS, 4), {})
    return ladder


@pytest.fixture
def stopped(blocks):
    """`flow` wins nothing and is out after 40 starts."""
    fails(blocks, FLOW, share=1000)
    cut(blocks, {FLOW: first(blocks)})
    say(blocks, dict.fromkeys(METHODS, 4) | {FLOW: first(blocks) // BLOCK}, OUT)
    return blocks


def first(root):
    """The block end at which `flow` is out, by the rule that the stage asks."""
    found = ran(Evidence(root), settings_of(root, "D"))
    out = first_out(found.rule, found.seen, FLOW)
    return found.seen[FLOW].starts if out is None else out[0]


def test_the_table_that_is_asked_is_the_one_that_is_judged():
    assert ASKED == ROLLOUTS


def test_where_nobody_was_stopped_blocks_change_no_answer(ladder):
    whole = judge(ladder, "D")
    planned(ladder)
    say(ladder, dict.fromkeys(METHODS, 4), {})
    report = judge(ladder, "D")
    assert report.criteria == tuple(
        answer.model_copy(update={"evidence": (*answer.evidence, f"{STRESS}/{BLOCKS.file}")})
        if answer.id == "unmatched_starts" else answer
        for answer in whole.criteria
    )  # fmt: skip
    assert (report.verdict, report.promoted) == (whole.verdict, whole.promoted) != ("FAIL", None)
    assert report.settings == {**whole.settings, "block": BLOCK} and "block" not in whole.settings
    planned(ladder, block=evidence.STARTS)
    assert judge(ladder, "D").criteria == whole.criteria  # one block of all starts is none


def test_who_was_stopped_fails_with_the_reason_and_the_other_is_judged_by_its_own(stopped):
    starts = first(stopped)
    assert BLOCK <= starts < evidence.STARTS
    report = judge(stopped, "D")
    assert (report.candidates, report.promoted) == ({FLOW: "FAIL", OTHER: "PASS"}, OTHER)
    gain = {answer.candidate: answer for answer in found_in(report, "promotion_e_value")}
    assert gain[FLOW].verdict == "FAIL" and gain[FLOW].measured < gain[FLOW].threshold
    said = f"flow was stopped: {starts} of 80 starts were run, since it could no longer pass (won"
    assert gain[FLOW].caveat.startswith(said) and gain[FLOW].counted == f"{starts} of 80 starts"
    assert gain[OTHER].counted == "80 starts" and gain[OTHER].verdict == "PASS"
    assert any(text.startswith(said) for text in report.caveats)
    (unmatched,) = [a for a in found_in(report, "unmatched_starts") if a.candidate == FLOW]
    assert unmatched.verdict == "INCONCLUSIVE" and said in unmatched.caveat
    page = write_gate(stopped, "D")
    assert page.verdict == report.verdict
    assert f"{starts} of 80 starts were run" in (stopped / "reports/gate_d.md").read_text()


def test_who_would_have_failed_at_the_end_fails_alike_when_stopped(blocks):
    fails(blocks, FLOW, share=1000)
    whole = asked(blocks, promotion_e_value, FLOW, gate="D")
    cut(blocks, {FLOW: first(blocks)})
    found = asked(blocks, promotion_e_value, FLOW, gate="D")
    needed = 1.0 / settings_of(blocks, "D").alpha
    assert whole.value <= found.value < needed


@pytest.mark.parametrize("early", [False, True])
def test_all_end_where_nobody_is_left(blocks, early):
    for name in evidence.CANDIDATES:
        fails(blocks, name, share=1000)
    ends = first(blocks)
    cut(blocks, dict.fromkeys(METHODS, ends) | ({"act": ends - BLOCK} if early else {}))
    last = dict.fromkeys(METHODS, ends // BLOCK)
    say(blocks, last, dict.fromkeys(evidence.CANDIDATES, "promotion_e_value"))
    if early:
        with pytest.raises(MissingEvidenceError, match="rollouts of act is 20 starts where"):
            asked(blocks, unmatched_starts, FLOW, gate="D")
        return
    report = judge(blocks, "D")
    assert (report.verdict, report.promoted) == ("FAIL", None)
    assert report.decision == "return to chunked_bc" or report.decision.startswith("return to ")
    assert "simpler policy" not in report.decision
    said = f"No candidate was left after {ends} of 80 starts"
    assert any(text.startswith(said) for text in report.caveats)
    write_gate(blocks, "D")


def test_a_stop_one_block_too_early_is_missing_evidence(stopped):
    early = first(stopped) - BLOCK
    cut(stopped, {FLOW: early})
    said = f"flow has {early} of 80 starts, and after {early} it could still have passed"
    with pytest.raises(MissingEvidenceError, match=said):
        asked(stopped, promotion_e_value, FLOW, gate="D")
    report = judge(stopped, "D")
    assert report.candidates == {FLOW: "INCONCLUSIVE", OTHER: "INCONCLUSIVE"}
    assert report.promoted is None


def test_rows_of_who_was_not_out_are_missing_and_not_failed(blocks):
    cut(blocks, {FLOW: 40})
    say(blocks, dict.fromkeys(METHODS, 4) | {FLOW: 2}, OUT)  # the stage may say what it likes
    with pytest.raises(MissingEvidenceError, match="after 40 it could still have passed"):
        rollouts(Evidence(blocks), settings_of(blocks, "D"), FLOW)
    assert judge(blocks, "D").candidates[FLOW] == "INCONCLUSIVE"


def test_starts_that_end_with_no_block_are_missing(stopped):
    cut(stopped, {FLOW: first(stopped) - 3})
    with pytest.raises(MissingEvidenceError, match="no block of 20 ends there"):
        asked(stopped, promotion_e_value, FLOW, gate="D")


def test_a_start_that_lacks_in_one_condition_is_missing(stopped):
    def less(frame):
        gone = (frame["perturbation"] == "camera_delay") & (frame["start"] == 3)
        return frame[~(gone & (frame["method"] == FLOW))]

    evidence.edit_table(stopped, "stress/rollouts.parquet", less)
    with pytest.raises(MissingEvidenceError, match=r"rollouts of flow is .* in camera_delay"):
        asked(stopped, promotion_e_value, FLOW, gate="D")


@pytest.mark.parametrize(
    ("change", "said"),
    [({"out": {}}, "out is {}, by the rows {'flow': 'promotion_e_value'}"),
     ({"out": {FLOW: "reset_upper"}}, "out is {'flow': 'reset_upper'}"),
     ({"last": dict.fromkeys(METHODS, 4)}, "last is"),
     ({"block": 40}, "block is 40, by the rows 20"),
     ({"starts": 79}, "starts is 79, by the rows 80")],
)  # fmt: skip
def test_a_document_that_says_otherwise_is_named(stopped, change, said):
    path = stopped / STRESS / BLOCKS.file
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    evidence.record(stopped)
    report = judge(stopped, "D")
    for answer in found_in(report, "unmatched_starts"):
        assert answer.verdict == "INCONCLUSIVE" and f"{BLOCKS.file}: {said}" in answer.caveat
    assert report.promoted is None and report.candidates[FLOW] == "FAIL"


def test_a_document_of_a_stop_that_never_was_is_named(blocks):
    say(blocks, dict.fromkeys(METHODS, 4) | {FLOW: 2}, OUT)
    report = judge(blocks, "D")
    assert report.candidates == dict.fromkeys(evidence.CANDIDATES, "INCONCLUSIVE")
    assert "blocks.json: last is" in found_in(report, "unmatched_starts")[0].caveat
    (blocks / STRESS / BLOCKS.file).unlink()
    with pytest.raises(MissingEvidenceError, match=r"blocks\.json is missing"):
        asked(blocks, unmatched_starts, OTHER, gate="D")


def test_who_ran_on_after_it_was_out_is_named_and_fails_all_the_same(blocks):
    fails(blocks, FLOW, share=1000)
    with pytest.raises(MissingEvidenceError, match=r"flow ran 80 starts, where by its rows \d+ of"):
        asked(blocks, unmatched_starts, FLOW, gate="D")
    assert judge(blocks, "D").candidates[FLOW] == "FAIL"


def test_without_blocks_in_the_plan_fewer_starts_are_missing(stopped):
    """The stop is one of the plan: nobody brings it with the evidence."""
    evidence.write_params(stopped)
    with pytest.raises(MissingEvidenceError, match="planned 80") as caught:
        rollouts(Evidence(stopped), settings_of(stopped, "D"), FLOW)
    assert not isinstance(caught.value, StoppedError)
    assert judge(stopped, "D").candidates[FLOW] == "INCONCLUSIVE"


def counted(root, criterion, **columns):
    """`flow` wins all and breaks a bound of a count in its first twenty starts of one condition."""

    def change(frame):
        hit = (frame["method"] == FLOW) & (frame["start"] < BLOCK)
        hit &= frame["perturbation"] == ("nominal" if "nominal" in criterion else "camera_delay")
        for name, value in columns.items():
            frame[name] = frame[name].mask(hit, value)
        return frame

    evidence.edit_table(root, "stress/rollouts.parquet", change)
    cut(root, {FLOW: BLOCK})
    say(root, dict.fromkeys(METHODS, 4) | {FLOW: 1}, {FLOW: criterion})


@pytest.mark.parametrize(
    ("criterion", "columns"),
    [("reset_upper", {"outcome": "collision", "success": False}),
     ("intervention_upper", {"interventions": 1})],
)  # fmt: skip
def test_a_bound_of_a_count_that_cannot_be_kept_any_more_fails(blocks, criterion, columns):
    counted(blocks, criterion, **columns)
    report = judge(blocks, "D")
    (own,) = [answer for answer in found_in(report, criterion) if answer.candidate == FLOW]
    assert own.verdict == "FAIL" and own.measured > own.threshold
    assert "20 of 20 in camera_delay count for" in own.caveat
    assert report.candidates == {FLOW: "FAIL", OTHER: "PASS"}
    (gain,) = [a for a in found_in(report, "promotion_e_value") if a.candidate == FLOW]
    assert gain.verdict == "INCONCLUSIVE" and "flow was stopped: 20 of 80" in gain.caveat


def test_an_exception_lets_nobody_pass_who_was_stopped(blocks):
    """The loosest limit that an exception may name is the one by which it was stopped."""
    evidence.write_params(
        blocks,
        lambda params: (
            params["stress"].update(block=BLOCK),
            evidence.set_limit("gate_d", "reset_upper", 0.05)(params),
        ),
    )
    counted(blocks, "reset_upper", outcome="collision", success=False)
    (blocks / OVERRIDES).write_text(
        "overrides:\n- {gate: D, criterion: reset_upper, candidate: flow, limit: 0.1, by: ada, "
        "reason: a test, expires: '2026-12-31'}\n"
    )
    evidence.record(blocks)
    report = judge(blocks, "D")
    assert report.overrides and report.candidates == {FLOW: "FAIL", OTHER: "PASS"}


def test_costs_that_are_weighed_want_one_block(ladder):
    def weigh(params):
        params["stress"]["block"] = BLOCK
        params["gate_d"]["utility"] = {"model": {"duration": [0.2, "slow is worth less"]}}

    evidence.write_params(ladder, weigh)
    with pytest.raises(Exception, match=r"stress\.block wants all starts in one block"):
        settings_of(ladder, "D")
