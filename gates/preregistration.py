"""The plan that was written down before the evidence: limits, margin, alpha, starts, conditions.

`genpolicy gates preregister` writes `preregistration.yaml` from `params.yaml`; it is committed
before the evidence exists. Gates D and E bind it by hash and say what has moved since: loosened
apart from tightened, and apart from what is neither.
"""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import yaml

from gates.report import GATES, stage_of
from genpolicy.errors import GenpolicyError
from genpolicy.integrity.documents import parse_yaml
from genpolicy.integrity.hashing import sha256_bytes_of

PREREGISTRATION = "preregistration.yaml"
NONE = f"Nothing was planned in writing: {PREREGISTRATION} is missing or malformed."
PLANNED: Mapping[str, str] = {
    "seed": "",
    "policy.seeds": "",
    "train_generators.samplers": "",
    "confidence": ">=",
    "stress.starts": ">=",
    "stress.margin": ">=",
    "stress.alpha": "<=",
    "stress.planned_effect": "",
    "stress.baselines": "",
    "stress.perturbations": "",
    "stress.episode_limit_s": "",
    "stress.samples": "",
}
"""What the plan names beside limits, and on which side it is strict; '' where neither is."""
HEAD = (
    "# Written by `genpolicy gates preregister`. Commit it before the evidence exists; what moves\n"
    "# afterwards shows in the reports of gates D and E and on the card.\n"
)
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


def plan_of(
    params: Mapping[str, Any], comparisons: Mapping[str, Mapping[str, str]]
) -> dict[str, list[Any]]:
    """By place: on which side it is strict, and its value.

    Args:
        params: `params.yaml`.
        comparisons: By section of a gate, and by criterion: `<=` or `>=`.
    """
    found: dict[str, list[Any]] = {}
    for place, comparison in PLANNED.items():
        found[place] = [comparison, _at(params, place)]
    for gate in GATES:
        name = stage_of(gate)
        for criterion, value in _limits(params, name).items():
            found[f"{name}.{criterion}"] = [comparisons.get(name, {}).get(criterion, ""), value]
    return found


def plan_bytes(params: Mapping[str, Any], comparisons: Mapping[str, Mapping[str, str]]) -> bytes:
    """The file that `preregister` writes."""
    text = yaml.safe_dump(plan_of(params, comparisons), sort_keys=False, default_flow_style=None)
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

    A limit that was dropped is loosened, a new one tightened.
    """
    limits = {
        f"{stage_of(g)}.{n}": v for g in GATES for n, v in _limits(params, stage_of(g)).items()
    }
    now = {**{place: _at(params, place) for place in PLANNED}, **limits}
    found = []
    for place, (comparison, before) in plan.items():
        if place not in now:
            found.append(Move(place, before, None, "loosened"))
        elif now[place] != before:
            found.append(Move(place, before, now[place], _kind(comparison, before, now[place])))
    found += [Move(place, None, now[place], "tightened") for place in now if place not in plan]
    return found


def moved_caveats(root: Path, params: Mapping[str, Any]) -> tuple[str, ...]:
    """What a report says of the plan: nothing if all is as planned."""
    plan = read_plan(root)
    if plan is None:
        return (NONE,)
    found = moves(plan, params)
    texts = []
    for kind in KINDS:
        of_kind = [str(move) for move in found if move.kind == kind]
        if of_kind:
            texts.append(f"{kind.capitalize()} since {PREREGISTRATION}: {', '.join(of_kind)}.")
    return tuple(texts)


@functools.lru_cache(maxsize=4)
def _parsed(data: bytes) -> Any:
    return parse_yaml(data, where=PREREGISTRATION)


def _kind(comparison: str, before: object, now: object) -> Kind:
    if comparison and _is_number(before) and _is_number(now):
        tighter = now < before if comparison == "<=" else now > before  # type: ignore[operator]
        return "tightened" if tighter else "loosened"
    return "changed"


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _limits(params: Mapping[str, Any], section: str) -> dict[str, Any]:
    limits = _at(params, f"{section}.limits")
    found: dict[str, Any] = {}
    for entries in limits.values() if isinstance(limits, Mapping) else ():
        for name, entry in entries.items() if isinstance(entries, Mapping) else ():
            found[name] = entry[0] if isinstance(entry, list) and entry else entry
    return found


def _at(params: Mapping[str, Any], place: str) -> Any:
    value: Any = params
    for part in place.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return value


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 60 else f"{text[:59]}…"
