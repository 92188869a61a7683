"""Windows of abort thresholds: as long as a trial, not ended by one, tried on own rollouts."""

import json
import math

import evidence
import pytest

from gates.card.card import ABORT_FROM, thresholds_of
from gates.card.windows import AbortWindow, windows_of
from gates.evidence import Evidence
from gates.proof import judge
from gates.report import read_report
from gates.stress.rollouts import INVOCATIONS, ROLLOUTS
from genpolicy.errors import IntegrityError
from genpolicy.evidence.rows.stress import InvocationRow, RolloutRow
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.rows import read_rows, write_rows

CONDITION = "envelope"


@pytest.fixture
def rolled(repo):
    """Writes rollouts of `flow` inside the envelope with the given columns; gives the windows."""
    template = next(
        row for row in read_rows(repo / ROLLOUTS, RolloutRow)
        if (row.method, row.perturbation) == ("flow", CONDITION)
    )  # fmt: skip

    def windows(thresholds, *changes, late=None):
        rows = [
            RolloutRow(**{**vars(template), "start": start, **change})
            for start, change in enumerate(changes)
        ]
        write_rows(repo / ROLLOUTS, RolloutRow, rows)
        times = [
            InvocationRow("flow", template.seed, CONDITION, start, number, latency)
            for start, latencies in enumerate(late or [[0.1]] * len(rows))
            for number, latency in enumerate(latencies)
        ]
        write_rows(repo / INVOCATIONS, InvocationRow, times)
        return windows_of(Evidence(repo), "flow", CONDITION, thresholds)

    return windows


def test_each_threshold_of_a_report_has_a_window(ladder):
    thresholds = thresholds_of(read_report(ladder, "D")[0])
    assert set(thresholds) == set(ABORT_FROM)
    found = windows_of(Evidence(ladder), "flow", CONDITION, thresholds)
    assert set(found) == set(thresholds)
    assert {name: window.unit for name, window in found.items()} == {
        "latency_s": "answers", "deadline_miss_share": "answers", "rejection_share": "answers",
        "hold_share": "ticks", "fallback_share": "ticks",
        "intervention_share": "trials", "reset_share": "trials",
    }  # fmt: skip


def test_a_share_is_counted_over_a_usual_trial(rolled):
    sizes = [{"ticks": ticks, "hold_ticks": 0} for ticks in (50, 70, 400)]
    assert rolled({"hold_share": 0.5}, *sizes)["hold_share"].count == 70


@pytest.mark.parametrize("limit", [0.01, 0.15, 0.3, 1.0])
def test_one_miss_alone_never_ends_a_trial(rolled, limit):
    few = {"invocations": 2, "deadline_misses": 0}
    window = rolled({"deadline_miss_share": limit}, few, few)["deadline_miss_share"]
    assert 1 / window.count <= limit and window.count <= max(2, math.ceil(1 / limit))


def test_a_threshold_of_zero_ends_at_the_first(rolled):
    found = rolled({"reset_share": 0.0}, {"outcome": "success"}, {"outcome": "collision"})
    assert found["reset_share"] == AbortWindow(unit="trials", count=1, above=1, seen=2)


def test_own_rollouts_above_it_are_counted_whole(rolled):
    found = rolled(
        {"deadline_miss_share": 0.25},
        {"invocations": 8, "deadline_misses": 2},
        {"invocations": 8, "deadline_misses": 3},
        {"invocations": 8, "deadline_misses": 0},
    )["deadline_miss_share"]
    assert (found.above, found.seen, found.count) == (1, 3, 8)


def test_one_answer_of_twenty_may_be_late_and_the_cold_one_is_left_out(rolled):
    slow, quick = 0.3, 0.1
    late = [
        [slow, *[quick] * 19, slow],  # one of 20 warm ones
        [quick, *[quick] * 18, slow, slow],  # two
        [slow],  # none
    ]
    found = rolled({"latency_s": 0.2}, *[{"invocations": len(one)} for one in late], late=late)
    assert (found["latency_s"].above, found["latency_s"].seen) == (1, 3)
    assert found["latency_s"].count == 21


def test_every_run_of_trials_counts(rolled):
    """Hits at 5 and 6: no block of five has both, four runs of five do."""
    helped = [{"interventions": int(start in (4, 5))} for start in range(10)]
    window = rolled({"intervention_share": 0.2}, *helped)["intervention_share"]
    assert (window.count, window.seen, window.above) == (5, 6, 4)


def test_fewer_rollouts_than_a_window_holds_try_nothing(rolled):
    window = rolled({"intervention_share": 0.25}, {"interventions": 0})["intervention_share"]
    assert (window.seen, window.above) == (0, 0) and "not tried" in window.tried


def test_a_window_is_read_as_a_sentence():
    window = AbortWindow(unit="answers", count=20, above=1, seen=30)
    assert window.over == "over the last 20 answers"
    assert window.model_copy(update={"count": 1}).over == "over the last answer"
    assert window.tried == "above what is proposed in 1 of 30 rollouts inside the envelope"
    trials = window.model_copy(update={"unit": "trials", "count": 5})
    assert "1 of 30 runs of 5 rollouts" in trials.tried
    single = trials.model_copy(update={"count": 1, "above": 0, "seen": 3})
    assert single.tried == "above what is proposed in none of 3 rollouts inside the envelope"


def test_without_rollouts_inside_the_envelope_nothing_is_proposed(ladder):
    with pytest.raises(IntegrityError, match="no rollout under elsewhere"):
        windows_of(Evidence(ladder), "flow", "elsewhere", {"hold_share": 0.5})


@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("abort_windows", {"hold_share": None}),
        ("abort_windows", {"hold_share": {"above": 0, "count": 10**6, "seen": 9, "unit": "ticks"}}),
        ("abort_windows", {"more": {"above": 0, "count": 1, "seen": 9, "unit": "ticks"}}),
        ("abort_thresholds", {"hold_share": 1e9}),
        ("abort_thresholds", {"hold_share": None}),
    ],
)
def test_a_draft_that_ends_a_trial_otherwise_is_not_of_this_chain(ladder, field, change):
    file = ladder / "artifacts/card/card.json"
    document = json.loads(file.read_bytes())
    changed = {**document[field], **change}
    document[field] = {name: value for name, value in changed.items() if value is not None}
    file.write_bytes(canonical_json(document))
    evidence.record(ladder)
    [chain] = [c for c in judge(ladder, "E").criteria if c.id == "upstream_passed"]
    name = next(iter(change))
    assert chain.verdict == "FAIL" and f"the draft's {field}.{name} is" in chain.caveat
