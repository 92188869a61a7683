"""Were the simple methods met at all, and as the candidates are?

A gain over a simple method is one over what it does. One that commanded nothing, of whose
invocations some are not recorded, that reached the stub past the safety path, or whose actions do
not add up was not compared: whoever beats it has beaten a fault of the comparison. What a candidate
is refused for, waiting or late and rejected answers, a simple method may do: it is worth less by
that. Then it is said, since that gain is one of timing or feasibility, and another distribution may
have nothing to do with it.
"""

from gates.engine import Judged
from gates.evidence import Evidence, MissingEvidenceError, counts, numbers
from gates.feasibility.arrivals import require_played
from gates.stress.invoked import invocations
from gates.stress.rollouts import StressSettings, rollouts
from gates.stress.safety import STUB, unaccounted
from gates.words import percent
from genpolicy.evidence.rows.stress import StressStubRow

HANDICAPS = (
    ("hold_share_upper", "hold_ticks", "ticks", "stands in {} of its ticks"),
    ("deadline_miss_upper", "deadline_misses", "invocations", "is late with {} of its answers"),
    ("rejection_share_upper", "rejections", "invocations", "has {} of its answers rejected"),
)
"""Criterion of a candidate, part, whole, and how a share of a simple method is told."""


def require_met(evidence: Evidence, settings: StressSettings) -> None:
    """Refuse to speak of a gain over a simple method that was not compared.

    A rehearsal is not refused for who commands nothing: its networks are hardly trained. It is
    told so (`handicaps_said`).

    Raises:
        MissingEvidenceError: In a planned condition a simple method commanded nothing, has no row
            at the stub or none of its balance of actions; a rollout of it states another number of
            invocations than is recorded; a stale or invalid action of it reached the stub; or its
            actions do not add up.
    """
    for name in settings.baselines:
        if not settings.limits.rehearsed and (silent := _silent(evidence, settings, name)):
            raise MissingEvidenceError(
                f"{name} commanded nothing in {', '.join(silent)}: nothing is shown by beating it"
            )
        invocations(evidence, settings, name)  # of what it was asked, nothing may lack
        stub = evidence.of(STUB, StressStubRow, name)
        require_played(stub, "perturbation", settings.perturbations)
        if bad := sum(float(counts(stub, column).sum()) for column in ("stale", "invalid")):
            raise MissingEvidenceError(
                f"{bad:g} stale or invalid actions of {name} reached the stub: the simple methods "
                "did not have the safety path of the candidates"
            )
        if error := unaccounted(evidence, settings, name):
            raise MissingEvidenceError(f"{error:g} actions of {name} are not accounted for")


def _silent(evidence: Evidence, settings: StressSettings, method: str) -> list[str]:
    """Conditions in which a method commanded nothing, in no rollout."""
    rows = rollouts(evidence, settings, method)
    rows = rows.assign(commanded=numbers(rows, "action_ticks"))
    commanded = rows.groupby("perturbation")["commanded"].sum()
    return [name for name in settings.perturbations if not commanded[name] > 0]


def handicaps_said(judged: Judged) -> list[str]:
    """One caveat of all simple methods that do more of what a candidate is refused for.

    It names of each the worst condition of the share that is furthest beyond its limit. It is
    silent of a method whose rollouts are missing: the criteria say what is.
    """
    settings = judged.settings
    assert isinstance(settings, StressSettings)
    said = []
    for name in settings.baselines:
        try:
            worst = _worst(judged.evidence, settings, name)
        except MissingEvidenceError:
            continue
        said += [f"{name} {worst}"] if worst else []
    if not said:
        return []
    return [
        f"Of the simple methods {'; '.join(said)}. A candidate would be refused for it: a gain "
        "over such a method may be one of timing or feasibility, and not of what it samples."
    ]


def _worst(evidence: Evidence, settings: StressSettings, method: str) -> str:
    """What a method does most beyond the limit of a candidate; empty where it keeps them all."""
    rows = rollouts(evidence, settings, method)
    found = []
    for criterion, part, whole, told in HANDICAPS:
        limit = settings.limits.number(criterion, otherwise=1.0)
        parts, wholes = numbers(rows, part), numbers(rows, whole)
        for condition in settings.perturbations:
            own = (rows["perturbation"] == condition).to_numpy()
            hits, of = float(parts[own].sum()), float(wholes[own].sum())
            if hits > limit * of and of > 0:
                share = f"{told.format(percent(hits / of))} in {condition}"
                found.append((hits / of - limit, f"{share} (limit {percent(limit)})"))
    return max(found)[1] if found else ""
