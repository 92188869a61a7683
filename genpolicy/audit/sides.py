"""Both kinds of evidence: neighbours in every observation, and in what predicts the action.

What follows (links, variables, outcomes, resamples) is about the situations of one of them: of the
neighbours in every observation, unless only the learned ones show modes.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

from genpolicy.audit.component_rows import POSITION
from genpolicy.audit.counts import count
from genpolicy.audit.data import AuditInput
from genpolicy.audit.documents import Counts
from genpolicy.audit.learned import find_learned
from genpolicy.audit.looks import Look, foremost, look_at_route
from genpolicy.audit.mean_versus_modes import Admissible, compare
from genpolicy.audit.neighbourhoods import Support
from genpolicy.audit.persistence import summarise
from genpolicy.audit.progress import Progress
from genpolicy.audit.reach import reaches
from genpolicy.audit.reach_rows import LEARNED, LOCAL, Reach, Side
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.situations import Situation, coherent, examine
from genpolicy.audit.structure_draws import Queries, queries_of

# Situations with modes by their neighbours that the learned evidence is asked of again, at most.
AGAIN = 100


@dataclass(frozen=True)
class View:
    """What one kind of evidence saw.

    Attributes:
        kind: `local` or `learned`.
        look: The component that it follows.
        support: Queries per phase.
        claims: Every situation, before phases were held to persist.
        situations: The same after.
        counts: What was found, counted.
        queries: Every query.
        confirmed: Situations of the other kind that have modes here as well.
        contradicted: Those that have none here, though they would have been found.
    """

    kind: str
    look: Look
    support: tuple[Support, ...]
    claims: tuple[Situation, ...]
    situations: tuple[Situation, ...]
    counts: Counts
    queries: Queries
    confirmed: int = 0
    contradicted: int = 0

    @property
    def modes(self) -> bool:
        """Whether it has situations with several modes."""
        return self.counts.two_mode > 0

    def reach(self) -> tuple[Reach, ...]:
        """What it could look at in each fifth of the way."""
        return reaches(self.kind, self.queries.fifth, self.queries.analysed > 0)

    def row(self, *, followed: bool) -> Side:
        """A row of `sides.parquet`."""
        kept = summarise([item.identity for item in self.situations if item.two_mode])
        return Side(
            kind=self.kind,
            followed=followed,
            **asdict(self.counts),
            kept=kept.observed,
            kept_null_q95=kept.null_q95,
            kept_n=kept.n,
            confirmed=self.confirmed,
            contradicted=self.contradicted,
        )


def local_view(
    data: AuditInput,
    settings: AuditSettings,
    looks: tuple[Look, ...],
    support: tuple[Support, ...],
    *,
    admissible: Admissible | None,
    progress: Progress,
) -> View:
    """What the neighbours in every observation show."""
    look = foremost(looks)
    claims = examined(data, settings, look, admissible=admissible, progress=progress)
    return _view(data, settings, LOCAL, look, support=support, claims=claims)


def learned_view(
    data: AuditInput,
    settings: AuditSettings,
    local: View,
    *,
    admissible: Admissible | None,
    root_seed: int,
    progress: Progress,
) -> View:
    """What the neighbours in what predicts the action show, of the route alone."""
    several = [item for item in local.situations if item.two_mode]
    route = [item for item in several if item.component == POSITION]
    chosen = route[:: max(1, -(-len(route) // AGAIN))]
    again = {item.neighbourhood.query: item.clustering.separation for item in chosen}
    learned = find_learned(data, settings, root_seed, again=again, progress=progress)
    look = look_at_route(data, settings, learned.found, root_seed)
    claims = examined(data, settings, look, admissible=admissible, progress=progress)
    found = _view(data, settings, LEARNED, look, support=learned.support, claims=claims)
    return replace(found, confirmed=learned.confirmed, contradicted=learned.contradicted)


def chosen_view(views: Sequence[View]) -> View:
    """The one that all else is about: the first, unless only another shows modes."""
    return next((view for view in views if view.modes), views[0])


def examined(
    data: AuditInput,
    settings: AuditSettings,
    look: Look,
    *,
    admissible: Admissible | None,
    progress: Progress,
) -> tuple[Situation, ...]:
    """Every situation, looked at in turn; those of a claim are split into modes."""
    result: list[Situation] = []
    for number, entry in enumerate(look.found):
        item = look.claims.get(number)
        if item is None:
            item = examine(data, settings, entry, look.component, admissible=None, seed=None)
        elif admissible is not None:
            _, situation, split = entry
            chunks = compare(data, settings, situation, split, admissible=admissible)
            item = replace(item, chunks=chunks)
        result.append(item)
        progress("situations examined", number + 1, len(look.found))
    return tuple(result)


def _view(
    data: AuditInput,
    settings: AuditSettings,
    kind: str,
    look: Look,
    *,
    support: tuple[Support, ...],
    claims: tuple[Situation, ...],
) -> View:
    situations, incoherent = coherent(settings, claims)
    return View(
        kind=kind,
        look=look,
        support=support,
        claims=claims,
        situations=situations,
        counts=count(data, situations, support, incoherent),
        queries=queries_of(data, settings, claims, support),
    )
