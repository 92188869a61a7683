"""Floors and ceilings of limits that protect people or the proof: fixed here, not in `params.yaml`.

`params.yaml` may be tighter. Looser is bad configuration, unless the ladder declares itself a
rehearsal (`rehearsal: true`): a test of the machinery, of which no card can ever be signed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gates.floors import BOUNDS, Bound
from gates.planned_settings import CAUSE
from gates.preregistration import at, by_criterion
from gates.report import Gate, stage_of
from gates.settings import DERIVED, LIMITS, NOT_APPLICABLE
from gates.severity import PLACE, too_mild
from genpolicy.errors import ConfigError

REHEARSAL = "rehearsal"
REHEARSED = "A rehearsal: limits that protect people may be looser here, and no card can be signed."
SHARED = ("confidence",)
"""Places that are settings of their own in `params.yaml`, and no criteria."""


@dataclass(frozen=True)
class Named:
    """What a list of a gate must name at least.

    Attributes:
        gate: Who judges by it.
        place: Setting in the gate's section; with a dot, from the top of the file. Of a mapping its
            keys are what it names, or the `kind` of an entry that says one.
        names: The names.
        reason: Why no team may leave one out, or name another.
        at_most: They are what it may name, in place of what it must.
    """

    gate: Gate
    place: str
    names: tuple[str, ...]
    reason: str
    at_most: bool = False


SIMPLER = "a simpler policy that is not asked is never found to be enough"
NAMED: tuple[Named, ...] = (
    Named("A", "remedies", ("chunked_l1", "bc_noise"), SIMPLER),
    Named("A", "factors", ("reference", "representation", "trunk", "head", "temporal"), SIMPLER),
    Named("A", "conditioning_factors", ("representation", "trunk"), SIMPLER),
    Named("A", "deployed_conventions", ("direct", "z_zero", "offset"), SIMPLER),
    Named("A", "chunked_baseline", ("chunked_bc",), SIMPLER, at_most=True),
    Named("A", "generative_baselines", ("ibc",), SIMPLER, at_most=True),
    Named(
        "C",
        "required_fixtures",
        ("stale_observation", "infeasible_rotation", "phase_change", "reordered_chunk"),
        "what is never tried is never refused",
    ),
    Named(
        "D",
        "stress.baselines",
        ("chunked_bc", "chunked_l1", "one_mode_bc", "bc_noise", "act"),
        SIMPLER,
    ),
    Named(
        "D",
        "stress.perturbations",
        (
            "nominal",
            "camera_delay",
            "compute_contention",
            "network_jitter",
            "queue_reorder",
            "envelope",
        ),
        "what was never injected was never withstood",
    ),
)
"""`collision` is not among them: a task may have nothing to collide with."""


def is_rehearsal(params: Mapping[str, Any]) -> bool:
    """Whether this ladder only tests the machinery.

    Raises:
        ConfigError: Neither true nor false.
    """
    value = params.get(REHEARSAL, False)
    if not isinstance(value, bool):
        raise ConfigError(
            where=f"params.yaml: {REHEARSAL}",
            found=f"{value!r:.60}",
            expected="true or false",
            action="Say which; only a ladder that is no rehearsal leads to a card.",
        )
    return value


def loosened(params: Mapping[str, Any], gate: Gate) -> list[tuple[Bound, Any]]:
    """Bounds that the settings of a gate go beyond, with what stands there instead.

    A criterion that is declared not applicable goes beyond its bound like any looser value, unless
    by these settings a task may lack what it asks about. A setting that is missing does not:
    without a limit no gate passes, and models ask for the rest.
    """
    found: list[tuple[Bound, Any]] = []
    for bound in BOUNDS:
        if bound.gate != gate:
            continue
        for value in _values(params, bound):
            if not _keeps(value, bound):
                found.append((bound, value))
    return found


def lacking(params: Mapping[str, Any], gate: Gate) -> list[tuple[Named, list[str]]]:
    """Lists of a gate that leave out what they must name, or name what they may not, with that.

    A list that is missing does neither: the gate's model asks for it, or its default names all.
    """
    found = []
    for named in NAMED:
        if named.gate != gate or (stated := _stated(params, named)) is None:
            continue
        inner, outer = (stated, named.names) if named.at_most else (named.names, stated)
        wrong = [str(name) for name in inner if name not in outer]
        if wrong:
            found.append((named, wrong))
    return found


def _stated(params: Mapping[str, Any], named: Named) -> list[Any] | None:
    """What a list names; None where it is not written."""
    value: Any = params
    places = named.place.split(".") if "." in named.place else [stage_of(named.gate), named.place]
    for part in places:
        if not isinstance(value, Mapping) or part not in value:
            return None
        value = value[part]
    if isinstance(value, Mapping):
        entries = value.items()
        return [e.get("kind", name) if isinstance(e, Mapping) else name for name, e in entries]
    return list(value) if isinstance(value, list | tuple) else [value]


def _keeps(value: object, bound: Bound) -> bool:
    """Whether a setting stays on its side of a bound; what is no number, or NaN, does not."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return value <= bound.bound if bound.comparison == "<=" else value >= bound.bound


def require_protection(params: Mapping[str, Any], gate: Gate) -> tuple[str, ...]:
    """Refuse settings that go beyond a bound.

    Disturbances that are too mild to be one are refused by Gate D likewise.

    Returns:
        Caveats for the report; empty unless this is a rehearsal.

    Raises:
        ConfigError: A looser setting, in a ladder that is no rehearsal.
    """
    beyond, absent = loosened(params, gate), lacking(params, gate)
    milder = too_mild(params) if gate == "D" else []
    if is_rehearsal(params):
        places = [*(bound.place for bound, _ in beyond), *(named.place for named, _ in absent)]
        names = ", ".join([*places, *(f"{PLACE}: {item.kind}" for item, _ in milder)])
        return (f"{REHEARSED} Looser: {names or 'none of this gate'}.",)
    for bound, value in beyond:
        raise ConfigError(
            where=f"params.yaml: {_place(gate, bound.place)}",
            found=f"{value!r:.60}",
            expected=f"{bound.comparison} {bound.bound:g}, because {bound.reason}",
            action="Tighten it. This bound stands in the code; a rehearsal may go beyond it.",
        )
    for named, wrong in absent:
        found = f"{'with' if named.at_most else 'without'} {', '.join(wrong)}"
        what = "nothing but" if named.at_most else "all that the code names:"
        raise ConfigError(
            where=f"params.yaml: {_place(gate, named.place)}",
            found=f"{found:.200}",
            expected=f"{what} {', '.join(named.names)}, because {named.reason}",
            action="Restore it. What it names stands in the code; a rehearsal may differ.",
        )
    for mildest, texts in milder:
        raise ConfigError(
            where=f"params.yaml: {PLACE}",
            found=f"{texts:.200}",
            expected=f"a condition of kind {mildest.kind} that hits: {mildest.reason}",
            action="Plan a harder one. The least stands in the code; a rehearsal may differ.",
        )
    return ()


def _place(gate: Gate, place: str) -> str:
    return place if "." in place else f"{stage_of(gate)}: {place}"


def _values(params: Mapping[str, Any], bound: Bound) -> list[Any]:
    """What `params.yaml` says at a place: nothing, one value, or those of several owners."""
    # Criteria are looked for among the limits alone: a section of that name would hide them.
    if "." in bound.place or bound.place in SHARED:
        value: Any = params
        *sections, name = bound.place.split(".")
        if sections[-1:] == [CAUSE]:
            stated = by_criterion(at(params, ".".join(sections)))
            return [stated[name]] if name in stated else []
        for part in (*sections, name):
            if not isinstance(value, Mapping) or part not in value:
                return []
            value = value[part]
        if bound.of is not None:
            return [bound.of(value)]
        return list(value.values()) if isinstance(value, Mapping) else [value]
    section = params.get(stage_of(bound.gate))
    if not isinstance(section, Mapping):
        return []
    found: list[Any] = []
    lacked = bound.waivable is not None and bound.waivable(params)
    places = [LIMITS] if lacked else [LIMITS, NOT_APPLICABLE]
    for part in places:
        owners = section.get(part)
        for entries in owners.values() if isinstance(owners, Mapping) else ():
            if isinstance(entries, Mapping) and bound.place in entries:
                entry = entries[bound.place]
                value = entry[0] if isinstance(entry, list) and entry else entry
                # What follows is held to the bound where it is derived. A reason may be that word.
                follows = bound.derives and part == LIMITS and value == DERIVED
                found.append(bound.bound if follows else value)
    return found
