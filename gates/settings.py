"""What `params.yaml` says to a gate: limits by owner, what does not apply, and other settings.

```yaml
gate_a:
  limits:
    perception:
      clock_residual_s: [0.01, a fifth of an action period]
  not_applicable:
    perception:
      calibration_residual_m: this cell has no camera to calibrate
```

A number has one home. What another section says already is read from there (`GateSettings.homes`).
"""

import functools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, NoReturn, Self, TypeVar

import numpy as np
from pydantic import Field, PrivateAttr

from gates.criterion import Criterion
from gates.report import OWNERS, Gate, Owner, StrictModel, parse_section, stage_of
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.integrity.documents import parse_yaml
from genpolicy.integrity.hashing import sha256_bytes_of
from genpolicy.seeds import stream

PARAMS_FILE = "params.yaml"
DEEPEST = 30  # levels of `params.yaml`; it has six
DERIVED = "derived"
AND = " and "
"""Between two homes of one list."""
LIMITS, NOT_APPLICABLE = "limits", "not_applicable"


@dataclass(frozen=True)
class Limit:
    """A limit with the reason for it and the owner who answers for it; None is `derived`."""

    limit: float | None
    reason: str
    owner: Owner


@dataclass(frozen=True)
class Waiver:
    """Why a criterion does not apply here, and who says so."""

    reason: str
    owner: Owner


WAIVED = re.compile(
    r"\S+ (was not asked: the \w+ owner says|need not be asked of the data: the \w+ owner answers"
    r"|is unmatched evidence)"
)


def waived_criterion(name: str, waiver: Waiver) -> str:
    """What a report says of a criterion that was declared not applicable."""
    return (
        f"{name} was not asked: the {waiver.owner} owner says that it does not apply here "
        f"({waiver.reason})."
    )


def waived_question(name: str, waiver: Waiver) -> str:
    """What a report says of a question to the data that could not be asked."""
    return (
        f"{name} need not be asked of the data: the {waiver.owner} owner answers for it "
        f"({waiver.reason})."
    )


@dataclass(frozen=True)
class Limits:
    """The limits of a gate, by criterion, and the criteria that are declared not applicable.

    A rehearsal (`rehearsed`) asks nothing of these, whatever its evidence shows.
    """

    of: Mapping[str, Limit] = field(default_factory=dict)
    waived: Mapping[str, Waiver] = field(default_factory=dict)
    rehearsed: bool = False

    def number(self, criterion: str, *, otherwise: float) -> float:
        """The limit of a criterion; another number where it has none, or none of its own."""
        entry = self.of.get(criterion)
        return otherwise if entry is None or entry.limit is None else entry.limit


class GateSettings(StrictModel):
    """Base of a gate's settings other than limits.

    Attributes:
        homes: Where in `params.yaml` a field stands, if not in the gate's own section, as a dotted
            path. Of a mapping there, the names are taken, in their order; of two homes, those of
            both.
        whole: Fields that take such a mapping as it stands there.
    """

    homes: ClassVar[Mapping[str, str]] = {}
    whole: ClassVar[frozenset[str]] = frozenset()

    _held_to: Limits = PrivateAttr(default_factory=Limits)

    @property
    def limits(self) -> Limits:
        """Limits that the gate judges by, for a measure that must know those of other questions."""
        return self._held_to

    @property
    def caveats(self) -> tuple[str, ...]:
        """What the reader must know because of these settings."""
        return ()

    def excepted(self, criterion: str, candidate: str | None) -> bool:
        """Whether a criterion is not asked of a candidate, by a written exception."""
        return False

    def under(self, limits: Limits) -> Self:
        """The same settings, with the limits that the gate judges by."""
        settings = self.model_copy()
        settings._held_to = limits
        return settings


class CandidateSettings(GateSettings):
    """What every gate after training is told of the candidates, beside its own settings.

    Attributes:
        confidence: Coverage of every interval.
        candidates: Methods that stand for promotion; those that were brought behind the others.
        brought: Those of them that were not trained here.
        root_seed: Root of the named streams that intervals over clusters are drawn from.
    """

    homes: ClassVar[Mapping[str, str]] = {
        "root_seed": "seed",
        "confidence": "confidence",
        "candidates": f"train_generators.samplers{AND}candidates",
        "brought": "candidates",
    }

    confidence: float = Field(gt=0.5, lt=1.0)
    candidates: tuple[str, ...]
    brought: tuple[str, ...] = ()
    root_seed: int

    def draws(self, *names: str) -> np.random.Generator:
        """Generator of an interval, the same whenever and wherever the gate is judged."""
        return stream(self.root_seed, "gate", *names)


Settings = TypeVar("Settings", bound=StrictModel)


def read_params(root: Path, *, name: str = PARAMS_FILE) -> dict[str, Any]:
    """`params.yaml` (or a file of another name) below `root`, not yet checked by any model.

    Raises:
        ConfigError: Missing, malformed, or no mapping.
    """
    try:
        data = sha256_bytes_of(root / name, keep=True)[1]
    except IntegrityError as error:
        raise ConfigError(
            where=name,
            found=error.found,
            expected=error.expected,
            action="Restore the settings file.",
        ) from error
    document = _parsed(data)
    return document if isinstance(document, dict) else {}


@functools.lru_cache
def _parsed(data: bytes) -> Any:
    document = parse_yaml(data, where=PARAMS_FILE)
    require_plain(document, where=PARAMS_FILE)
    return document


def require_plain(document: Any, *, where: str, depth: int = 0) -> None:
    """Refuse what YAML can say and JSON cannot: it could be neither hashed nor compared.

    Raises:
        ConfigError: A date, bytes, a set, a number that is not finite, a key that is no text, or
            a value that holds itself.
    """
    if depth > DEEPEST:
        _refuse_plain(where, f"more than {DEEPEST} levels deep")
    if isinstance(document, dict):
        for key, value in document.items():
            if not isinstance(key, str):
                _refuse_plain(where, f"the key {key!r}")
            inside = f"{where}.{key}" if depth else f"{where}: {key}"
            require_plain(value, where=inside, depth=depth + 1)
    elif isinstance(document, list):
        for value in document:
            require_plain(value, where=where, depth=depth + 1)
    elif isinstance(document, float) and not math.isfinite(document):
        _refuse_plain(where, repr(document))
    elif not isinstance(document, str | int | float | None):
        _refuse_plain(where, f"a {type(document).__name__}")


def _refuse_plain(where: str, found: str) -> NoReturn:
    raise ConfigError(
        where=where,
        found=found,
        expected="plain values: texts, finite numbers, true, false, null, lists and mappings",
        action="Put a text into quotation marks, or correct the value.",
    )


def section_of(params: Mapping[str, Any], name: str) -> dict[str, Any]:
    """One section.

    Raises:
        ConfigError: It is missing.
    """
    section = params.get(name)
    if not isinstance(section, dict):
        _refuse(name, "missing", "a section of settings", "Add the section.")
    return dict(section)


def read_settings(params: Mapping[str, Any], name: str, model: type[Settings]) -> Settings:
    """Section `name` as its model; fields with a home elsewhere are read from there.

    Raises:
        ConfigError: Missing, an unknown key, a key that has its home elsewhere, or a wrong value.
    """
    own = section_of(params, name)
    values = {key: own[key] for key in own if key not in (LIMITS, NOT_APPLICABLE)}
    homes: Mapping[str, str] = getattr(model, "homes", {})
    for key, home in homes.items():
        if key in values:
            _refuse(f"{name}.{key}", "a second home", home, f"Remove it; `{home}` says it.")
        found = _at(params, home)
        names_only = isinstance(found, dict) and key not in getattr(model, "whole", ())
        values[key] = list(found) if names_only else found
    places = {key: f"{PARAMS_FILE}: {home}" for key, home in homes.items()}
    return parse_section(model, values, where=f"{PARAMS_FILE}: {name}", homes=places)


def _at(params: Mapping[str, Any], path: str) -> Any:
    if AND in path:
        return [name for part in path.split(AND) for name in _at(params, part)]
    value: Any = params
    for part in path.split("."):
        if not isinstance(value, dict) or part not in value:
            _refuse(path, "missing", "a setting", "Add it.")
        value = value[part]
    return value


def read_limits(params: Mapping[str, Any], gate: Gate, criteria: Sequence[Criterion]) -> Limits:
    """The limits of a gate and what it declares not applicable.

    Raises:
        ConfigError: An unknown criterion or owner, a criterion under two owners or both limited
            and not applicable, an empty reason, a limit that is no finite number, a `derived`
            one where none follows from the settings, or a waiver of what always applies.
    """
    section = section_of(params, stage_of(gate))
    known = {item.id: item for item in criteria}
    place = f"{stage_of(gate)}.{LIMITS}"
    limits: dict[str, Limit] = {}
    for owner, name, value in _by_owner(section, place, known):
        where = f"{place}.{owner}.{name}"
        _once(where, name in limits)
        limits[name] = _limit(value, owner, known[name], where)
    place = f"{stage_of(gate)}.{NOT_APPLICABLE}"
    waived: dict[str, Waiver] = {}
    for owner, name, value in _by_owner(section, place, known):
        where = f"{place}.{owner}.{name}"
        _once(where, name in limits or name in waived)
        if known[name].always:
            _refuse(where, "declared not applicable", "a limit", "It applies to every cell.")
        waived[name] = Waiver(_reason(value, where), owner)
    return Limits(limits, waived)


def _by_owner(
    section: Mapping[str, Any], place: str, known: Mapping[str, Criterion]
) -> Iterator[tuple[Owner, str, Any]]:
    for owner, entries in _mapping(section.get(place.split(".")[1]), place).items():
        if owner not in OWNERS:
            _refuse(f"{place}.{owner}", "no owner", f"one of {', '.join(OWNERS)}", "Correct it.")
        for name, value in _mapping(entries, f"{place}.{owner}").items():
            if name not in known:
                _refuse(
                    f"{place}.{owner}.{name}",
                    "a limit of no criterion",
                    f"one of {', '.join(sorted(known))}",
                    "Correct the name; a misspelt limit would judge nothing.",
                )
            yield owner, name, value


def _mapping(value: Any, where: str) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, dict):
        _refuse(where, type(value).__name__, "owners, and under each its criteria", "Correct it.")
    return value


def _once(where: str, again: bool) -> None:
    if again:
        _refuse(where, "a second entry", "one owner and one place", "Remove one of the two.")


def _limit(value: Any, owner: Owner, item: Criterion, where: str) -> Limit:
    if not isinstance(value, list) or len(value) != 2:
        _refuse(where, f"{value!r:.60}", "[limit, reason]", "Give both.")
    found, reason = value
    derives = item.derived is not None
    if derives != (found == DERIVED):
        expected = f"`{DERIVED}`, because it follows from settings" if derives else "a number"
        _refuse(where, f"{found!r:.60}", expected, "Correct the limit.")
    number = None if derives else parse_section(_Number, {"limit": found}, where=_full(where)).limit
    return Limit(number, _reason(reason, where), owner)


class _Number(StrictModel):
    limit: float


def _reason(value: Any, where: str) -> str:
    if not isinstance(value, str) or not value.strip():
        _refuse(where, f"{value!r} as reason", "a reason in words", "Say why.")
    return value


def _full(where: str) -> str:
    return f"{PARAMS_FILE}: {where}"


def _refuse(where: str, found: str, expected: str, action: str) -> NoReturn:
    raise ConfigError(where=_full(where), found=found, expected=expected, action=action)
