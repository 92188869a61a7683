"""Settings of the sweep against each other: which would one deploy, and what does less cost?

A setting is efficient if no other of its method is as good in time, coverage, chunk error and
jerk, and better in one. The rule that names one: of those whose answer keeps the deadline, the
cheapest whose coverage is not below the interval of the best. It is told, and judged nowhere; what
is deployed stands in the parameters.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from gates.evidence import Evidence, MissingEvidenceError, numbers
from gates.reproducibility.latency_budget import LATENCY, MILLI, P95, budget_of
from gates.reproducibility.settings import COVERAGE, RELOAD
from gates.words import percent, points
from genpolicy.evidence.documents.reproducibility import CANDIDATES
from genpolicy.evidence.rows.reproducibility import CoverageRow, LatencyRow, SweepLatencyRow

SWEEP = "artifacts/latency/sweep.parquet"
SWEPT_TERMS = ("preprocess", "encode", "sample", "select")
"""What the times of the sweep hold; the other terms are added to them as on paper."""


@dataclass(frozen=True)
class Setting:
    """One sampler of the sweep of a method, with the weights of its first seed.

    Attributes:
        name: Sampler, steps, and what else it differs in from other settings of its method.
        sha256: Its settings.
        nfe: Network evaluations of a sample.
        tolerance: Of a solver that chooses its steps; None of the others.
        p50_s: Median from observation to proposal, s; infinite where no answer came.
        answer_s: p95 of that, and of every other term, summed, s; likewise.
        coverage: Share of situations of which every mode is reached.
        coverage_lower: Lower end of its interval.
        chunk_error: Mean absolute error on held-out windows, normalised units.
        jerk_p95_m_s3: p95 of the largest jerk inside a chunk, m/s^3.
        nonfinite: Chunks on held-out windows that are no numbers, or never came; their error and
            jerk are NaN.
        given_up: Of these, those that were given up at the sampler's cap.
    """

    name: str
    sha256: str
    nfe: int
    tolerance: float | None
    p50_s: float
    answer_s: float
    coverage: float
    coverage_lower: float
    chunk_error: float
    jerk_p95_m_s3: float
    nonfinite: int = 0
    given_up: int = 0

    def dominates(self, other: "Setting") -> bool:
        """As good in everything, and better in something; what diverges is as good as nothing."""
        if self.nonfinite or other.nonfinite:
            return other.nonfinite > 0 and not self.nonfinite
        own, its = self._costs(), other._costs()
        return own != its and all(a <= b for a, b in zip(own, its, strict=True))

    def _costs(self) -> tuple[float, float, float, float]:
        return self.p50_s, -self.coverage, self.chunk_error, self.jerk_p95_m_s3


@dataclass(frozen=True)
class Choice:
    """What the rule says of one method.

    Attributes:
        deploy: The setting; None where no answer keeps the deadline.
        best: The one of highest coverage among those that keep the deadline.
        cheaper: The next cheaper one than the chosen; None where there is none.
    """

    deploy: Setting | None
    best: Setting | None
    cheaper: Setting | None


def settings_of(evidence: Evidence, method: str, *, confidence: float) -> list[Setting]:
    """The sweep of a method, from the cheapest.

    Raises:
        MissingEvidenceError: A setting was drawn from and never timed, a coverage lies outside its
            interval, or a term is unknown.
    """
    drawn = evidence.of(COVERAGE, CoverageRow, method)
    drawn = drawn[drawn["seed"] == drawn["seed"].min()]
    times = evidence.of(SWEEP, SweepLatencyRow, method)
    budget = budget_of(evidence.of(LATENCY, LatencyRow, method), "warm", confidence=confidence)
    rest_s = budget.sum_of_p95_s - sum(budget.terms[term].p95[0] for term in SWEPT_TERMS)
    found = _told_apart(
        _setting(row, times[times["sampler_sha256"] == row["sampler_sha256"]], rest_s)
        for row in drawn.to_dict("records")
    )
    return sorted(found, key=lambda setting: (setting.p50_s, setting.name))


def _told_apart(found: Iterable[Setting]) -> list[Setting]:
    """The same; those that still have one name, as of who says little of itself, by their hash."""
    settings = list(found)
    called = Counter(setting.name for setting in settings)
    return [
        setting
        if called[setting.name] == 1
        else replace(setting, name=f"{setting.name} ({setting.sha256[:8]})")
        for setting in settings
    ]


def _name(row: Mapping[str, object], tolerance: float | None) -> str:
    parts = [f"{row['sampler']}, {row['steps']} steps", str(row["settings"])]
    if tolerance is not None:
        parts.append(f"tolerance {tolerance:g}")
    return ", ".join(part for part in parts if part)


def _setting(row: dict[str, object], times: pd.DataFrame, rest_s: float) -> Setting:
    said = row["tolerance"]
    known = isinstance(said, float) and bool(np.isfinite(said))
    tolerance = float(str(said)) if known else None
    name = _name(row, tolerance)
    if len(times) == 0 and not int(str(row["nonfinite"])):
        raise MissingEvidenceError(f"{SWEEP} has no times of {row['method']}, {name}")
    seconds = numbers(times, "seconds") if len(times) else np.array([math.inf])
    if not np.all(seconds > 0.0):
        raise MissingEvidenceError(f"{SWEEP} has {name} in no time")
    shares = {
        key: float(str(row[key]))
        for key in ("modes_covered_share", "coverage_lower", "chunk_error", "jerk_p95_m_s3")
    }
    if not shares["coverage_lower"] <= shares["modes_covered_share"]:
        raise MissingEvidenceError(f"{COVERAGE} has {name} below the lower end of its interval")
    if not np.all(np.isfinite(list(shares.values()))) and not int(str(row["nonfinite"])):
        raise MissingEvidenceError(f"{COVERAGE} has {name} with what is no number")
    return Setting(
        name=name,
        sha256=str(row["sampler_sha256"]),
        nfe=int(str(row["nfe"])),
        tolerance=tolerance,
        p50_s=float(np.median(seconds)),
        answer_s=float(np.quantile(seconds, P95, method="higher")) + rest_s,
        coverage=shares["modes_covered_share"],
        coverage_lower=shares["coverage_lower"],
        chunk_error=shares["chunk_error"],
        jerk_p95_m_s3=shares["jerk_p95_m_s3"],
        nonfinite=int(str(row["nonfinite"])),
        given_up=int(str(row["given_up"])),
    )


def efficient(settings: Sequence[Setting]) -> list[bool]:
    """Whether each lies on the front; what diverges never does."""
    return [
        not one.nonfinite and not any(other.dominates(one) for other in settings)
        for one in settings
    ]


def choice(settings: Sequence[Setting], *, deadline_s: float) -> Choice:
    """What the rule says of the settings of a method, from the cheapest."""
    settings = [setting for setting in settings if not setting.nonfinite]
    kept = [setting for setting in settings if setting.answer_s <= deadline_s]
    if not kept:
        return Choice(None, None, None)
    # Of equal ones the cheapest: they come first.
    best = max(kept, key=lambda setting: setting.coverage)
    place, deploy = next(
        (place, setting)
        for place, setting in enumerate(settings)
        if setting in kept and setting.coverage >= best.coverage_lower
    )
    return Choice(deploy, best, settings[place - 1] if place else None)


def deadline_of(evidence: Evidence, method: str) -> float:
    """Time after which an answer of the method is given up, s.

    Raises:
        MissingEvidenceError: No identity card says.
    """
    entry = evidence.document(RELOAD, CANDIDATES).get(method)
    if entry is None:
        raise MissingEvidenceError(f"{RELOAD}/{CANDIDATES.file} has no entry of {method}")
    return entry.card.deadline_s


def advice(found: Choice, *, deadline_s: float) -> tuple[str, str]:
    """Which setting one would deploy, and what the next cheaper one loses: a sentence each."""
    deploy, best, cheaper = found.deploy, found.best, found.cheaper
    if deploy is None or best is None:
        return f"None: no answer keeps {deadline_s * MILLI:g} ms.", "Nothing is left to lose."
    why = (
        f"{deploy.name}: the cheapest whose answer keeps {deadline_s * MILLI:g} ms and whose "
        f"coverage, {percent(deploy.coverage)}, is not below {percent(best.coverage_lower)}, where "
        f"the interval of the best begins ({best.name}, {percent(best.coverage)})."
    )
    if cheaper is None:
        return why, "There is no cheaper one in the sweep."
    late = (
        ""
        if cheaper.answer_s <= deadline_s
        else (f" and misses the deadline: its answer takes {cheaper.answer_s * MILLI:.3g} ms")
    )
    return why, (
        f"{cheaper.name} saves {(deploy.p50_s - cheaper.p50_s) * MILLI:.3g} ms{late}; coverage "
        f"{points(cheaper.coverage - deploy.coverage)}, chunk error "
        f"{_relative(cheaper.chunk_error, deploy.chunk_error)}, jerk "
        f"{_relative(cheaper.jerk_p95_m_s3, deploy.jerk_p95_m_s3)}."
    )


def _relative(value: float, to: float) -> str:
    return f"{100 * (value / to - 1.0):+.3g} %" if to > 0.0 else f"{value:.3g} against 0"
