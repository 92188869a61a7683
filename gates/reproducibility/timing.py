"""Timing: is every term known, does it come back in other processes, and does the model hold?"""

import functools

import numpy as np
import pandas as pd

from gates.criterion import Measured, criterion
from gates.evidence import Array, Evidence, MissingEvidenceError, numbers
from gates.reproducibility.contention import Ends, running, waited_share, weigh
from gates.reproducibility.latency_budget import (
    COLD,
    LATENCY,
    MEASURED_HERE,
    P95,
    TERMS,
    WARM,
    spans_of_processes,
)
from gates.reproducibility.modelled import require_as_timed
from gates.reproducibility.planned import require_repeats
from gates.reproducibility.settings import ReproducibilitySettings
from gates.words import duration, percent, three
from genpolicy.evidence.rows.reproducibility import LatencyModelRow, LatencyRow
from genpolicy.statistics.equivalence import FEWEST, ratio_of_means, ratio_to, spread_found

MODEL = "artifacts/latency/model.parquet"
ACTIONS = (
    "continue", "drop_observation", "skip_invocation", "cancel_candidate", "reject_candidate",
    "reject_stale", "fallback",
)  # fmt: skip
"""What may be declared (`genpolicy.contract.latency.DeadlineAction`)."""
NONE = (np.inf, -np.inf)
"""Ends of a term that nobody declared: no draw lies between them."""
DECLARED = "declared, not measured"
"""Said of latency terms that somebody wrote down."""
# A root of an integral, asked anew for every method with the same numbers.
_spread_found = functools.cache(spread_found)

KINDS = {"component": TERMS, "temperature": (COLD, WARM), "source": ("measured", "declared")}
"""What the rows of `latency.parquet` may be of."""


@criterion(
    "<=",
    question="Is each of the eleven latency terms known, and what is done where it takes too long?",
    look_at="Timing: a missing term is unknown, never zero; measure or declare it, and its action.",
    per_candidate=True,
)
def latency_terms_missing(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Terms neither measured nor declared, of no single owner, or without a declared action."""
    rows = _latency(evidence, candidate)
    seconds = rows["seconds"].to_numpy(dtype=np.float64, na_value=np.nan)
    taken = (rows["source"] == "measured").to_numpy()
    measured = set(rows.loc[taken & np.isfinite(seconds), "component"])
    # Of a term that was written down every draw lies between its ends: another one nobody wrote.
    least, most = (
        rows["component"].map(lambda term, end=end: settings.declared.get(term, NONE)[end])
        for end in (0, 1)
    )
    drawn = np.isfinite(seconds) & (seconds >= least.to_numpy()) & (seconds <= most.to_numpy())
    wrong = set(rows.loc[~taken & ~drawn, "component"])
    declared = sorted(set(rows.loc[~taken, "component"]) - wrong - measured)
    missing = [
        term
        for term in TERMS
        if term not in measured and (term in MEASURED_HERE or term not in declared)
    ]
    acted = {term for term, _, action in settings.term_deadlines if action in ACTIONS}
    idle = [term for term in TERMS if term not in acted]
    owners = {str(term): set(part.str.strip()) for term, part in rows.groupby("component")["owner"]}
    ownerless = [term for term, named in owners.items() if len(named) != 1 or "" in named]
    stated = [term for term in TERMS if term in declared and term not in missing]
    text = f"missing: {', '.join(missing)}; " if missing else ""
    text += f"{len(stated)} of {len(TERMS)} terms {DECLARED}: {', '.join(stated) or 'none'}"
    if idle:
        text += f"; nothing is done where these take too long: {', '.join(idle)}"
    if ownerless:
        text += f"; not one owner answers for: {', '.join(ownerless)}"
    return Measured(float(len({*missing, *idle, *ownerless})), caveat=text)


def _latency(evidence: Evidence, candidate: str) -> pd.DataFrame:
    """Its rows, of the terms, temperatures and sources that there are.

    Raises:
        MissingEvidenceError: One of another kind, which no sum would hold.
    """
    rows = evidence.of(LATENCY, LatencyRow, candidate)
    for column, known in KINDS.items():
        if others := sorted(set(rows[column]) - set(known)):
            raise MissingEvidenceError(f"{LATENCY} has a {column} {others[0]!r} that is none")
    return rows


def _ratio_of_runs(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str, temperature: str
) -> Measured:
    rows = _latency(evidence, candidate)
    require_repeats(rows, settings, candidate, temperature)
    wall, (first, second) = _compared(rows, temperature, settings.confidence)
    without = share = None
    if (alone := running(rows)) is not None:
        without, ran = _compared(alone, temperature, settings.confidence)
        share = waited_share(np.concatenate([first, second]), np.concatenate(ran))
    limit = _limit(settings, f"{temperature}_latency_ratio_upper")
    weighed = weigh(wall, without, share=share, limit=limit)
    text = (
        f"{duration(np.median(first))} and {duration(np.median(second))}, {temperature}, "
        f"over {len(first)} processes each; {weighed.said}; {_least_stable(rows, temperature)}"
    )
    if limit is not None and limit > 1.0:
        spread = _spread_found(limit, len(first), confidence=settings.confidence)
        text += (
            f"; equal runs pass in four of five if processes differ by {percent(spread)} at most"
        )
    counted = f"{len(first)} and {len(second)} processes"
    return Measured(wall.most, weighed.interval, text, counted=counted, undecided=weighed.undecided)


def _compared(
    rows: pd.DataFrame, temperature: str, confidence: float
) -> tuple[Ends, tuple[Array, Array]]:
    """Slower over faster run, and what an invocation takes in each process of either, s."""
    if _repeats(rows, COLD) > _repeats(rows, WARM):
        raise MissingEvidenceError("more cold than warm invocations: they stand for each other")
    spans = spans_of_processes(rows, temperature)
    if sorted(spans) != [1, 2] or len({len(found) for found in spans.values()}) != 1:
        raise MissingEvidenceError("two runs of as many processes each are needed")
    first, second = spans[1], spans[2]
    if len(first) < FEWEST:
        raise MissingEvidenceError(f"{len(first)} process of each run tells nothing of another")
    ratio, lower, upper = ratio_of_means(first, second, confidence=confidence)
    # Slower over faster: what stands on both sides of 1 may be none.
    ends = (max(1.0, lower, 1.0 / upper), max(upper, 1.0 / lower))
    return Ends(ends[0], max(ratio, 1.0 / ratio), ends[1]), (first, second)


def _repeats(rows: pd.DataFrame, temperature: str) -> int:
    """Invocations of a temperature in one process."""
    own = rows[(rows["source"] == "measured") & (rows["temperature"] == temperature)]
    return int(own["repeat"].nunique())


def _limit(settings: ReproducibilitySettings, name: str) -> float | None:
    found = settings.limits.of.get(name)
    return found.limit if found is not None else None


def _least_stable(rows: pd.DataFrame, temperature: str) -> str:
    own = rows[(rows["source"] == "measured") & (rows["temperature"] == temperature)]
    medians = own.pivot_table(index="component", columns="run", values="seconds", aggfunc="median")
    ratios = medians[1] / medians[2]
    ratios = ratios.where(ratios >= 1, 1 / ratios)
    return f"least stable component {ratios.idxmax()}, ×{three(float(ratios.max()))}"


@criterion(
    "<=",
    question="Does a second measurement in fresh processes find the same warm latency?",
    look_at="Timing: the machine was busy, or warm-up is incomplete; measure again.",
    per_candidate=True,
)
def warm_latency_ratio_upper(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Warm medians of two sets of processes, slower over faster, at the worse end."""
    return _ratio_of_runs(evidence, settings, candidate, "warm")


@criterion(
    "<=",
    question="Does it find the same latency of a first, cold call?",
    look_at="Timing: disk or imports were slow in one run; measure again on a quiet machine.",
    per_candidate=True,
)
def cold_latency_ratio_upper(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """First calls of two sets of processes, slower over faster, at the worse end."""
    return _ratio_of_runs(evidence, settings, candidate, "cold")


@criterion(
    "<=",
    question="Does gate D draw candidates no shorter, and what they are held against no longer?",
    look_at="Timing: slow terms coincide, or the machine was busier in one run; measure again.",
    per_candidate=True,
)
def latency_model_ratio_upper(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """p95 of each process against that of a model made without it, at the upper end.

    Either way a candidate would win by a clock that is not the cell's: where its own invocations
    take longer than drawn, or those of a baseline shorter. The furthest of them is measured.
    """
    limit = _limit(settings, "latency_model_ratio_upper")
    asked = [(candidate, True), *((name, False) for name in settings.baselines)]
    found = [_held(evidence, settings, name, longer=longer, limit=limit) for name, longer in asked]
    # Who is shown to be beyond the limit stands before whoever may be further beyond it.
    return max(found, key=lambda one: (_shown(one, limit), one.value))


def _shown(found: Measured, limit: float | None) -> bool:
    return limit is not None and found.interval is not None and not found.interval[0] <= limit


def _held(
    evidence: Evidence,
    settings: ReproducibilitySettings,
    method: str,
    *,
    longer: bool,
    limit: float | None,
) -> Measured:
    """How much longer (or shorter) a method's processes took than was drawn of the others."""
    rows = evidence.of(MODEL, LatencyModelRow, method)
    high = rows[rows["level"] == P95]
    if set(high["run"]) != {1, 2} or len(high) < 2 * FEWEST:
        raise MissingEvidenceError(f"{method}: the p95 of several processes of both runs is needed")
    times = _latency(evidence, method)
    require_repeats(times, settings, method, WARM)
    _require_every_process(times, method, high)
    # Of a baseline every candidate asks; none of them is told anything else.
    evidence.once(
        ("as timed", method, settings.root_seed),
        lambda: require_as_timed(high, times, method, root_seed=settings.root_seed),
    )
    pair = _times(high, "measured_s", "drawn_s", method)
    wall = _ratio(pair, longer=longer, confidence=settings.confidence)
    without = share = None
    if not high[["measured_running_s", "drawn_running_s"]].isna().any(axis=None):
        alone = _times(high, "measured_running_s", "drawn_running_s", method)
        without = _ratio(alone, longer=longer, confidence=settings.confidence)
        share = max(waited_share(*both) for both in zip(pair, alone, strict=True))
    weighed = weigh(wall, without, share=share, limit=limit)
    measured, drawn = pair
    text = (
        f"{method}: p95 of {len(high)} processes {duration(np.median(measured))}, drawn "
        f"{duration(np.median(drawn))} from the others: "
        f"{'measured over drawn' if longer else 'drawn over measured'} ×{three(wall.point)}; "
        f"{weighed.said}"
    )
    counted = f"{len(high)} processes"
    return Measured(wall.most, weighed.interval, text, counted=counted, undecided=weighed.undecided)


def _require_every_process(rows: pd.DataFrame, method: str, high: pd.DataFrame) -> None:
    """The model was held against every process that was timed, once.

    Raises:
        MissingEvidenceError: One was left out, or stands there twice.
    """
    timed = rows.loc[rows["source"] == "measured", ["run", "process"]].drop_duplicates()
    held = list(high[["run", "process"]].itertuples(index=False, name=None))
    if sorted(held) != sorted(timed.itertuples(index=False, name=None)):
        raise MissingEvidenceError(f"{method}: {MODEL} does not hold each timed process once")


def _times(rows: pd.DataFrame, measured: str, drawn: str, method: str) -> tuple[Array, Array]:
    pair = numbers(rows, measured), numbers(rows, drawn)
    if not all(np.all(times > 0) for times in pair):
        raise MissingEvidenceError(f"{method}: a quantile of no time")
    return pair


def _ratio(pair: tuple[Array, Array], *, longer: bool, confidence: float) -> Ends:
    """What was measured over what was drawn, or the other way round."""
    ratio, lower, upper = ratio_to(*(pair if longer else pair[::-1]), confidence=confidence)
    return Ends(lower, ratio, upper)
