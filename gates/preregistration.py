"""The plan that was written down before the evidence: limits, margin, alpha, starts, conditions.

`genpolicy gates preregister` writes `preregistration.yaml` from `params.yaml`; it is committed
before the evidence exists. Every gate says what has moved since of what it and the gates below it
judge by: loosened apart from tightened, and apart from what is neither. Gates D and E bind the file
by hash; in the materials of a gate below, a plan that moves would train again behind it.
"""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import yaml

from gates.may_differ import PLACE
from gates.report import GATES, Gate, stage_of
from genpolicy.errors import GenpolicyError
from genpolicy.integrity.documents import parse_yaml
from genpolicy.integrity.hashing import sha256_bytes_of

PREREGISTRATION = "preregistration.yaml"
NONE = f"Nothing was planned in writing: {PREREGISTRATION} is missing or malformed."


class Planned(NamedTuple):
    """A setting of the plan beside limits.

    Attributes:
        strict: On which side it is strict, `<=` or `>=`; '' where neither is.
        gate: The lowest gate that judges by it, or whose evidence is made with it.
    """

    strict: str
    gate: Gate


PLANNED: Mapping[str, Planned] = {
    "seed": Planned("", "A"),
    "record.episodes": Planned(">=", "A"),
    "record.shares": Planned("", "A"),
    "ingest.train": Planned("", "A"),
    "ingest.validation": Planned("", "A"),
    "policy.seeds": Planned("", "A"),
    "policy.network": Planned("", "A"),
    "policy.training.updates": Planned("", "A"),
    "policy.training.batch_size": Planned("", "A"),
    PLACE: Planned("", "A"),
    "train_generators.samplers": Planned("", "B"),
    "candidates": Planned("", "B"),
    "confidence": Planned(">=", "A"),
    "gate_a.held_out_splits": Planned("", "A"),
    "gate_a.deployed_conventions": Planned("", "A"),
    "gate_a.generative_baselines": Planned("", "A"),
    "gate_a.chunked_baseline": Planned("", "A"),
    "gate_a.remedies": Planned("", "A"),
    "gate_a.one_mode": Planned("", "A"),
    "gate_a.conditioning_factors": Planned("", "A"),
    "policy.fixtures": Planned(">=", "B"),
    "latency.warm": Planned(">=", "B"),
    "latency.cold": Planned(">=", "B"),
    "latency.declared": Planned("", "B"),
    "reload.samples": Planned(">=", "B"),
    "gate_b.budget_reference": Planned("", "B"),
    "gate_b.mode_minimum_share": Planned(">=", "B"),
    "gate_c.required_fixtures": Planned("", "C"),
    "gate_c.mode_observations": Planned(">=", "C"),
    "shadow.observations": Planned(">=", "C"),
    "stress.starts": Planned(">=", "D"),
    "stress.margin": Planned(">=", "D"),
    "stress.alpha": Planned("<=", "D"),
    "stress.planned_effect": Planned("", "D"),
    "stress.baselines": Planned("", "B"),
    "stress.perturbations": Planned("", "D"),
    "stress.episode_limit_s": Planned("", "D"),
    "stress.samples": Planned("", "A"),
    "stress.joining": Planned("", "B"),
    "stress.person": Planned("", "D"),
    "gate_d.tolerances": Planned("", "D"),
    "gate_e.maximum_days": Planned("<=", "E"),
}
"""What the plan names beside limits."""
IF_STATED: Mapping[str, Planned] = {
    "gate_a.factors": Planned("", "A"),
    "gate_a.waived_checks": Planned("", "A"),
    "gate_d.utility": Planned("", "D"),
}
"""What it names only where it is stated; older plans ask every factor and compare success."""
STATED: Mapping[str, Planned] = {**PLANNED, **IF_STATED}
SECTIONS: Mapping[str, Gate] = {
    "horizons": "A",
    "feasibility": "A",
    "audit": "A",
    "train_baselines": "A",
    "measure_baselines": "A",
    "train_factors": "A",
    "measure_factors": "A",
    "execution": "C",
    "shadow": "C",
}
"""Sections of which the plan names every setting, and the lowest gate whose evidence reads them."""
SECTIONS_STRICT: Mapping[str, str] = {
    **dict.fromkeys(
        (
            "feasibility.position_change_limit_m", "execution.deadline_s", "execution.watchdog_s",
            "execution.maximum_age_s", "execution.maximum_divergence_m",
            "execution.maximum_scene_shift_m", "execution.force_limit_n",
        ), "<=",
    ),
    **dict.fromkeys(("measure_baselines.samples", "measure_factors.samples"), ">="),
}  # fmt: skip
"""On which side their settings are strict, those of each phase alike; others on neither."""
CAUSE = "cause"
CAUSE_STRICT: Mapping[str, str] = {
    **dict.fromkeys(
        (
            "clock_disorder", "rate_deviation", "gap_share", "frozen_s", "jitter_share",
            "lag_drift_rows", "gain_factor", "gain_epoch_factor", "magnitude_factor",
            "frame_angle_rad", "swapped_columns", "faulty_episodes_share",
        ),
        "<=",
    ),
    **dict.fromkeys(("supported_episodes", "supported_share", "denial_share"), ">="),
}  # fmt: skip
"""On which side a limit of the cause is strict; of those left out, each side accepts something."""
AT_LEAST = frozenset(
    (
        "held_out_situations", "multimodal_situations", "persistence_margin", "mode_success_lower",
        "mode_feasible_share", "mean_defeated_share", "cause_accepted", "mode_coverage_lower",
        "admissible_share", "corrupted_refused_share", "verdict_reachable",
        "nominal_success_lower", "stress_success_lower", "recovery_success_lower",
        "promotion_e_value", "upstream_passed", "signature_valid", "reviewer_independent",
        "owners_signed", "not_expired",
    )
)  # fmt: skip
"""Criteria that may not be lower than their limit, all others not higher; who edits the plan
would edit what counts as looser, were it read from there."""
HEAD = """\
# Written by `genpolicy gates preregister`. Commit it before the evidence exists; what moves
# afterwards shows in the report of every gate that judges by it and on the card.
"""
Kind = Literal["loosened", "tightened", "changed"]
KINDS: tuple[Kind, ...] = ("loosened", "tightened", "changed")


@dataclass(frozen=True)
class Move:
    """A setting that is no longer as planned."""

    place: str
    before: object
    now: object
    kind: Kind

    def __str__(self) -> str:
        """Place, and from what to what."""
        return f"{self.place} ({_short(self.before)} -> {_short(self.now)})"


def plan_of(params: Mapping[str, Any]) -> dict[str, list[Any]]:
    """By place: on which side it is strict (`<=`, `>=`, or '' for neither), and its value."""
    return {place: [_side(place), value] for place, value in _now(params).items()}


def plan_bytes(params: Mapping[str, Any]) -> bytes:
    """The file that `preregister` writes."""
    text = yaml.safe_dump(plan_of(params), sort_keys=False, default_flow_style=None)
    return (HEAD + text).encode()


def read_plan(root: Path) -> dict[str, list[Any]] | None:
    """The plan; None if there is none that can be read."""
    try:
        data = sha256_bytes_of(root / PREREGISTRATION, keep=True)[1]
        plan = _parsed(data)
    except GenpolicyError:
        return None
    good = isinstance(plan, dict) and all(
        isinstance(entry, list) and len(entry) == 2 and entry[0] in ("", "<=", ">=")
        for entry in plan.values()
    )
    return plan if good and set(PLANNED) <= set(plan) else None


def moves(plan: Mapping[str, Sequence[Any]], params: Mapping[str, Any]) -> list[Move]:
    """What differs from the plan now, in the order of the plan.

    A limit that was dropped is loosened. What the plan does not name was added since, or struck
    out of the plan: it changed. So did what the plan calls strict on another side than the code.
    """
    now = _now(params)
    found = []
    for place, (stated, before) in plan.items():
        side = _side(place)
        if place not in now:
            found.append(Move(place, before, None, _of_section(place, "loosened")))
        elif stated != side:
            found.append(Move(place, f"{stated} {before}", f"{side} {now[place]}", "changed"))
        elif now[place] != before:
            found.append(Move(place, before, now[place], _kind_at(place, before, now[place])))
    return found + [Move(p, None, now[p], "changed") for p in now if p not in plan]


def _now(params: Mapping[str, Any]) -> dict[str, Any]:
    """All that a plan names, by its place."""
    planned = {place: at(params, place) for place in PLANNED}
    planned |= {place: found for place in IF_STATED if (found := at(params, place))}
    return {**planned, **_all_settings(params), **_all_limits(params)}


def _side(place: str) -> str:
    """On which side a setting is strict; '' where neither is."""
    if stated := STATED.get(place):
        return stated.strict
    section, _, name = place.partition(".")
    if section in SECTIONS:
        return _strict(place)
    if name.startswith(f"{CAUSE}."):
        return CAUSE_STRICT.get(name.partition(".")[2], "")
    return ">=" if name in AT_LEAST else "<="


def asked_by(place: str) -> Gate:
    """The lowest gate that a setting of the plan matters to; the first for what nobody knows."""
    if stated := STATED.get(place):
        return stated.gate
    section = place.partition(".")[0]
    return next((gate for gate in GATES if stage_of(gate) == section), SECTIONS.get(section, "A"))


def moved_caveats(root: Path, params: Mapping[str, Any], gate: Gate) -> tuple[str, ...]:
    """What the report of a gate says of the plan: nothing if all that it stands on is as planned.

    Args:
        root: Repository root.
        params: `params.yaml`.
        gate: Left out is what only gates above it judge by.

    Returns:
        A sentence for each kind; what was loosened furthest is named first.
    """
    plan = read_plan(root)
    if plan is None:
        return (NONE,)
    reached = GATES[: GATES.index(gate) + 1]
    found = [move for move in moves(plan, params) if asked_by(move.place) in reached]
    texts = []
    for kind in KINDS:
        of_kind = [move for move in found if move.kind == kind]
        if kind == "loosened":
            of_kind.sort(key=_how_far, reverse=True)
        if of_kind:
            listed = ", ".join(map(str, of_kind))
            texts.append(f"{kind.capitalize()} since {PREREGISTRATION}: {listed}.")
    return tuple(texts)


@functools.lru_cache
def _parsed(data: bytes) -> Any:
    return parse_yaml(data, where=PREREGISTRATION)


def _kind_at(place: str, before: object, now: object) -> Kind:
    """As `_kind`; of what may differ, more settings are looser and fewer tighter."""
    if place != PLACE or not (isinstance(before, list) and isinstance(now, list)):
        return _kind(_side(place), before, now)
    keys, ours = (
        {str(one[:1]) for one in listed if isinstance(one, list)} for listed in (before, now)
    )
    return "loosened" if ours > keys else "tightened" if ours < keys else "changed"


def _kind(comparison: str, before: object, now: object) -> Kind:
    if comparison and _is_number(before) and _is_number(now):
        tighter = now < before if comparison == "<=" else now > before  # type: ignore[operator]
        return "tightened" if tighter else "loosened"
    return "changed"


def _how_far(move: Move) -> float:
    """By which share of itself a limit moved; without end of none, and of one that was dropped."""
    ends = [float(end) for end in (move.before, move.now) if _is_number(end)]  # type: ignore[arg-type]
    if len(ends) < 2 or ends[0] == 0:
        return math.inf
    return abs(ends[1] - ends[0]) / abs(ends[0])


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _of_section(place: str, kind: Kind) -> Kind:
    """Of a limit the kind; a setting that came or went has a default on no known side."""
    return "changed" if place.partition(".")[0] in SECTIONS or place in IF_STATED else kind


def _strict(place: str) -> str:
    above = (name for name in SECTIONS_STRICT if f"{place}.".startswith(f"{name}."))
    return SECTIONS_STRICT.get(next(above, ""), "")


def _all_settings(params: Mapping[str, Any]) -> dict[str, Any]:
    """Every setting of the sections that the plan names whole, by its place."""
    each = (_leaves(name, params.get(name, {})) for name in SECTIONS)
    return {place: value for found in each for place, value in found.items()}


def _leaves(place: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        return {place: value}
    found: dict[str, Any] = {}
    for name, inner in value.items():
        found |= _leaves(f"{place}.{name}", inner)
    return found


def _all_limits(params: Mapping[str, Any]) -> dict[str, Any]:
    """Every limit of a criterion, and of the cause that Gate A judges by, by its place."""
    found: dict[str, Any] = {}
    for name in map(stage_of, GATES):
        stated = by_criterion(at(params, f"{name}.limits"))
        found |= {f"{name}.{item}": value for item, value in stated.items()}
        cause = by_criterion(at(params, f"{name}.{CAUSE}"))
        found |= {f"{name}.{CAUSE}.{item}": value for item, value in cause.items()}
    return found


def by_criterion(limits: Any) -> dict[str, Any]:
    """Limits as written, or what is not applicable, by criterion; they stand below their owners."""
    found: dict[str, Any] = {}
    for entries in limits.values() if isinstance(limits, Mapping) else ():
        for name, entry in entries.items() if isinstance(entries, Mapping) else ():
            found[name] = entry[0] if isinstance(entry, list) and entry else entry
    return found


def at(params: Mapping[str, Any], place: str) -> Any:
    """What stands in settings at a place with dots; None where nothing does."""
    value: Any = params
    for part in place.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return value


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 60 else f"{text[:59]}…"
