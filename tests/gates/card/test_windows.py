"""Windows of abort thresholds: as long as a trial, not ended by one, tried on own rollouts."""

import math

import pytest

from gates.card.card import ABORT_FROM, thresholds_of
from gates.card.windows import AbortWindow, windows_of
from gates.evidence import Evidence
from gates.report import read_report
from gates.stress.rollouts import ROLLOUTS
from genpolicy.errors import IntegrityError
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.integrity.rows import read_rows, write_rows

CONDITION = "envelope"


@pytest.fixture
def rolled(repo):
    """Writes rollouts of `flow` inside the envelope with the given columns; gives the windows."""
    template = next(
        row for row in read_rows(repo / ROLLOUTS, RolloutRow)
        if (row.method, row.perturbation) == ("flow", CONDITION)
    )  # fmt: skip

    def windows(thresholds, *changes):
        rows = [
            RolloutRow(**{**vars(template), "start": start, **change})
            for start, change in enumerate(changes)
        ]
        write_rows(repo / ROLLOUTS, RolloutRow, rows)
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
    assert found["reset_share"] == AbortWindow(unit="trials", count=1, ended=1, seen=2)


def test_own_rollouts_that_it_would_have_ended_are_counted(rolled):
    found = rolled(
        {"deadline_miss_share": 0.25, "latency_s": 0.2},
        {"invocations": 8, "deadline_misses": 2, "latency_p95_s": 0.2},
        {"invocations": 8, "deadline_misses": 3, "latency_p95_s": 0.21},
        {"invocations": 8, "deadline_misses": 0, "latency_p95_s": None},
    )
    assert (found["deadline_miss_share"].ended, found["deadline_miss_share"].seen) == (1, 3)
    assert (found["latency_s"].ended, found["latency_s"].count) == (1, 20)


def test_trials_are_counted_in_windows_that_share_none(rolled):
    helped = [
        {"interventions": int(start in (0, 1, 5)), "outcome": "success"} for start in range(9)
    ]
    window = rolled({"intervention_share": 0.25}, *helped)["intervention_share"]
    assert (window.count, window.seen, window.ended) == (4, 2, 1)


def test_fewer_rollouts_than_a_window_holds_try_nothing(rolled):
    window = rolled({"intervention_share": 0.25}, {"interventions": 0})["intervention_share"]
    assert window.seen == 0 and "not tried" in window.tried


def test_a_window_is_read_as_a_sentence():
    window = AbortWindow(unit="answers", count=20, ended=1, seen=30)
    assert window.over == "over the last 20 answers"
    assert window.model_copy(update={"count": 1}).over == "over the last answer"
    assert window.tried == "would have ended 1 of 30 of its rollouts"


def test_without_rollouts_inside_the_envelope_nothing_is_proposed(ladder):
    with pytest.raises(IntegrityError, match="no rollout under elsewhere"):
        windows_of(Evidence(ladder), "flow", "elsewhere", {"hold_share": 0.5})
