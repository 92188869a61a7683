"""Accounting of latency: the chapter's budget, and an invocation that is less than its sum."""

import math

import numpy as np
import pandas as pd
import pytest

from gates.evidence import MissingEvidenceError
from gates.reproducibility.latency_budget import (
    MEASURED_HERE,
    TERMS,
    budget_of,
    invocations,
    spans_of_processes,
)
from genpolicy.contract.latency import MEASURED_TERMS, OWNERS, Term

CHAPTER_MS = {
    "capture": (18, 31), "decode": (7, 12), "encode": (9, 15), "project": (3, 7), "queue": (8, 19),
}  # fmt: skip
"""Chapter 6, section 4.1: p50 and p95 of the stages that both generators share."""
NOTHING = 1e-9


def rows(times, *, temperature="warm", processes=1, repeats=60):
    """`latency.parquet` of one method: `times` by term, s, one value an invocation."""
    found = []
    for term in TERMS:
        measured = term in MEASURED_HERE
        for index, seconds in enumerate(np.resize(times.get(term, [NOTHING]), repeats)):
            for run in (1, 2) if measured else (1,):
                for process in range(1, 1 + processes if measured else 2):
                    found.append(
                        {
                            "method": "a", "run": run, "process": process, "component": term,
                            "owner": str(OWNERS[Term(term)]),
                            "temperature": temperature if measured else "warm", "repeat": index,
                            "seconds": seconds, "source": "measured" if measured else "declared",
                        }
                    )  # fmt: skip
    return pd.DataFrame(found)


def slow_once_in_ten(p50, p95, shift):
    """Ten values with this median and p95; which of them is the slow one is `shift`."""
    values = np.full(10, p50 * 1e-3)
    values[shift % 10] = p95 * 1e-3
    return values


@pytest.mark.parametrize(("p50", "p95", "total"), [(38, 55, 139), (14, 23, 107)])
def test_the_budget_of_the_chapter(p50, p95, total):
    shown = {**CHAPTER_MS, "sample": (p50, p95)}
    times = {t: slow_once_in_ten(*pair, i) for i, (t, pair) in enumerate(shown.items())}
    found = budget_of(rows(times), "warm", confidence=0.95)
    assert found.sum_of_p95_s * 1e3 == pytest.approx(total, abs=1e-4)
    assert found.terms["sample"].p50[0] * 1e3 == pytest.approx(p50)
    # No two of these are slow together, so that no invocation takes what the sum says.
    longest = max(high - low for low, high in shown.values()) + sum(
        low for low, _ in shown.values()
    )
    assert found.end_to_end.p95[0] * 1e3 == pytest.approx(longest, abs=1e-4)


def test_terms_that_are_slow_together_add_up_to_the_sum():
    shown = {**CHAPTER_MS, "sample": (38, 55)}
    times = {t: slow_once_in_ten(*pair, 3) for t, pair in shown.items()}
    found = budget_of(rows(times), "warm", confidence=0.95)
    assert found.end_to_end.p95[0] == pytest.approx(found.sum_of_p95_s)
    assert found.end_to_end.longest == pytest.approx(0.139, abs=1e-6)


def test_the_sum_on_paper_may_be_too_short_as_well():
    """Five terms, each slow in one of twenty-five, never together: every fifth answer is slow."""
    names = ("preprocess", "encode", "sample", "select", "project")
    times = {n: np.where(np.arange(50) % 25 == 3 * i, 0.1, 0.001) for i, n in enumerate(names)}
    found = budget_of(rows(times, repeats=50), "warm", confidence=0.95)
    assert found.sum_of_p95_s == pytest.approx(0.005, abs=1e-6)
    assert found.end_to_end.p95[0] == pytest.approx(0.104, abs=1e-6)


def test_terms_owners_and_sources_are_the_contracts():
    found = budget_of(rows({}), "warm", confidence=0.95)
    assert tuple(map(str, Term)) == TERMS and tuple(map(str, MEASURED_TERMS)) == MEASURED_HERE
    assert found.owners == {str(term): str(owner) for term, owner in OWNERS.items()}
    assert {t for t, s in found.sources.items() if s == "measured"} == set(MEASURED_HERE)


def test_a_p95_of_few_has_no_upper_end():
    few = budget_of(rows({}).query("repeat < 10"), "warm", confidence=0.95)
    assert math.isinf(few.end_to_end.p95[2]) and few.end_to_end.n == 20
    assert math.isfinite(few.end_to_end.p50[2])


def test_medians_are_of_whole_invocations_in_each_process():
    frame = rows({"sample": [0.01], "encode": [0.002]}, processes=3)
    slow = (frame["run"] == 2) & (frame["process"] == 3) & (frame["component"] == "sample")
    frame.loc[slow, "seconds"] = 0.05
    found = spans_of_processes(frame, "warm")
    assert found[1] == pytest.approx([0.012] * 3, abs=1e-6)
    assert found[2] == pytest.approx([0.012, 0.012, 0.052], abs=1e-6)


@pytest.mark.parametrize(
    ("change", "match"),
    [(lambda f: f[f["component"] != "encode"], "lacks a measured component"),
     (lambda f: f[(f["component"] != "encode") | (f["repeat"] != 3)], "lacks a measured component"),
     (lambda f: f.assign(seconds=0.0), "took no time"),
     (lambda f: f.assign(seconds=math.nan), "non-finite"),
     (lambda f: f.assign(process=1), "measured twice"),
     (lambda f: f.assign(temperature="cold"), "no warm invocation")],
)  # fmt: skip
def test_an_invocation_that_is_not_whole_is_none(change, match):
    with pytest.raises(MissingEvidenceError, match=match):
        invocations(change(rows({}, processes=2)), "warm")


def test_an_unknown_term_is_not_zero():
    frame = rows({})
    with pytest.raises(MissingEvidenceError, match="queue is neither measured nor declared"):
        budget_of(frame[frame["component"] != "queue"], "warm", confidence=0.95)
