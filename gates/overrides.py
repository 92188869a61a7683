"""Written exceptions to limits: who lets one be looser for a while, why, and until when.

They stand in `overrides.yaml`, apart from `params.yaml`: who commits to that made the yardstick,
and who overrides a limit for a candidate must not have made it. An exception names another limit,
not a verdict: beyond it fails, not measured stays so. None goes beyond `gates.floors`, ever.

What is said here is a function of files, without a clock. Whether the person may, and whether the
last day is over, ask those who act on a report (`gates.overriders`).
"""

import datetime
import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from gates.criterion import Criterion
from gates.floors import BOUNDS
from gates.planned_settings import AT_LEAST
from gates.preregistration import at, by_criterion
from gates.protection import is_rehearsal
from gates.report import (
    GATES,
    Answer,
    Comparison,
    Gate,
    Overridden,
    StrictModel,
    Verdict,
    parse_section,
    read_report,
    stage_of,
)
from gates.settings import DERIVED, LIMITS, NOT_APPLICABLE, Limits, require_plain
from gates.verdicts import at_most, combine, judge_criterion, margin
from genpolicy.contract.names import says
from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.integrity.documents import parse_yaml
from genpolicy.integrity.hashing import sha256_bytes_of

OVERRIDES, LISTED = "overrides.yaml", "overrides"
OVERRIDDEN = "OVERRIDDEN"
"""How every sentence about one begins, so that it is found and shown in red."""
NEEDED = ("gate", "criterion", "limit", "by", "reason", "expires")
CORRECT = f"Correct {OVERRIDES}, or remove the entry: then the limit counts."


class Override(StrictModel):
    """One entry of `overrides.yaml`.

    Attributes:
        gate: Whose limit it is.
        criterion: Of that gate.
        candidate: Of whom it is asked; None for the whole gate.
        limit: What stands in place of the limit of `params.yaml`.
        by: Who says so, by the identifier on `reviewers.yaml`.
        reason: Why.
        expires: Last day on which it holds, YYYY-MM-DD, UTC.
    """

    gate: Gate
    criterion: str
    candidate: str | None = None
    limit: float
    by: str
    reason: str
    expires: str


class Exceptions(NamedTuple):
    """What a gate is judged under.

    Attributes:
        own: Exceptions to its limits.
        below: What the gates below say of theirs.
    """

    own: tuple[Override, ...] = ()
    below: tuple[Overridden, ...] = ()


NOBODY = Exceptions()
"""Nobody overrides anything."""


class Ruled(NamedTuple):
    """A gate under its exceptions.

    Attributes:
        answers: With the verdicts that count.
        verdict: Of the gate.
        candidates: Verdict of each candidate.
        overrides: What was overridden, below too, and what would have been without.
    """

    answers: tuple[Answer, ...]
    verdict: Verdict
    candidates: dict[str, Verdict]
    overrides: tuple[Overridden, ...]


def placed(entry: Override | Overridden) -> str:
    """Which limit an entry overrides, for a message."""
    of = f" of {entry.candidate}" if entry.candidate else ""
    return f"{OVERRIDES}: {entry.criterion}{of} (gate {entry.gate})"


def read_overrides(root: Path, params: Mapping[str, Any]) -> tuple[Override, ...]:
    """Every exception that is written; none where the file is missing.

    A rehearsal takes the exceptions of the checkout that it rehearses, but for those to what it
    does not ask.

    Args:
        root: Repository root.
        params: `params.yaml`, whose limits they are held against.

    Raises:
        ConfigError: Malformed, without a name, a reason or a last day, of no limit, no looser
            than it, of one that follows from settings, or beyond what the code allows.
    """
    path = root / OVERRIDES
    if not path.exists() and not path.is_symlink():
        return ()
    try:
        found = entries_of(sha256_bytes_of(path, keep=True)[1])
    except IntegrityError as error:
        _refuse(OVERRIDES, error.found, error.expected, "Restore the file.")
    for number, entry in enumerate(found):
        if any(_key(entry) == _key(other) for other in found[:number]):
            _refuse(placed(entry), "overridden twice", "one entry", "Remove one of the two.")
    if is_rehearsal(params):
        waived = {gate: _written(params, gate, NOT_APPLICABLE) for gate in GATES}
        found = tuple(entry for entry in found if entry.criterion not in waived[entry.gate])
    for entry in found:
        _require_limit(entry, params)
    return found


@functools.lru_cache
def entries_of(data: bytes) -> tuple[Override, ...]:
    """Entries of the file, by their form alone: not yet held against any limit.

    Raises:
        ConfigError: No such file, or an entry that lacks something.
    """
    document = parse_yaml(data, where=OVERRIDES)
    require_plain(document, where=OVERRIDES)
    if document is None:
        return ()
    listed = document.get(LISTED) if isinstance(document, dict) else None
    if listed is None or list(document) != [LISTED] or not isinstance(listed, list):
        _refuse(OVERRIDES, f"{document!r:.60}", f"`{LISTED}`, and a list of entries", CORRECT)
    return tuple(_entry(item, number) for number, item in enumerate(listed, start=1))


def rule(
    exceptions: Exceptions,
    criteria: Sequence[Criterion],
    answers: Sequence[Answer],
    limits: Limits,
    *,
    candidates: bool,
    lacking: Sequence[str] = (),
) -> Ruled:
    """Verdicts of a gate under its exceptions, and what each of them changes.

    Args:
        exceptions: What it is judged under.
        criteria: What it asks.
        answers: By the limits of `params.yaml`.
        limits: Those limits.
        candidates: Whether the gate is about candidates.
        lacking: What no gate passes without, beside its criteria, with exceptions or without, and
            is not there.

    Raises:
        ConfigError: An exception names a candidate where the whole gate is asked, or none where
            each of them is.
    """
    each = {item.id: item.per_candidate for item in criteria}
    without = at_most(combine(answers, expects_candidates=candidates)[0], lacking)
    held, overrides = list(answers), list(exceptions.below)
    for entry in exceptions.own:
        if each.get(entry.criterion) != (entry.candidate is not None):
            found = f"of {entry.candidate}" if entry.candidate else "without a candidate"
            expected = "none: the whole gate is asked" if entry.candidate else "one candidate"
            _refuse(placed(entry), found, expected, CORRECT)
        own: Verdict | None = None
        instead: Verdict | None = None
        stated, comparison = limits.of[entry.criterion].limit, comparison_of(entry.criterion)
        threshold = entry.limit if stated is None else stated
        looser = (max if comparison == "<=" else min)(entry.limit, threshold)
        for number, answer in enumerate(answers):
            if (answer.id, answer.candidate) == (entry.criterion, entry.candidate):
                own, instead = answer.verdict, _looser(answer, looser)
                held[number] = answer.model_copy(update={"verdict": instead})
        overrides.append(
            Overridden(
                **{**entry.model_dump(), "limit": looser},
                comparison=comparison,
                threshold=threshold,
                verdict=own,
                instead=instead,
                without=without,
            )
        )
    verdict, verdicts = combine(held, expects_candidates=candidates)
    return Ruled(tuple(held), at_most(verdict, lacking), verdicts, tuple(overrides))


def exceptions_of(root: Path, params: Mapping[str, Any], gate: Gate) -> Exceptions:
    """What is overridden of a gate and below it.

    What gates below overrode stands in the report right below, which admission proves; each report
    repeats it, so that whoever reads the last one reads all. Of one that cannot be read nothing is.

    Raises:
        ConfigError: As `read_overrides`.
    """
    own = tuple(entry for entry in read_overrides(root, params) if entry.gate == gate)
    lower = GATES[: GATES.index(gate)]
    try:
        return Exceptions(own, read_report(root, lower[-1])[0].overrides if lower else ())
    except IntegrityError:
        return Exceptions(own)


def apart(decision: str) -> tuple[str, str]:
    """A decision without what is overridden, and that: empty where nothing is."""
    text, sign, rest = decision.partition(f"{OVERRIDDEN}:")
    return text.strip(), f"{sign}{rest}"


def is_said(caveat: str) -> bool:
    """Whether a caveat speaks of an exception, as `said` does."""
    return caveat.startswith(f"{OVERRIDDEN} ")


def said(entry: Overridden) -> str:
    """What every report says of an exception, in the same words."""
    of = f" of {entry.candidate}" if entry.candidate else ""
    text = (
        f"{OVERRIDDEN} at gate {entry.gate}: {entry.criterion}{of} is held to "
        f"{entry.comparison} {entry.limit:.6g} in place of {entry.comparison} "
        f"{entry.threshold:.6g}, by {entry.by} until {entry.expires} "
        f"({' '.join(entry.reason.split()).removesuffix('.')})."
    )
    if entry.verdict is None:
        return f"{text} It was not asked, so that this changes nothing."
    if entry.verdict == "PASS":
        return f"{text} It holds without."
    also = "" if entry.instead == "PASS" else f" Even so it is {entry.instead}."
    without = f"{entry.criterion} {entry.verdict}, gate {entry.gate} {entry.without}"
    return f"{text}{also} Without it: {without}."


def aside(overrides: Sequence[Overridden]) -> str:
    """Behind a decision: on whose word it stands; empty where every limit holds by itself."""
    broken = [entry for entry in overrides if entry.verdict not in (None, "PASS")]
    if not broken:
        return ""
    whose = ", ".join(f"{entry.criterion} by {entry.by}" for entry in broken)
    gates = ", ".join(dict.fromkeys(f"gate {one.gate} {one.without}" for one in broken))
    return f"{OVERRIDDEN}: {whose}; without, {gates}."


def comparison_of(criterion: str) -> Comparison:
    """How what is measured must stand to the limit of a criterion."""
    return ">=" if criterion in AT_LEAST else "<="


def _looser(answer: Answer, limit: float) -> Verdict:
    """By the looser limit; what holds by its own or waits for a person is not touched."""
    if answer.verdict in ("PASS", "PENDING_REVIEW"):
        return answer.verdict
    return judge_criterion(answer.measured, limit, answer.comparison, answer.interval)


def _key(entry: Override | Overridden) -> tuple[Gate, str, str | None]:
    return entry.gate, entry.criterion, entry.candidate


def _entry(item: Any, number: int) -> Override:
    where = f"{OVERRIDES}: entry {number}"
    if not isinstance(item, dict):
        _refuse(where, f"{item!r:.60}", f"{', '.join(NEEDED)}", CORRECT)
    if isinstance(item.get("criterion"), str):
        where = f"{where} ({item['criterion']:.60})"
    if lacking := [name for name in NEEDED if item.get(name) in (None, "")]:
        _refuse(where, f"without {', '.join(lacking)}", ", ".join(NEEDED), CORRECT)
    entry = parse_section(Override, item, where=where)
    for name, text in (("reason", entry.reason), ("by", entry.by)):
        if not says(text):
            _refuse(f"{where}: {name}", f"{text!r:.60}", "words that a reader sees", CORRECT)
    try:
        day = datetime.date.fromisoformat(entry.expires)
    except ValueError:
        day = None
    if day is None or day.isoformat() != entry.expires:
        _refuse(f"{where}: expires", f"{entry.expires!r:.60}", "a day, YYYY-MM-DD", CORRECT)
    return entry


def _require_limit(entry: Override, params: Mapping[str, Any]) -> None:
    """Require that an entry loosens a limit that counts, and not beyond what the code allows."""
    where = placed(entry)
    stated = _written(params, entry.gate, LIMITS)
    if entry.criterion not in stated:
        known = ", ".join(sorted(stated)) or "none"
        _refuse(where, "no criterion with a limit there", f"one of {known}", CORRECT)
    limit = stated[entry.criterion]
    if limit == DERIVED or not isinstance(limit, int | float) or isinstance(limit, bool):
        expected = "a limit that is a number of its own: this one follows from settings"
        _refuse(where, f"an exception to {limit!r:.20}", expected, CORRECT)
    candidates = _candidates(params)
    if entry.candidate is not None and entry.candidate not in candidates:
        known = ", ".join(sorted(candidates)) or "none"
        _refuse(where, "nobody who stands for promotion", f"one of {known}", CORRECT)
    comparison = comparison_of(entry.criterion)
    for bound in BOUNDS:
        if (bound.gate, bound.place) != (entry.gate, entry.criterion):
            continue
        if not margin(entry.limit, bound.bound, bound.comparison) >= 0:
            _refuse(
                where,
                f"{entry.limit:g}",
                f"{bound.comparison} {bound.bound:g}, because {bound.reason}",
                "This bound stands in the code, and nobody overrides it. Remove the entry.",
            )
    # A rehearsal may have looser limits; the looser of the two counts there.
    if margin(entry.limit, limit, comparison) >= 0 and not is_rehearsal(params):
        side = "above" if comparison == "<=" else "below"
        _refuse(where, f"{entry.limit:g}", f"a number {side} the limit {limit:g}", CORRECT)


def _written(params: Mapping[str, Any], gate: Gate, kind: str) -> dict[str, Any]:
    """Limits of a gate as written, or what is not applicable, by criterion."""
    return by_criterion(at(params, f"{stage_of(gate)}.{kind}"))


def _candidates(params: Mapping[str, Any]) -> set[str]:
    """Who stands for promotion: trained here, or brought."""
    trained = params.get("train_generators")
    samplers = trained.get("samplers") if isinstance(trained, Mapping) else None
    return {str(name) for found in (samplers, params.get("candidates")) for name in found or ()}


def _refuse(where: str, found: str, expected: str, action: str) -> NoReturn:
    raise ConfigError(where=where, found=found, expected=expected, action=action)
