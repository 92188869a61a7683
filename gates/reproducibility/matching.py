"""Two rules by which a candidate is matched with each simple baseline, side by side.

Equal updates: both took the same number. It is how the methods are trained. Equal convergence: both
are done, by the same rule, the loss of either over the last quarter of its training. It is what two
trainings of unlike methods have in common at best, and where it does not hold the table says on
whose side something remains. What remains to a baseline may be the whole gain over it, and is a
criterion (`baseline_fall_upper`). What remains to a candidate it pays for itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from gates.evidence import Evidence, MissingEvidenceError
from gates.need.settings import TRAINED as BASELINES
from gates.report import Verdict
from gates.reproducibility.convergence import (
    Fall,
    has_training,
    last_quarter,
    losses,
    updates_of,
)
from gates.reproducibility.settings import GENERATORS
from gates.verdicts import judge_criterion, worst


@dataclass(frozen=True)
class Trained:
    """How far one method has come.

    Attributes:
        method: The method.
        updates: Updates of its training.
        fall: Fall of its validation loss over the last quarter.
        near: Update from which on that loss was no further above its end than the limit, as far as
            it was measured; the latest of its training seeds.
        done: Whether the fall is shown to be within the limit, shown to be beyond, or neither.
    """

    method: str
    updates: int
    fall: Fall
    near: int
    done: Verdict


@dataclass(frozen=True)
class Pair:
    """A candidate and a baseline, by both rules."""

    candidate: Trained
    baseline: Trained

    @property
    def by_updates(self) -> Verdict:
        """Whether both took as many updates."""
        return "PASS" if self.candidate.updates == self.baseline.updates else "FAIL"

    @property
    def by_convergence(self) -> Verdict:
        """Whether both are done, by the same rule."""
        return worst((self.candidate.done, self.baseline.done))

    @property
    def remains(self) -> str:
        """On whose side something may remain to be learned, and who gains by it."""
        found = []
        if self.baseline.done != "PASS":
            found.append(f"{self.baseline.method}, in favour of the candidate")
        if self.candidate.done != "PASS":
            found.append(f"{self.candidate.method}, to its own cost")
        return "; ".join(found)


def trained(
    evidence: Evidence, root: str, method: str, *, limit: float, confidence: float
) -> Trained:
    """How far a method has come.

    Raises:
        MissingEvidenceError: Its validation loss was not measured.
    """
    fall = last_quarter(evidence, root, method, confidence=confidence)
    done = judge_criterion(fall.interval[1], limit, "<=", fall.interval)
    near = []
    for frame in losses(evidence, root, method).values():
        after = sorted(int(count) for count in frame["total"].columns)
        total = [float(frame["total"][count].sum()) for count in after]
        beyond = [place for place, loss in enumerate(total) if loss > (1.0 + limit) * total[-1]]
        near.append(after[beyond[-1] + 1 if beyond else 0])
    return Trained(method, updates_of(evidence, root, method), fall, max(near), done)


def pairs(
    evidence: Evidence,
    *,
    candidates: Sequence[str],
    baselines: Sequence[str],
    limit: float,
    confidence: float,
) -> list[Pair]:
    """Every candidate with every baseline that has a training of its own.

    Args:
        evidence: The evidence.
        candidates: Those that were trained here.
        baselines: What they are compared with.
        limit: Largest fall over the last quarter of a training that is done.
        confidence: Coverage of its interval.

    Raises:
        MissingEvidenceError: The validation loss of one was not measured.
    """
    held = [
        trained(evidence, BASELINES, name, limit=limit, confidence=confidence)
        for name in dict.fromkeys(baselines)
        if has_training(evidence, name)
    ]
    return [
        Pair(candidate, baseline)
        for candidate in (
            trained(evidence, GENERATORS, name, limit=limit, confidence=confidence)
            for name in candidates
        )
        for baseline in held
    ]


def matched_by(
    evidence: Evidence,
    *,
    candidates: Sequence[str],
    baselines: Sequence[str],
    limit: float | None,
    confidence: float,
) -> list[str]:
    """What a report says of both rules: a sentence for each candidate that one does not hold for.

    Where both hold the page says so, and nothing is left to doubt.
    """
    said = []
    for name in candidates:
        if limit is None:
            said.append(f"{name}, matched by equal convergence: no limit says what is done.")
            continue
        try:
            found = pairs(
                evidence, candidates=(name,), baselines=baselines, limit=limit,
                confidence=confidence,
            )  # fmt: skip
        except MissingEvidenceError as error:
            said.append(f"{name}, matched by equal updates and convergence: not measured, {error}.")
            continue
        if not found:
            said.append(f"{name}, matched by two rules: no baseline to match with.")
        if any(rule != "PASS" for pair in found for rule in (pair.by_updates, pair.by_convergence)):
            said.append(_said(name, found, limit))
    return said


def _said(name: str, found: Sequence[Pair], limit: float) -> str:
    updates = worst(pair.by_updates for pair in found)
    convergence = worst(pair.by_convergence for pair in found)
    left = dict.fromkeys(
        part for pair in found for part in pair.remains.split("; ") if pair.remains
    )
    remains = f"; may still learn: {', '.join(left)}" if left else ""
    return (
        f"{name}, matched with {len(found)} baselines by two rules. Equal updates: {updates}. "
        f"Equal convergence (the loss of both falls by {limit:g} at most over the last quarter): "
        f"{convergence}{remains}. The page has both for every pair."
    )
