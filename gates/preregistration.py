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
from typing import Any, Literal

import yaml

from gates.planned_settings import (
    AT_LEAST,
    CAUSE,
    CAUSE_STRICT,
    COSTS,
    IF_STATED,
    OPEN,
    PLANNED,
    SECTIONS,
    SECTIONS_STRICT,
    STATED,
)
from gates.report import GATES, Gate, stage_of
from genpolicy.errors import GenpolicyError
from genpolicy.integrity.documents import parse_yaml
from genpolicy.integrity.hashing import sha256_bytes_of

PREREGISTRATION = "preregistration.yaml"
NONE = f"Nothing was planned in writing: {PREREGISTRATION} is missing or malformed."


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
    part, _, item = name.partition(".")
    if part == CAUSE:
        return CAUSE_STRICT.get(item, "")
    if part == COSTS:
        return ""
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
    """As `_kind`; of what may differ or is excepted, more entries are looser and fewer tighter."""
    if place not in OPEN or not all(isinstance(value, list | dict) for value in (before, now)):
        return _kind(_side(place), before, now)
    keys, ours = _entries(before), _entries(now)
    return "loosened" if ours > keys else "tightened" if ours < keys else "changed"


def _entries(listed: Any) -> set[str]:
    """What an exception is for: its key, or the first item of an entry of a list."""
    if isinstance(listed, dict):
        return set(map(str, listed))
    return {str(one[:1]) for one in listed if isinstance(one, list)}


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
    section, _, name = place.partition(".")
    free = section in SECTIONS or place in IF_STATED or name.startswith(f"{COSTS}.")
    return "changed" if free else kind


def _strict(place: str) -> str:
    above = (name for name in SECTIONS_STRICT if f"{place}.".startswith(f"{name}."))
    return SECTIONS_STRICT.get(next(above, ""), "")


def _all_settings(params: Mapping[str, Any]) -> dict[str, Any]:
    """Every setting of the sections that the plan names whole, by its place."""
    each = (_leaves(name, params.get(name, {})) for name in SECTIONS)
    named = tuple(f"{place}." for place in STATED)
    return {
        place: value
        for found in each
        for place, value in found.items()
        if not f"{place}.".startswith(named)
    }


def _leaves(place: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        return {place: value}
    found: dict[str, Any] = {}
    for name, inner in value.items():
        found |= _leaves(f"{place}.{name}", inner)
    return found


def _all_limits(params: Mapping[str, Any]) -> dict[str, Any]:
    """Every limit of a criterion, of the cause and each cost of a monitor, by its place."""
    found: dict[str, Any] = {}
    for name in map(stage_of, GATES):
        for part, before in (("limits", ""), (CAUSE, f"{CAUSE}."), (COSTS, f"{COSTS}.")):
            stated = by_criterion(at(params, f"{name}.{part}"))
            found |= {f"{name}.{before}{item}": value for item, value in stated.items()}
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
