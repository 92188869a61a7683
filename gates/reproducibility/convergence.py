"""Convergence: is the training of the candidates, and of those they are compared with, done?

Methods are compared at equal updates: each takes the same number on the same windows. Convergence
is a condition on that: the last quarter of the training changes nobody more than the limit. A
method that is not done is judged by what it is not, be it the one that shall win or lose.

A candidate is asked by what is judged of it, valid samples: the loss of a density falls by a tenth
in every last quarter, however long the training, when its samples have long ceased to change. Those
that it is compared with are asked by their loss, which is the stricter question: a gain over them
must not be one over what they would have learned.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from gates.bounds import counted_interval
from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError, numbers
from gates.need.settings import TRAINED as BASELINES
from gates.reproducibility.modes import situations_of
from gates.reproducibility.settings import (
    GENERATORS,
    MODES,
    MODES_EARLIER,
    ReproducibilitySettings,
)
from gates.words import percent, points
from genpolicy.evidence.documents.given import MATCHED
from genpolicy.policies.validation_row import VALIDATION_FILE, ValidationRow, three_quarters
from genpolicy.statistics.ratios import ratio_of_sums


@dataclass(frozen=True)
class Fall:
    """Fall of the validation loss over the last quarter, as a share; the worst training seed.

    Attributes:
        share: Fall of the mean loss over the held-out windows; negative where it rises.
        interval: Its interval over held-out episodes.
        updates: Updates of the training.
        episodes: Held-out episodes.
    """

    share: float
    interval: tuple[float, float]
    updates: int
    episodes: int


@criterion(
    "<=",
    question="Is the candidate's training done?",
    look_at="Generator training: samples still change; raise `policy.training.updates`, for all.",
    per_candidate=True,
)
def late_change_upper(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Upper bound, either way, of what the last quarter changes of the share of valid samples."""
    before, after = (
        _valid(situations_of(evidence, settings, candidate, table=table))
        for table in (MODES_EARLIER, MODES)
    )
    if not before.index.equals(after.index):
        raise MissingEvidenceError("samples were not drawn at the same situations before and after")
    found = []
    for _, rows in after.groupby(level="seed"):
        samples = rows["samples"].groupby(level="episode_uuid").sum()
        gained = (rows["share"] - before.loc[rows.index, "share"]) * rows["samples"]
        gained = gained.groupby(level="episode_uuid").sum().loc[samples.index]
        change = ratio_of_sums(
            gained.to_numpy(), samples.to_numpy(), confidence=settings.confidence
        )
        unseen = counted_interval(0.0, float(len(samples)), confidence=settings.confidence)[1]
        sizes = (len(rows), len(samples))
        found.append((max(-change[1], change[2], unseen), change, sizes))
    upper, (point, low, high), (situations, episodes) = max(found)
    fall = last_quarter(evidence, GENERATORS, candidate, confidence=settings.confidence)
    text = (
        f"valid samples {points(point)} ({points(low)} to {points(high)}) at {situations} "
        f"situations over the last quarter; not judged: validation loss falls {_text(fall)}"
    )
    ends = (max(low, -high, 0.0), upper)
    counted = f"{episodes} episodes"
    return Measured(upper, ends, text, counted=counted, point=abs(point))


def _valid(rows: pd.DataFrame) -> pd.DataFrame:
    keys = ["seed", "episode_uuid", "index"]
    if rows.duplicated(keys).any():
        raise MissingEvidenceError("a situation is stated twice")
    shares = numbers(rows, "valid") / numbers(rows, "samples")
    table = rows.loc[:, keys].assign(samples=numbers(rows, "samples"), share=shares)
    return table.set_index(keys).sort_index()


@criterion(
    "<=",
    question="Is the training done of those that candidates are compared with?",
    look_at="Conditioning: a gain over a policy that still learns is none; train all for longer.",
)
def baseline_fall_upper(evidence: Evidence, settings: ReproducibilitySettings) -> Measured:
    """Largest upper bound, over the simple baselines, of the fall over the last quarter."""
    found, foreign = [], []
    for method in dict.fromkeys((settings.budget_reference, *settings.baselines)):
        if method == settings.budget_reference or has_training(evidence, method):
            fall = last_quarter(evidence, BASELINES, method, confidence=settings.confidence)
            found.append((fall.interval[1], method, fall))
        else:
            foreign.append(method)
    _require_same_windows(evidence, [method for _, method, _ in found])
    upper, _, worst = max(found)
    each = "; ".join(f"{method} {_text(fall)}" for _, method, fall in found)
    text = f"validation loss falls: {each}" + (
        f"; no training of its own: {', '.join(foreign)}" if foreign else ""
    )
    counted = f"{worst.episodes} episodes"
    return Measured(upper, worst.interval, text, counted=counted, point=worst.share)


def _require_same_windows(evidence: Evidence, methods: Sequence[str]) -> None:
    """Every training was measured on the same held-out windows: nobody left its worst ones out.

    Raises:
        MissingEvidenceError: One was measured on others.
    """
    known: dict[Any, Any] = {}
    for method in methods:
        for table, measured in losses(evidence, BASELINES, method).items():
            own = pd.DataFrame(measured["windows"]).max(axis=1).to_dict()
            if own != (known := known or own):
                raise MissingEvidenceError(
                    f"{table} has {len(own)} episodes with other held-out windows than "
                    f"{methods[0]}, which has {len(known)}"
                )


def last_quarter(evidence: Evidence, root: str, method: str, *, confidence: float) -> Fall:
    """Fall of a method's validation loss from three quarters of its training to the end.

    Raises:
        MissingEvidenceError: It was not measured at both, on the same windows.
    """
    key = ("last quarter", root, method, confidence)
    return evidence.once(key, lambda: _last_quarter(evidence, root, method, confidence))


def _last_quarter(evidence: Evidence, root: str, method: str, confidence: float) -> Fall:
    updates = updates_of(evidence, root, method)
    falls = []
    for table, measured in losses(evidence, root, method).items():
        moments = (three_quarters(updates), updates)
        if any(("total", moment) not in measured.columns for moment in moments):
            raise MissingEvidenceError(f"{table} lacks the loss after {moments[0]} or {updates}")
        kept = measured.loc[:, [(name, m) for name in ("total", "windows") for m in moments]]
        if bool(kept.isna().any(axis=None)) or not (kept["total"].to_numpy() > 0).all():
            raise MissingEvidenceError(f"{table} lacks the loss of an episode")
        if not (kept["windows"][moments[0]] == kept["windows"][updates]).all() or len(kept) < 2:
            raise MissingEvidenceError(f"{table} compares different windows, or one episode")
        before, after = (kept["total"][m].to_numpy(dtype="float64") for m in moments)
        ratio, lower, upper = ratio_of_sums(after, before, confidence=confidence)
        falls.append(Fall(1.0 - ratio, (1.0 - upper, 1.0 - lower), updates, len(kept)))
    return max(falls, key=lambda fall: fall.interval[1])


def losses(evidence: Evidence, root: str, method: str) -> dict[str, pd.DataFrame]:
    """By table of a training seed: total loss and windows of held-out episodes, by updates so far.

    Do not write into the frames.

    Raises:
        MissingEvidenceError: It was not measured in every training of the method, or stated twice.
    """
    return evidence.once(("losses", root, method), lambda: _losses(evidence, root, method))


def _losses(evidence: Evidence, root: str, method: str) -> dict[str, pd.DataFrame]:
    tables = evidence.bind(f"{root}/{method}/seed_*/{VALIDATION_FILE}")
    trained = evidence.bind(f"{root}/{method}/seed_*/model.safetensors")
    if not tables or len(tables) != len(trained):
        raise MissingEvidenceError(f"validation loss was not measured while {method} was trained")
    found = {}
    for table in tables:
        rows = evidence.rows(table, ValidationRow)
        rows = rows.assign(total=numbers(rows, "loss") * numbers(rows, "windows"))
        if rows.duplicated(["episode_uuid", "updates"]).any():
            raise MissingEvidenceError(f"{table} states a loss twice")
        found[table] = rows.pivot(
            index="episode_uuid", columns="updates", values=["total", "windows"]
        )
    return found


def updates_of(evidence: Evidence, root: str, method: str) -> int:
    """How many updates a method was trained for.

    Raises:
        MissingEvidenceError: The evidence does not say.
    """
    entry = evidence.document(root, MATCHED).methods.get(method)
    if entry is None:
        raise MissingEvidenceError(f"{root}/{MATCHED.file} does not say how {method} was trained")
    return entry.config.training.updates


def has_training(evidence: Evidence, method: str) -> bool:
    """Whether a baseline has a training: by the account of it, not by weights that may be gone."""
    named = method in evidence.document(BASELINES, MATCHED).methods
    return named or bool(evidence.bind(f"{BASELINES}/{method}/seed_*/model.safetensors"))


def _text(fall: Fall) -> str:
    return (
        f"{percent(fall.share)} ({percent(fall.interval[0])} to {percent(fall.interval[1])}) over "
        f"the last "
        f"quarter of {fall.updates} updates, {fall.episodes} held-out episodes"
    )
