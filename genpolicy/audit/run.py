"""The whole audit: from rows to numbers, each kept as evidence. It measures and names no cause."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from genpolicy.audit.asked import Given, questions
from genpolicy.audit.component_rows import ComponentModes, Tremor
from genpolicy.audit.components import Component
from genpolicy.audit.data import AuditInput, Integers, canonical
from genpolicy.audit.documents import Counts, Persistence
from genpolicy.audit.labels import Replay, Replayed, mode_outcomes, replay_sample
from genpolicy.audit.linking import Memberships, alternatives, link
from genpolicy.audit.looks import (
    claimed_episodes,
    component_modes,
    look_everywhere,
)
from genpolicy.audit.mean_versus_modes import Admissible
from genpolicy.audit.modes import Clustering
from genpolicy.audit.neighbourhoods import Neighbourhood, Support
from genpolicy.audit.pairs import with_pairs
from genpolicy.audit.persistence import summarise
from genpolicy.audit.predictability import predictions
from genpolicy.audit.progress import Progress, silent
from genpolicy.audit.reach_rows import Alternative, FindingDraw, Reach, Side, StructureDraw
from genpolicy.audit.recovery import demonstrated, recovery_outcomes
from genpolicy.audit.resamples import Measures, resamples
from genpolicy.audit.rows import Asked, ModeOutcome, Prediction, RecoveryOutcome, Resample, Stratum
from genpolicy.audit.semantics import Semantics, measure, realigned
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.sides import View, chosen_view, learned_view, local_view
from genpolicy.audit.situations import (
    Several,
    Situation,
    by_phase,
    find_situations,
    primary_phase,
)
from genpolicy.audit.strata import examine_strata
from genpolicy.audit.structure_draws import finding_draws
from genpolicy.audit.tremor import tremors


@dataclass(frozen=True)
class AuditResult:
    """All evidence of one audit.

    Attributes:
        data: The input in canonical order.
        semantics: Clocks, calibration, drift.
        support: Queries and analysed situations per phase.
        situations: Every analysed situation, by phase and query row.
        persistence: Identity over time.
        modes: Outcome of each mode of each phase.
        links: Mode of each episode, -1 for none, per phase. Shape (E,).
        strata: Tests of recorded variables.
        told: What variables, order and past tell of the modes of held-out episodes.
        replayed: Labels against replay.
        recovery: The disturbed episodes.
        demonstrated: The mode that each episode followed in the primary phase, -1 for none.
            Shape (E,).
        asked: Which questions could be asked of the data.
        counts: Numbers for the summary.
        modes_after_realignment: Held-out episodes with two modes on realigned data.
        modes_other_phases: The same with the phase looked at the other way: across phases if the
            policy sees the phase, inside each if not; None with one phase only.
        resamples: The measures on resampled data.
        component: Component of the action whose modes all else is about.
        components: Modes in every component.
        alternatives: Modes that stand beside each other in a situation, in pairs.
        reach: What could be looked at in each fifth of the way, by both kinds of evidence.
        sides: What each of them found.
        structure_draws: Support and structure of each draw.
        finding_draws: Findings of halves of the episodes.
        tremors: White noise on single numbers of the action.
    """

    data: AuditInput
    semantics: Semantics
    support: tuple[Support, ...]
    situations: tuple[Situation, ...]
    persistence: Persistence
    modes: tuple[ModeOutcome, ...]
    links: dict[str, Integers]
    strata: tuple[Stratum, ...]
    told: tuple[Prediction, ...]
    replayed: tuple[Replayed, ...]
    recovery: tuple[RecoveryOutcome, ...]
    demonstrated: Integers
    asked: tuple[Asked, ...]
    counts: Counts
    modes_after_realignment: int
    modes_other_phases: int | None
    resamples: tuple[Resample, ...]
    component: Component
    components: tuple[ComponentModes, ...]
    alternatives: tuple[Alternative, ...] = ()
    reach: tuple[Reach, ...] = ()
    sides: tuple[Side, ...] = ()
    structure_draws: tuple[StructureDraw, ...] = ()
    finding_draws: tuple[FindingDraw, ...] = ()
    tremors: tuple[Tremor, ...] = ()

    @property
    def primary_phase(self) -> str:
        """The phase with most situations of several modes; empty where there is none."""
        return primary_phase(by_phase(self.situations))


def audit(
    data: AuditInput,
    settings: AuditSettings,
    *,
    admissible: Admissible | None,
    replay: Replay | None,
    root_seed: int,
    progress: Progress = silent,
) -> AuditResult:
    """Audit a dataset: the evidence, the same for every order of episodes.

    Args:
        data: Rows and episodes, in any order.
        settings: What counts as near, as two modes, and from where on deviations are reported.
        admissible: Feasibility of a chunk, as in `Admissible`; None leaves the columns empty.
        replay: Outcome of a replayed episode, by identifier; None leaves labels unproven.
        root_seed: Seed of all draws.
        progress: Called as `progress(what, done, total)` after every situation and replay.
    """
    data = canonical(data)
    semantics = measure(data, settings)
    shown, view = _views(
        data, settings, admissible=admissible, root_seed=root_seed, progress=progress
    )
    situations, component, counts = view.situations, view.look.component, view.counts
    several = by_phase(situations)
    replayed = replay_sample(data, settings, replay=replay, root_seed=root_seed, progress=progress)
    links = _links(data, settings, several)
    data = replace(data, variables=with_pairs(data, links, root_seed=root_seed))
    modes = _modes(data, situations, links, replayed)
    told = predictions(data, settings, several, links, root_seed=root_seed)
    given = Given(replays=len(replayed), feasibility=admissible is not None)
    strata = examine_strata(data, settings, several, links, root_seed=root_seed)
    primary = primary_phase(several)
    persistence = summarise([item.identity for item in situations if item.two_mode])
    main = several.get(primary, []), links.get(primary)
    measured = Measures(replayed, persistence, strata, told, _of_phase(modes, primary), counts)
    after = _after_realignment(data, settings, semantics, view, root_seed=root_seed)
    return AuditResult(
        data=data,
        semantics=semantics,
        support=view.support,
        situations=situations,
        persistence=persistence,
        modes=modes,
        links=links,
        strata=strata,
        told=told,
        asked=questions(data, settings, semantics, told, several, given=given),
        replayed=replayed,
        recovery=recovery_outcomes(data, settings, *main, component=component),
        demonstrated=demonstrated(data, settings, *main, component=component),
        counts=counts,
        modes_after_realignment=after,
        modes_other_phases=_other_phases(data, settings, component, root_seed),
        component=component,
        alternatives=_alternatives(data, several, links),
        **shown,
        **_draws(data, settings, measured, view, root_seed=root_seed),
    )


def _views(
    data: AuditInput,
    settings: AuditSettings,
    *,
    admissible: Admissible | None,
    root_seed: int,
    progress: Progress,
) -> tuple[dict[str, Any], View]:
    """What both kinds of evidence show, as fields of the result, and the one that is followed."""
    found, support = find_situations(data, settings, root_seed, progress=progress)
    looks = look_everywhere(data, settings, found, root_seed)
    local = local_view(data, settings, looks, support, admissible=admissible, progress=progress)
    learned = learned_view(
        data, settings, local, admissible=admissible, root_seed=root_seed, progress=progress
    )
    view = chosen_view((local, learned))
    seen = looks if view is local else (view.look, *looks[1:])
    return {
        "components": component_modes(data, seen, view.look.component.name),
        "reach": (*local.reach(), *learned.reach()),
        "sides": tuple(item.row(followed=item is view) for item in (local, learned)),
        "tremors": tremors(data, settings, _most(local, learned).situations),
    }, view


def _most(local: View, learned: View) -> View:
    """The kind of evidence that has more situations; of equal ones the neighbours."""
    return max((local, learned), key=lambda item: len(item.situations))


def _draws(
    data: AuditInput, settings: AuditSettings, measured: Measures, view: View, *, root_seed: int
) -> dict[str, Any]:
    """The measures on resampled data, as fields of the result."""
    halves, again = finding_draws(data, settings, root_seed=root_seed)
    measured = replace(measured, halves=halves)
    rows, structures = resamples(settings, measured, view.claims, view.queries, root_seed=root_seed)
    return {"resamples": rows, "structure_draws": structures, "finding_draws": again}


def _of_phase(modes: tuple[ModeOutcome, ...], phase: str) -> tuple[ModeOutcome, ...]:
    return tuple(mode for mode in modes if mode.phase == phase)


def _after_realignment(
    data: AuditInput,
    settings: AuditSettings,
    semantics: Semantics,
    view: View,
    *,
    root_seed: int,
) -> int:
    """Held-out episodes with several modes once every epoch is shifted by its measured offset."""
    shifted, moved = realigned(data, semantics)
    if not moved:
        return view.counts.two_mode_episodes
    found, _ = find_situations(shifted, settings, root_seed)
    return claimed_episodes(shifted, settings, view.look.component, found)


def _other_phases(
    data: AuditInput, settings: AuditSettings, component: Component, root_seed: int
) -> int | None:
    """The same count with the phase looked at the other way; None where there is only one phase.

    Across phases if the policy sees the phase, inside each phase if it does not: modes that are
    only there across phases are made by a phase that is not looked at.
    """
    if len(np.unique(data.phase)) < 2:
        return None
    other = replace(data, phase_observed=not data.phase_observed)
    found, _ = find_situations(other, settings, root_seed)
    return claimed_episodes(other, settings, component, found)


def _links(data: AuditInput, settings: AuditSettings, several: Several) -> dict[str, Integers]:
    """Modes followed over situations: the mode of each episode, per phase."""
    return {
        phase: link(_memberships(data, items), len(data.episodes), settings.minimum_neighbours // 2)
        for phase, items in sorted(several.items())
    }


def _memberships(
    data: AuditInput, items: Sequence[tuple[Neighbourhood, Clustering]]
) -> Memberships:
    return [(data.episode[item.members], split.labels) for item, split in items]


def _alternatives(
    data: AuditInput, several: Several, links: dict[str, Integers]
) -> tuple[Alternative, ...]:
    return tuple(
        Alternative(phase, f"m{mode}", f"m{other}", count)
        for phase, linked in links.items()
        for (mode, other), count in sorted(
            alternatives(_memberships(data, several[phase]), linked).items()
        )
    )


def _modes(
    data: AuditInput,
    situations: tuple[Situation, ...],
    links: dict[str, Integers],
    replayed: tuple[Replayed, ...],
) -> tuple[ModeOutcome, ...]:
    outcomes: list[ModeOutcome] = []
    for phase, linked in links.items():
        chosen = [item for item in situations if item.two_mode and item.phase == phase]
        outcomes += mode_outcomes(data, phase, linked, replayed, _checks(data, chosen, linked))
    return tuple(outcomes)


def _checks(
    data: AuditInput, situations: list[Situation], modes: Integers
) -> dict[int, tuple[int, int]]:
    """Admissible and checked modal chunks of each mode; a local mode counts for its majority."""
    result: dict[int, tuple[int, int]] = {}
    for item in situations:
        global_modes = modes[data.episode[item.neighbourhood.members]]
        for local, passed in enumerate(item.chunks.mode_admissible):
            members = global_modes[item.clustering.labels == local]
            members = members[members >= 0]
            if len(members):
                mode = int(np.argmax(np.bincount(members)))
                good, checked = result.get(mode, (0, 0))
                result[mode] = (good + int(passed), checked + 1)
    return result
