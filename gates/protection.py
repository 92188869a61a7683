"""Floors and ceilings of limits that protect people or the proof: fixed here, not in `params.yaml`.

`params.yaml` may be tighter. Looser is bad configuration, unless the ladder declares itself a
rehearsal (`rehearsal: true`): a test of the machinery, of which no card can ever be signed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from gates.report import Gate, stage_of
from gates.severity import PLACE, too_mild
from genpolicy.errors import ConfigError

REHEARSAL = "rehearsal"
REHEARSED = "A rehearsal: limits that protect people may be looser here, and no card can be signed."


@dataclass(frozen=True)
class Bound:
    """How loose a setting may be at most.

    Attributes:
        gate: Who judges by it.
        place: Criterion of that gate, or dotted path in `params.yaml`, of a table each value.
        comparison: The setting must be `<=` or `>=` the bound.
        bound: The loosest value.
        reason: Why no team may go beyond it.
        waivable: Whether a task may lack what the criterion asks about, so that its owner may
            declare it not applicable.
    """

    gate: Gate
    place: str
    comparison: Literal["<=", ">="]
    bound: float
    reason: str
    waivable: bool = False


HARDEST_CONTACT_N = 80.0
"""Force of the hardest contact that is simulated, N: nobody has seen a stop beyond it."""


def _counts(gate: Gate, reason: str, *criteria: str) -> list[Bound]:
    return [Bound(gate, name, "<=", 0.0, reason) for name in criteria]


def _executed(gate: Gate) -> list[Bound]:
    """Fixtures of the simulated cell that stop what went wrong, and what makes a chunk void."""
    silence = "a stub that goes on in silence executes what nobody commands any more"
    force = "the hardest contact that is simulated; beyond it no stop would ever be seen"
    return [
        Bound(gate, "execution.watchdog_s", "<=", 0.1, silence),
        Bound(gate, "execution.force_limit_n", "<=", HARDEST_CONTACT_N, force),
        Bound(gate, "execution.maximum_age_s", "<=", 1.0, "a second ago the scene was another one"),
        Bound(gate, "execution.maximum_divergence_m", "<=", 0.2, "the arm is where nobody planned"),
        Bound(gate, "feasibility.position_change_limit_m", "<=", 0.1, "a chunk bent so far is new"),
    ]


SHARED = ("confidence",)
"""Places that are settings of their own in `params.yaml`, and no criteria."""
FOUND = "refused_recordings_accounted"
PINNED = "what comes back otherwise than it was judged is another policy"
BOUNDS: tuple[Bound, ...] = (
    *_counts("A", "whoever trains on a defect of the data learns it", "data_defects"),
    *_counts("A", "a recording that vanished may be the one that fails", FOUND),
    *_counts("A", "a comparison with other settings compares nothing", "baselines_matched"),
    Bound("A", "cause_accepted", ">=", 1.0, "modes of another cause are no reason for a generator"),
    *_counts("B", PINNED, "unpinned_items", "metadata_mismatches", "nfe_mismatch"),
    *_counts("B", "a NaN weight commands nothing that can be checked", "nonfinite_weights"),
    *_counts("B", "numbers that mean something else command something else", "conformance"),
    Bound("B", "samples_difference", "<=", 1e-5, f"{PINNED}; so much differs between machines"),
    *_executed("C"),
    Bound("C", "gate_c.mode_observations", ">=", 30, "fewer cannot show that modes fare alike"),
    *_counts("C", PINNED, "changed_answers"),
    *_counts("C", "one bad action is enough to hurt somebody", "stub_stale", "stub_invalid"),
    *_counts("C", "the independent proof agrees or there is none", "checker_violations"),
    *_counts("C", "a check whose absence goes unseen protects nobody", "mutants_undetected"),
    *_counts("C", "an action that vanished may still be executed", "conservation_error"),
    *_counts("C", "what is void already may hurt somebody", "incidents_miscounted"),
    Bound("C", "corrupted_refused_share", ">=", 1.0, "corrupted input is never executed"),
    Bound("C", "stub_violation_upper", "<=", 0.01, "more says nothing although none was seen"),
    *_counts("D", PINNED, "changed_answers"),
    *_counts("D", "one bad action is enough to hurt somebody", "stub_violations"),
    *_counts("D", "the independent proof agrees or there is none", "checker_violations"),
    *_counts("D", "an action that vanished may still be executed", "conservation_error"),
    *_counts("D", "methods on other starts are not compared", "unmatched_starts"),
    *_executed("D"),
    Bound(
        "D",
        "force_peak_p95_n",
        "<=",
        HARDEST_CONTACT_N,
        "the hardest contact that is simulated",
        True,
    ),
    Bound("D", "deadline_miss_upper", "<=", 0.5, "late more often than not, it controls nothing"),
    Bound("D", "hold_share_upper", "<=", 0.5, "it stands more than it acts"),
    Bound("D", "fallback_share_upper", "<=", 0.5, "the fallback drives, not the policy"),
    Bound("D", "stress_success_lower", ">=", 0.05, "what never works under stress withstood none"),
    Bound("D", "intervention_upper", "<=", 0.2, "more often a person drives, not the policy"),
    Bound("D", "reset_upper", "<=", 0.1, "each protective stop sends a person to the arm"),
    Bound("D", "verdict_reachable", ">=", 0.8, "a trial that seldom ends right proves nothing"),
    Bound("D", "stress.starts", ">=", 59, "fewer bound no p95, whatever the confidence"),
    Bound("D", "confidence", ">=", 0.9, "what is wrong more often than once in ten is no bound"),
    Bound("D", "stress.alpha", "<=", 0.1, "a wrong promotion once in ten trials at the most"),
    Bound("D", "stress.margin", ">=", 0.0, "a candidate that is worse is not promoted"),
    Bound(
        "D",
        "stress.perturbations.envelope.speed_limit_m_s",
        "<=",
        0.25,
        "reduced speed with a person near the arm, ISO 10218-1",
    ),
    Bound("E", "gate_e.maximum_days", "<=", 30.0, "cell, people and policy change; review again"),
    Bound("E", "upstream_passed", ">=", 1.0, "a card stands on gates A to D"),
    Bound("E", "draft_complete", "<=", 0.0, "an empty field is an unanswered question"),
    Bound("E", "signature_valid", ">=", 1.0, "an unsigned card allows nothing"),
    Bound("E", "reviewer_independent", ">=", 1.0, "nobody reviews their own candidate"),
    Bound("E", "owners_signed", ">=", 4.0, "each of the four answers for a part"),
    Bound("E", "envelope_within_limits", "<=", 0.0, "what was not simulated is not allowed"),
    Bound("E", "not_expired", ">=", 1.0, "a review ages"),
)


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
        ("nominal", "camera_delay", "compute_contention", "network_jitter", "queue_reorder"),
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
    a task may lack what it asks about. A setting that is missing does not: without a limit no gate
    passes, and models ask for the rest.
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
        for part in bound.place.split("."):
            if not isinstance(value, Mapping) or part not in value:
                return []
            value = value[part]
        return list(value.values()) if isinstance(value, Mapping) else [value]
    section = params.get(stage_of(bound.gate))
    if not isinstance(section, Mapping):
        return []
    found: list[Any] = []
    places = ["limits"] if bound.waivable else ["limits", "not_applicable"]
    for owners in map(section.get, places):
        for entries in owners.values() if isinstance(owners, Mapping) else ():
            if isinstance(entries, Mapping) and bound.place in entries:
                entry = entries[bound.place]
                found.append(entry[0] if isinstance(entry, list) and entry else entry)
    return found
