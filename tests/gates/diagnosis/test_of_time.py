"""Looks at time: alone nobody is the sooner one, and declared terms are no measured ones."""

from dataclasses import replace

import evidence
import pytest
from causes_planted import FLOW, of_flow

from gates.diagnosis.looking import Look
from gates.diagnosis.of_time import chunks_joining, rejections_and_p95, whole_accounting


@pytest.fixture
def alone(honest):
    """Reports in which flow is the only candidate."""
    judged = {
        gate: report.model_copy(
            update={
                "candidates": {n: v for n, v in report.candidates.items() if n == FLOW},
                "criteria": tuple(c for c in report.criteria if c.candidate in (None, FLOW)),
            }
        )
        for gate, report in honest.judged.items()
    }
    return replace(honest, judged=judged)


@pytest.mark.parametrize("query", [whole_accounting, rejections_and_p95])
def test_with_one_candidate_it_is_unknown_who_is_through_sooner(honest, alone, query):
    said = "whether anybody is through sooner: flow alone was timed"
    look = Look(alone, FLOW)
    query(look)
    assert said in look.unknown
    both = Look(honest, FLOW)
    query(both)
    assert said not in both.unknown


def test_declared_terms_are_said_where_the_account_is_asked(honest):
    look = Look(honest, FLOW)
    whole_accounting(look)
    assert any("are declared and not measured" in text for text in look.unknown)


def test_that_no_other_horizon_was_tried_is_said(honest):
    look = Look(honest, FLOW)
    chunks_joining(look)
    assert any("varied in no rollout" in text for text in look.unknown)


@pytest.mark.parametrize(("seconds", "later"), [(0.05, True), (0.0, False)])
def test_who_is_through_later_is_said_of_who_is_and_of_nobody_else(planted, seconds, later):
    """Flow samples soonest; with 50 ms more of projection the other is through sooner."""

    def change(frame):
        frame.loc[of_flow(frame) & (frame["component"] == "project"), "seconds"] += seconds
        return frame

    look = Look(planted(lambda root: evidence.edit_table(
        root, "latency/latency.parquet", change), ""), FLOW)  # fmt: skip
    whole_accounting(look)
    assert any("is through sooner" in cause for cause in look.causes) == later
