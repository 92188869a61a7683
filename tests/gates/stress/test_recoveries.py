"""Entries into recovery beside their rollouts; what is covered from the same perturbed starts."""

import evidence
import pytest
from asked import settings_of
from editing import cells

from gates.evidence import Evidence, MissingEvidenceError
from gates.stress.recoveries import RECOVERIES, coverage, recoveries
from genpolicy.statistics.eprocess import gain_interval

ROLLOUTS, TABLE = "stress/rollouts.parquet", RECOVERIES.removeprefix("artifacts/")
DRILL = "recovery_drill"


def entries(root, method="flow"):
    return recoveries(Evidence(root), settings_of(root, "D"), method)


def compared(root, baseline="bc", condition=DRILL):
    return coverage(Evidence(root), settings_of(root, "D"), "flow", baseline, condition)


def of(frame, condition=DRILL):
    return (frame["method"] == "flow") & (frame["perturbation"] == condition)


def test_every_entry_of_the_planned_conditions_comes(ladder):
    rows = entries(ladder)
    assert len(rows) == evidence.STARTS and set(rows["perturbation"]) == {DRILL}
    evidence.write_params(ladder, lambda p: p["stress"]["perturbations"].pop(DRILL))
    assert len(entries(ladder)) == 0


@pytest.mark.parametrize(
    "change",
    [
        lambda f: f[f["start"] != 3],
        lambda f: f.assign(recovered=f["recovered"] ^ (f["start"] == 3)),
        lambda f: evidence.pd.concat(
            [f, f[f["start"] == 3].assign(recovery=1, recovered=False, phase="later")]
        ),
    ],
)
def test_a_rollout_and_its_entries_that_differ_are_no_evidence(ladder, change):
    evidence.edit_table(ladder, TABLE, change)
    with pytest.raises(MissingEvidenceError, match=rf"{DRILL}, start 3: it and its entries"):
        entries(ladder)


@pytest.mark.parametrize(
    "told",
    [
        {"ended": "person"},
        {"ended": "episode_over"},
        {"resampled_only": True},
        {"taken_over": False},
        {"succeeded": False},
    ],
)
def test_what_counts_as_recovered_and_was_not_is_no_evidence(ladder, told):
    def change(frame):
        mine = of(frame) & (frame["start"] == 5)
        return frame.assign(**{k: frame[k].mask(mine, v) for k, v in told.items()})

    evidence.edit_table(ladder, TABLE, change)
    with pytest.raises(MissingEvidenceError, match=rf"{DRILL}, start 5: entry 0 .* and was not"):
        entries(ladder)
    assert len(entries(ladder, "bc")) == evidence.STARTS, "of another method nothing is wrong"
    evidence.edit_table(ladder, ROLLOUTS, cells("recovered", False, where=of))
    evidence.edit_table(ladder, TABLE, change)
    assert len(entries(ladder)) == evidence.STARTS, "what does not count may end as it likes"


@pytest.mark.parametrize(("phase", "believed"), [("align", True), ("approach", False)])
def test_a_phase_that_had_to_be_recovered_again_was_not_recovered_before(ladder, phase, believed):
    """Whatever order the rows come in; start 3 began in the approach."""

    def twice(frame):
        first = frame[frame["start"] == 3].assign(phase="approach")
        later = first.assign(recovery=1, phase=phase)
        return evidence.pd.concat([later, frame[frame["start"] != 3], first], ignore_index=True)

    evidence.edit_table(ladder, TABLE, twice)
    if believed:
        assert len(entries(ladder)) == evidence.STARTS + 1
        return
    with pytest.raises(MissingEvidenceError, match=rf"{DRILL}, start 3: entry 0 into recovery"):
        entries(ladder)


def test_entries_of_a_rollout_that_attempted_none_are_no_evidence(ladder):
    evidence.edit_table(ladder, ROLLOUTS, cells("recovery_attempted", False, where=of))
    assert len(entries(ladder)) == 0
    rows = evidence.recoveries_of(
        evidence.read_table(ladder / "artifacts" / ROLLOUTS).to_pandas().assign(
            recovery_attempted=True
        )
    )  # fmt: skip
    evidence.table(ladder, TABLE, evidence.RecoveryRow, rows)
    with pytest.raises(MissingEvidenceError, match="say otherwise whether it recovered"):
        entries(ladder)


def test_what_is_covered_is_paired_by_start(ladder):
    """Flow recovers on all starts but every fourth, the other on every second."""

    def recovers(frame):
        drill = frame["perturbation"] == DRILL
        other = drill & (frame["method"] == "bc")
        covered = frame["success"].mask(of(frame), frame["start"] % 4 != 0)
        covered = covered.mask(other, frame["start"] % 2 == 0)
        return frame.assign(
            success=covered, recovered=frame["recovered"].mask(of(frame) | other, covered)
        )

    evidence.edit_table(ladder, ROLLOUTS, recovers)
    found, n = compared(ladder), evidence.STARTS
    assert (found.starts, found.own, found.other, found.gain) == (n, 0.75, 0.5, 0.25)
    pairs = [float(start % 4 != 0) - float(start % 2 == 0) for start in range(n)]
    assert found.interval == gain_interval(evidence.pd.Series(pairs).to_numpy(), alpha=0.05)
    assert (found.both, found.gain_of_both) == (n, 0.25)


def test_who_needs_no_recovery_covers_and_samples_alone_do_not(ladder):
    before = compared(ladder)
    evidence.edit_table(ladder, ROLLOUTS, cells("recovered", False, where=of))
    found = compared(ladder)
    assert (found.own, found.other) == (0.0, before.other)
    evidence.edit_table(ladder, ROLLOUTS, cells("recovery_attempted", False, where=of))
    found = compared(ladder)
    assert (found.own, found.gain) == (before.own, before.gain)
    assert (found.both, found.gain_of_both) == (0, None)


def test_a_condition_that_was_not_met_is_covered_by_nobody(ladder):
    with pytest.raises(MissingEvidenceError, match="no start is shared with bc in push"):
        compared(ladder, condition="push")
