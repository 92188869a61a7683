"""A row of which one column denies another is judged by neither, whoever's it is."""

import evidence
import pyarrow as pa
import pytest
from asked import found_in, settings_of

from gates.evidence import Evidence, MissingEvidenceError
from gates.proof import judge
from gates.stress.itself import SUCCESS
from gates.stress.rollouts import rollouts
from genpolicy.evidence.stress.state import Outcome
from genpolicy.integrity.tables import read_table, write_table

TABLE = "stress/rollouts.parquet"
WHERE = "rollout flow, camera_delay, start 3"


def of(root, method="flow"):
    return rollouts(Evidence(root), settings_of(root, "D"), method)


def edited(root, method="flow", **columns):
    """One rollout with other values, and nothing else set right by them."""
    file = root / "artifacts" / TABLE
    frame = read_table(file).to_pandas()
    hit = (frame["method"] == method) & (frame["start"] == 3)
    hit &= frame["perturbation"] == "camera_delay"
    assert hit.sum() == 1
    frame = frame.assign(**{name: frame[name].mask(hit, of) for name, of in columns.items()})
    write_table(file, pa.Table.from_pandas(frame, preserve_index=False))
    evidence.record(root)


def test_the_gate_knows_how_a_success_is_called():
    assert str(Outcome.SUCCESS) == SUCCESS


def test_rows_as_the_comparison_writes_them_are_read(ladder):
    edited(ladder, ticks=1, action_ticks=1, hold_ticks=0, fallback_ticks=0, invocations=1)
    assert len(of(ladder)) == evidence.STARTS * len(evidence.CONDITIONS)
    edited(ladder, invocations=0, rejections=0, action_ticks=0, hold_ticks=1)
    edited(ladder, "bc", invocations=1, rejections=1, deadline_misses=1)
    assert len(of(ladder)) == len(of(ladder, "bc"))


@pytest.mark.parametrize(
    ("success", "outcome"), [(True, "collision"), (True, ""), (False, "success")]
)
def test_a_rollout_counts_as_it_ended(ladder, success, outcome):
    """Rollouts marked as successes, whose end was left as it was, passed until their journals
    were read again."""
    assert len(of(ladder))
    edited(ladder, success=success, outcome=outcome)
    told = rf"{WHERE}: success is {success}, and it ended in {outcome}"
    with pytest.raises(MissingEvidenceError, match=told):
        of(ladder)
    assert len(of(ladder, "diffusion"))


DENIED = [
    ({"action_ticks": 0, "hold_ticks": 0, "fallback_ticks": 0},
     r"action_ticks 0 \+ hold_ticks 0 \+ fallback_ticks 0 do not add up to ticks 160"),
    ({"hold_ticks": 7}, r"action_ticks 150 \+ hold_ticks 7 \+ fallback_ticks 2 do not add up"),
    ({"action_ticks": 151}, r"action_ticks 151 .* do not add up to ticks 160"),
    ({"fallback_ticks": 1}, r"fallback_ticks 1 do not add up to ticks 160"),
    ({"ticks": 161}, r"do not add up to ticks 161"),
    ({"ticks": 0}, r"action_ticks is no part of ticks \(150 of 0\)"),
    ({"ticks": 0, "action_ticks": 0, "hold_ticks": 0, "fallback_ticks": 0},
     r"action_ticks is no part of ticks \(0 of 0\)"),
    ({"hold_ticks": -1, "action_ticks": 159}, r"hold_ticks is no part of ticks \(-1 of 160\)"),
    ({"fallback_ticks": 161}, r"fallback_ticks is no part of ticks \(161 of 160\)"),
    ({"deadline_misses": 21}, r"deadline_misses is no part of invocations \(21 of 20\)"),
    ({"rejections": -1}, r"rejections is no part of invocations \(-1 of 20\)"),
    ({"invocations": 0, "rejections": 0}, "action_ticks 150 were commanded by no invocation"),
]  # fmt: skip


@pytest.mark.parametrize(("columns", "told"), DENIED)
def test_a_rollout_whose_counts_deny_each_other_is_named(ladder, columns, told):
    edited(ladder, **columns)
    with pytest.raises(MissingEvidenceError, match=f"{WHERE}: .*{told}"):
        of(ladder)
    assert len(of(ladder, "diffusion"))


@pytest.mark.parametrize("column", ["ticks", "hold_ticks", "invocations", "rejections"])
def test_a_count_that_is_missing_is_missing_evidence(ladder, column):
    edited(ladder, **{column: None})
    with pytest.raises(MissingEvidenceError, match=f"empty cells in column {column}|{column} has"):
        of(ladder)


def test_nothing_of_a_candidate_is_measured_by_a_row_whose_parts_are_all_none(ladder):
    """It neither commanded, nor held, nor fell back, and passed: no share of its ticks was high."""
    edited(ladder, action_ticks=0, hold_ticks=0, fallback_ticks=0)
    report = judge(ladder, "D")
    assert report.candidates == {"diffusion": "PASS", "flow": "INCONCLUSIVE"}
    told = {c.id: c for c in report.criteria if c.candidate == "flow"}
    for name in ("hold_share_upper", "fallback_share_upper", "promotion_e_value"):
        assert told[name].verdict == "INCONCLUSIVE" and "do not add up" in told[name].caveat


def test_nobody_gains_over_a_simple_method_by_a_row_that_does_not_add_up(ladder):
    edited(ladder, "bc", action_ticks=0, hold_ticks=0, fallback_ticks=0)
    report = judge(ladder, "D")
    assert report.promoted is None and report.verdict == "INCONCLUSIVE"
    for gain in found_in(report, "promotion_e_value"):
        assert "rollout bc, camera_delay, start 3" in gain.caveat
