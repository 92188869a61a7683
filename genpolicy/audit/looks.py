"""Modes in every component of the action, and which component the audit then follows.

What follows (links, variables, outcomes, recovery) needs one set of clusters: those of the route
where it has modes, since they are the strategies that a mean collides with; else those of the
component with most situations of several modes. The others are counted and named beside it.
"""

from dataclasses import dataclass, replace

from genpolicy.audit.component_rows import POSITION, ComponentModes
from genpolicy.audit.components import NAMES, Component, components_of, stricter, vectors
from genpolicy.audit.data import AuditInput
from genpolicy.audit.modes import cluster, reach, smallest
from genpolicy.audit.persistence import persistent
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.situations import Found, Situation, claimed, coherent, episodes_of, examine


@dataclass(frozen=True)
class Look:
    """What was found in one component.

    Attributes:
        component: The component.
        found: Every situation with the clusters of this component; none where it was not looked at.
        claims: Situations whose clusters are claimed as modes, by position in `found`.
        kept: Positions of those whose phase keeps its modes.
    """

    component: Component
    found: list[Found]
    claims: dict[int, Situation]
    kept: frozenset[int]


def look_everywhere(
    data: AuditInput, settings: AuditSettings, found: list[Found], root_seed: int
) -> tuple[Look, ...]:
    """Every component in the order of its names.

    Args:
        data: Canonical audit input.
        settings: What counts as modes.
        found: Every situation with the clusters of its route.
        root_seed: Seed of all draws.
    """
    components = components_of(data, settings, [item.members for _, item, _ in found])
    return tuple(_look(data, settings, item, found, root_seed) for item in components)


def look_at_route(
    data: AuditInput, settings: AuditSettings, found: list[Found], root_seed: int
) -> Look:
    """The route alone, of situations that may differ in what is expected of other components."""
    component = components_of(data, settings, [item.members for _, item, _ in found])[0]
    return _look(data, settings, component, found, root_seed)


def foremost(looks: tuple[Look, ...]) -> Look:
    """The component that the audit follows; of equal ones the first."""
    route = looks[0]
    if route.kept:
        return route
    best = max(looks, key=lambda item: len(item.kept))
    return best if best.kept else max(looks, key=lambda item: len(item.claims))


def component_modes(
    data: AuditInput, looks: tuple[Look, ...], followed: str
) -> tuple[ComponentModes, ...]:
    """The numbers of every component."""
    rows = []
    for item in looks:
        kept = [item.claims[number] for number in sorted(item.kept)]
        about = item.component
        rows.append(
            ComponentModes(
                component=about.name,
                state=about.state,
                unit=about.unit,
                separation=about.separation,
                scale=about.scale,
                spread=about.spread,
                situations=len(item.found),
                clusters=sum(split.count > 1 for _, _, split in item.found),
                two_mode=len(kept),
                two_mode_episodes=episodes_of(data, [one.neighbourhood for one in kept]),
                incoherent=len(item.claims) - len(kept),
                persistent=sum(persistent(one.identity) for one in kept),
                followed=about.name == followed,
            )
        )
    return tuple(rows)


def claimed_episodes(
    data: AuditInput, settings: AuditSettings, component: Component, found: list[Found]
) -> int:
    """Held-out episodes of other data in which the component has several modes.

    Args:
        data: The data, or the same realigned or with other phases.
        settings: What counts as modes.
        component: What to look at, with the scale that it has in the data as they are.
        found: Situations with the clusters of their route.
    """
    if component.name != POSITION:
        signal = components_of(data, settings, [])[NAMES.index(component.name)].signal
        found, _ = _clustered(data, settings, replace(component, signal=signal), found)
    chosen = claimed(data, settings, found, component=component.name)
    return episodes_of(data, [found[number][1] for number in chosen])


def _look(
    data: AuditInput,
    settings: AuditSettings,
    component: Component,
    found: list[Found],
    root_seed: int,
) -> Look:
    if not component.looked_at:
        return Look(component, [], {}, frozenset())
    if component.name != POSITION:
        found, far = _clustered(data, settings, component, found)
        if not far:
            component = replace(component, state="hardly_varies")
    chosen = sorted(claimed(data, settings, found, component=component.name))
    claims = {
        number: examine(data, settings, found[number], component, admissible=None, seed=root_seed)
        for number in chosen
    }
    kept, _ = coherent(settings, tuple(claims.values()))
    good = {number for number, item in zip(claims, kept, strict=True) if item.two_mode}
    return Look(component, found, claims, frozenset(good))


def _clustered(
    data: AuditInput, settings: AuditSettings, component: Component, found: list[Found]
) -> tuple[list[Found], bool]:
    """The same situations with the clusters of another component, and whether any spreads far."""
    settings = stricter(settings)
    result: list[Found] = []
    far = False
    for phase, item, _ in found:
        part = vectors(data, settings, component, item.members)
        far = far or reach(part, smallest(settings, len(part))) - component.separation >= 0
        result.append((phase, item, cluster(part, settings, component.separation)))
    return result, far
