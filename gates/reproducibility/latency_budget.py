"""Accounting of latency: what each term takes, and what an invocation takes from end to end.

The p95 of the terms, summed, is what an engineer adds up on paper (chapter 4.1). What invocations
take may be less, where slow terms do not coincide, or more: five terms that are slow in one of
twenty-five each, never together, add up to nothing slow, and slow every fifth answer. Both are
shown.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from gates.evidence import Array, MissingEvidenceError, numbers
from genpolicy.statistics.intervals import order_statistic_interval

LATENCY = "artifacts/latency/latency.parquet"
TERMS = (
    "exposure",
    "capture",
    "decode",
    "transfer",
    "preprocess",
    "encode",
    "sample",
    "select",
    "project",
    "network",
    "queue",
)
MEASURED_HERE = ("preprocess", "encode", "sample", "select", "project")
INVOCATION = ["run", "process", "repeat"]
COLD, WARM = "cold", "warm"
MEDIAN, P95 = 0.5, 0.95
MILLI = 1e3


@dataclass(frozen=True)
class Spans:
    """Durations of one term, or of whole invocations, s.

    Attributes:
        n: Invocations.
        p50: Median, and its interval between order statistics.
        p95: 95 % quantile; its upper end is infinite where too few were measured.
        longest: Maximum.
    """

    n: int
    p50: tuple[float, float, float]
    p95: tuple[float, float, float]
    longest: float


@dataclass(frozen=True)
class Budget:
    """The latency of one method at one temperature.

    Attributes:
        terms: By name, those that are known.
        owners: Who answers for each.
        sources: `measured` or `declared`.
        end_to_end: Whole invocations: the measured terms of one, with declared terms as drawn.
        sum_of_p95_s: The p95 of the terms, summed, s.
    """

    terms: Mapping[str, Spans]
    owners: Mapping[str, str]
    sources: Mapping[str, str]
    end_to_end: Spans
    sum_of_p95_s: float


def budget_of(rows: pd.DataFrame, temperature: str, *, confidence: float) -> Budget:
    """The budget of one method.

    Declared terms have one distribution, whatever the temperature: they are no part of what was
    warmed up. They were drawn apart from the measured ones, so that any pairing is as good as
    another: the draws are taken in turn.

    Args:
        rows: `latency.parquet` of the method.
        temperature: `cold` or `warm`.
        confidence: Coverage of the intervals.

    Raises:
        MissingEvidenceError: A term is missing, or an invocation lacks one.
    """
    measured = invocations(rows, temperature)
    declared = rows[rows["source"] == "declared"]
    times: dict[str, Array] = {name: measured[name].to_numpy() for name in MEASURED_HERE}
    total = measured.sum(axis=1).to_numpy()
    for name in TERMS:
        if name in times:
            continue
        drawn = numbers(declared[declared["component"] == name], "seconds")
        if len(drawn) == 0:
            raise MissingEvidenceError(f"the term {name} is neither measured nor declared")
        times[name] = drawn
        total = total + np.resize(drawn, len(total))
    terms = {name: _spans(times[name], confidence) for name in TERMS}
    first = rows.drop_duplicates("component").set_index("component")
    return Budget(
        terms,
        {name: str(first.loc[name, "owner"]) for name in TERMS},
        {name: "measured" if name in MEASURED_HERE else "declared" for name in TERMS},
        _spans(total, confidence),
        sum_of_p95(terms),
    )


def sum_of_p95(terms: Mapping[str, Spans]) -> float:
    """The p95 path of the chapter: each term as slow as in its slowest twentieth, s."""
    return sum(spans.p95[0] for spans in terms.values())


def spans_of_processes(rows: pd.DataFrame, temperature: str) -> dict[int, Array]:
    """What an invocation takes in each process, measured terms summed, by run, s.

    Warm it is the median of a process; cold it is the first call, which alone pays for what a
    process does once.

    Raises:
        MissingEvidenceError: As `invocations`, or processes of unequal length.
    """
    spans = invocations(rows, temperature).sum(axis=1)
    if spans.groupby(["run", "process"]).size().nunique() != 1:
        raise MissingEvidenceError(f"processes with unequal counts of {temperature} invocations")
    if temperature == COLD:
        spans = spans[spans.index.get_level_values("repeat") == 0]
    each = spans.groupby(["run", "process"]).median()
    runs = sorted(each.index.unique("run"))
    return {int(run): each.xs(run, level="run").to_numpy() for run in runs}


def invocations(rows: pd.DataFrame, temperature: str) -> pd.DataFrame:
    """Measured terms by invocation, s: index run, process and repeat; a column a term.

    Raises:
        MissingEvidenceError: None, a term that an invocation lacks or has twice, or no time.
    """
    own = rows[(rows["source"] == "measured") & (rows["temperature"] == temperature)]
    own = own.assign(seconds=numbers(own, "seconds"))
    if len(own) == 0:
        raise MissingEvidenceError(f"no {temperature} invocation was measured")
    if own.duplicated([*INVOCATION, "component"]).any():
        raise MissingEvidenceError("a component of an invocation was measured twice")
    wide = own.pivot(index=INVOCATION, columns="component", values="seconds")
    wide = wide.reindex(columns=list(MEASURED_HERE))
    if bool(wide.isna().any(axis=None)):
        raise MissingEvidenceError("an invocation lacks a measured component")
    if not bool((wide > 0).all(axis=None)):
        raise MissingEvidenceError("a measured component took no time")
    return wide


def _spans(times: Array, confidence: float) -> Spans:
    at = {
        level: (
            float(np.quantile(times, level, method="higher")),
            *order_statistic_interval(times, level, confidence),
        )
        for level in (MEDIAN, P95)
    }
    return Spans(len(times), at[MEDIAN], at[P95], float(times.max()))
