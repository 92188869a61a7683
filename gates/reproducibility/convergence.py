"""Convergence: is the training of the candidates, and of those they are compared with, done?

Equal updates are one rule of matching: every method takes the same number on the same windows.
Equal convergence is the other: the last quarter of the training gains nobody more than the limit.
A method that is not done is judged by what it is not, be it the one that shall win or lose.
"""

from dataclasses import dataclass

from gates.criterion import Measured, criterion
from gates.evidence import Evidence, MissingEvidenceError, number, numbers
from gates.need.settings import TRAINED as BASELINES
from gates.reproducibility.settings import GENERATORS, ReproducibilitySettings
from genpolicy.policies.validation_row import ValidationRow, three_quarters
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
    look_at="Generator training: the loss still falls; raise `policy.training.steps`, for all.",
    per_candidate=True,
)
def validation_fall_upper(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str
) -> Measured:
    """Upper bound of the fall of the validation loss over the last quarter of the training."""
    fall = last_quarter(evidence, GENERATORS, candidate, confidence=settings.confidence)
    return Measured(fall.interval[1], fall.interval, _text(fall))


@criterion(
    "<=",
    question="Is the training done of those that candidates are compared with?",
    look_at="Conditioning: a gain over a policy that still learns is none; train all for longer.",
)
def baseline_fall_upper(evidence: Evidence, settings: ReproducibilitySettings) -> Measured:
    """Largest upper bound, over the simple baselines, of the fall over the last quarter."""
    found, foreign = [], []
    for method in dict.fromkeys((settings.budget_reference, *settings.baselines)):
        if method == settings.budget_reference or _has_weights(evidence, method):
            fall = last_quarter(evidence, BASELINES, method, confidence=settings.confidence)
            found.append((fall.interval[1], method, fall))
        else:
            foreign.append(method)
    upper, _, worst = max(found)
    each = "; ".join(f"{method} {_text(fall)}" for _, method, fall in found)
    text = each + (f"; no training of its own: {', '.join(foreign)}" if foreign else "")
    return Measured(upper, worst.interval, text)


def last_quarter(evidence: Evidence, root: str, method: str, *, confidence: float) -> Fall:
    """Fall of a method's validation loss from three quarters of its training to the end.

    Raises:
        MissingEvidenceError: It was not measured at both, on the same windows.
    """
    updates = _updates(evidence, root, method)
    tables = evidence.bind(f"{root}/{method}/seed_*/validation.parquet")
    trained = evidence.bind(f"{root}/{method}/seed_*/model.safetensors")
    if not tables or len(tables) != len(trained):
        raise MissingEvidenceError(f"validation loss was not measured while {method} was trained")
    falls = []
    for table in tables:
        rows = evidence.rows(table, ValidationRow)
        rows = rows.assign(total=numbers(rows, "loss") * numbers(rows, "windows"))
        if rows.duplicated(["episode_uuid", "step"]).any():
            raise MissingEvidenceError(f"{table} states a loss twice")
        by_step = rows.pivot(index="episode_uuid", columns="step", values=["total", "windows"])
        moments = (three_quarters(updates), updates)
        if any(("total", moment) not in by_step.columns for moment in moments):
            raise MissingEvidenceError(f"{table} lacks the loss after {moments[0]} or {updates}")
        kept = by_step.loc[:, [(name, m) for name in ("total", "windows") for m in moments]]
        if bool(kept.isna().any(axis=None)) or not (kept["total"].to_numpy() > 0).all():
            raise MissingEvidenceError(f"{table} lacks the loss of an episode")
        if not (kept["windows"][moments[0]] == kept["windows"][updates]).all() or len(kept) < 2:
            raise MissingEvidenceError(f"{table} compares different windows, or one episode")
        before, after = (kept["total"][m].to_numpy(dtype="float64") for m in moments)
        ratio, lower, upper = ratio_of_sums(after, before, confidence=confidence)
        falls.append(Fall(1.0 - ratio, (1.0 - upper, 1.0 - lower), updates, len(kept)))
    return max(falls, key=lambda fall: fall.interval[1])


def _updates(evidence: Evidence, root: str, method: str) -> int:
    methods = evidence.document(f"{root}/matched.json").get("methods")
    entry = methods.get(method) if isinstance(methods, dict) else None
    config = entry.get("config") if isinstance(entry, dict) else None
    training = config.get("training") if isinstance(config, dict) else None
    if not isinstance(training, dict):
        raise MissingEvidenceError(f"{root}/matched.json does not say how {method} was trained")
    return int(number(training, "steps"))


def _has_weights(evidence: Evidence, method: str) -> bool:
    return bool(evidence.bind(f"{BASELINES}/{method}/seed_*/model.safetensors"))


def _text(fall: Fall) -> str:
    return (
        f"{fall.share:.4g} ({fall.interval[0]:.4g} to {fall.interval[1]:.4g}) over the last "
        f"quarter of {fall.updates} updates, {fall.episodes} held-out episodes"
    )
