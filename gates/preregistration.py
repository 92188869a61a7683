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
CAUSE = "cause"
CAUSE_STRICT: Mapping[str, str] = {
    **dict.fromkeys(
        (
            "clock_disorder", "rate_deviation", "gap_share", "frozen_s", "jitter_share",
            "lag_drift_steps", "gain_factor", "gain_epoch_factor", "magnitude_factor",
            "frame_angle_rad", "swapped_columns", "faulty_episodes_share",
        ),
        "<=",
    ),
    **dict.fromkeys(("supported_episodes", "supported_share", "denial_share"), ">="),
}  # fmt: skip
"""On which side a limit of the cause is strict; of those left out, each side accepts something."""
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
    strict = {
        f"{name}.{item}": side for name in comparisons for item, side in comparisons[name].items()
    }
    strict |= {f"{stage_of('A')}.{CAUSE}.{item}": side for item, side in CAUSE_STRICT.items()}
    found |= {place: [strict.get(place, ""), value] for place, value in _all_limits(params).items()}
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
    now = {**{place: _at(params, place) for place in PLANNED}, **_all_limits(params)}
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


def _all_limits(params: Mapping[str, Any]) -> dict[str, Any]:
    """Every limit of a criterion, and of the cause that Gate A judges by, by its place."""
    found: dict[str, Any] = {}
    for name in map(stage_of, GATES):
        found |= {f"{name}.{item}": v for item, v in _limits(_at(params, f"{name}.limits")).items()}
        cause = _limits(_at(params, f"{name}.{CAUSE}"))
        found |= {f"{name}.{CAUSE}.{item}": value for item, value in cause.items()}
    return found


def _limits(limits: Any) -> dict[str, Any]:
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
