"""What a person adds to the drafted card, asked one by one; nothing is answered for anybody.

Every answer is held against what signing and Gate E will ask, so that a wrong one is told while it
is being typed. A threshold may be lowered; what the draft fixes cannot be answered at all.
"""

import datetime
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gates.card.card import TrialCard, undrafted, validity
from gates.card.judge import CardGateSettings
from gates.card.people import (
    ALLOW_LIST,
    BE_AT_THE_STOP,
    BE_INDEPENDENT,
    BE_LISTED,
    REVIEWER,
    AllowList,
    dependence,
    load_allow_list,
    spotting,
)
from gates.card.signing import read_draft, require_no_rehearsal
from gates.floors import HARDEST_CONTACT_N
from gates.report import stage_of
from gates.settings import read_params, read_settings
from gates.stress.contact import untouched
from genpolicy.contract.names import says
from genpolicy.errors import ConfigError

NONCE_BYTES = 16
ABORT = "abort."
"""Prefix of an abort threshold among the answers."""
NOT_ASKED = "Leave it out: what is not asked is fixed by the draft, or drawn."
REDRAFT = "Complete section `card` of params.yaml, then draft again: `dvc repro card`."
NAME_AUTHORS = (
    f"Name who made the candidate in `params.yaml: card.authors`, by ids of {ALLOW_LIST}, have it "
    "reviewed and committed; then draft again: `dvc repro card`."
)
LIST_AUTHORS = (
    f"Have the entry of every author committed to {ALLOW_LIST}, in review; who does not belong "
    "there is taken from `params.yaml: card.authors`, and the card drafted again."
)
LOWER = "Give a number of that range; another limit is planned, and run, before."


@dataclass(frozen=True)
class Question:
    """One field that a person fills.

    Attributes:
        name: Field of the card, or `abort.<threshold>`.
        text: What is asked, with the unit.
        proposed: What Enter takes; None where there is no default, and must not be.
    """

    name: str
    text: str
    proposed: str | None = None


@dataclass(frozen=True)
class Rules:
    """What answers are held against.

    Attributes:
        draft: The drafted card.
        allowed: Who may sign.
        today: The day.
        maximum_days: Longest validity of a card.
    """

    draft: TrialCard
    allowed: AllowList
    today: datetime.date
    maximum_days: int


Check = Callable[[Rules, str, str, Mapping[str, Any]], Any]
"""Rules, name of the field, what was said, values of the fields before it: the value."""


def questions(rules: Rules) -> list[Question]:
    """What a person is asked, in the order of the card."""
    thresholds = [
        Question(
            f"{ABORT}{name}",
            f"abort the trial when {name} {rules.draft.abort_windows[name].over} exceeds; the "
            f"reports hold at most {value:g}",
            repr(value),
        )
        for name, value in sorted(rules.draft.abort_thresholds.items())
    ]
    unseen = untouched(rules.draft.caveats, rules.draft.candidate)
    said = f"; {unseen}: the evidence supports no force, so write why this one" if unseen else ""
    return [
        Question(
            "force_limit_n", f"contact force that ends the trial, N, up to {HARDEST_CONTACT_N:g}"
        ),
        Question(
            "force_limit_reason", f"where this force comes from, measured for this cell{said}"
        ),
        Question(
            "spotter",
            f"who stands at the stop, by the id on {ALLOW_LIST}; neither author nor reviewer",
        ),
        Question("stop_path", "how the robot is stopped, from hand to drive"),
        Question("reviewer", f"who reviews, by the id on {ALLOW_LIST}"),
        Question("not_before", "first day of validity, YYYY-MM-DD", rules.today.isoformat()),
        Question("expires", f"last day of validity, at most {rules.maximum_days} days in all"),
        *thresholds,
    ]


def filled(rules: Rules, answers: Mapping[str, str]) -> TrialCard:
    """The draft with what a person answered; a nonce is drawn.

    Raises:
        ConfigError: An answer to nothing that is asked, one that does not hold, or none at all
            where there is no default; a draft that nobody can complete.
    """
    require_fillable(rules)
    asked = {question.name: question for question in questions(rules)}
    if unknown := sorted(set(answers) - set(asked)):
        raise _refused(unknown[0], "not asked", f"one of {', '.join(asked)}", NOT_ASKED)
    values: dict[str, Any] = {"nonce": secrets.token_hex(NONCE_BYTES)}
    thresholds: dict[str, float] = {}
    for name, question in asked.items():
        said = answers.get(name, question.proposed)
        if said is None:
            raise _refused(
                name,
                "not answered",
                question.text,
                f"Give it with `--set {name}=…`, or answer at a terminal.",
            )
        value = answer(rules, name, said, values)
        if name.startswith(ABORT):
            thresholds[name.removeprefix(ABORT)] = value
        else:
            values[name] = value
    return rules.draft.model_copy(update={**values, "abort_thresholds": thresholds})


def require_fillable(rules: Rules) -> None:
    """Refuse a draft that no answers complete, before anybody is asked.

    Raises:
        ConfigError: A field is empty that the draft fixes, an author is not on the list, or nobody
            on it may review.
    """
    if lacking := undrafted(rules.draft):
        name = lacking[0]
        action = NAME_AUTHORS if name == "authors" else REDRAFT
        raise _refused(name, "empty in the draft", "what the ladder and params.yaml give", action)
    unknown = [name for name in rules.draft.authors if rules.allowed.find(name) is None]
    if unknown:
        raise _refused("authors", f"{unknown[0]!r}", f"ids of people on {ALLOW_LIST}", LIST_AUTHORS)
    people = [person.id for person in rules.allowed.people if person.role == REVIEWER]
    if not set(people) - set(rules.draft.authors):
        raise _refused(
            "reviewer",
            f"nobody: {ALLOW_LIST} lists no {REVIEWER} who did not make the candidate",
            f"at least one {REVIEWER} there",
            BE_LISTED,
        )


def answer(rules: Rules, name: str, said: str, before: Mapping[str, Any]) -> Any:
    """The value of one answer.

    Args:
        rules: What it is held against.
        name: The field.
        said: As typed.
        before: Values of the fields before it.

    Raises:
        ConfigError: It does not hold.
    """
    if name.startswith(ABORT):
        return _threshold(rules, name, said)
    check: Check = _CHECKS.get(name, _text)
    return check(rules, name, said.strip(), before)


def _threshold(rules: Rules, name: str, said: str) -> float:
    value, most = _number(name, said), rules.draft.abort_thresholds[name.removeprefix(ABORT)]
    if not 0 <= value <= most:
        raise _refused(name, said, f"0 to {most:g}: it may be lowered, never raised", LOWER)
    return value


def _force(rules: Rules, name: str, said: str, before: Mapping[str, Any]) -> float:
    value = _number(name, said)
    if not 0 < value <= HARDEST_CONTACT_N:
        raise _refused(
            name,
            said,
            f"above 0 and at most {HARDEST_CONTACT_N:g} N",
            "Give the force that was measured for this cell; harder contact no card allows.",
        )
    return value


def _reviewer(rules: Rules, name: str, said: str, before: Mapping[str, Any]) -> str:
    person = rules.allowed.find(said)
    if person is None or person.role != REVIEWER:
        raise _refused(name, repr(said), f"the id of a {REVIEWER} on {ALLOW_LIST}", BE_LISTED)
    if why := dependence(said, rules.draft.authors, [person], rules.allowed):
        raise _refused(name, why, "somebody who did not make the candidate", BE_INDEPENDENT)
    return said


def _spotter(rules: Rules, name: str, said: str, before: Mapping[str, Any]) -> str:
    """Nobody is named as reviewer yet; whoever has that role is told all the same."""
    if why := spotting(said, "", rules.draft.authors, rules.allowed):
        raise _refused(name, why, "somebody else who may stop the trial", BE_AT_THE_STOP)
    return said


def _first(rules: Rules, name: str, said: str, before: Mapping[str, Any]) -> str:
    return _valid(rules, name, said, (said, max(said, rules.today.isoformat())))


def _last(rules: Rules, name: str, said: str, before: Mapping[str, Any]) -> str:
    return _valid(rules, name, said, (str(before.get("not_before")), said))


def _valid(rules: Rules, name: str, said: str, days: tuple[str, str]) -> str:
    """A card of these days must be valid on the first of them that is not over."""
    card = rules.draft.model_copy(update={"not_before": days[0], "expires": days[1]})
    try:
        on = max(rules.today, datetime.date.fromisoformat(days[0]))
    except ValueError:
        on = rules.today
    valid, why = validity(card, today=on, maximum_days=rules.maximum_days)
    if not valid:
        raise _refused(
            name,
            f"{said!r} ({why})",
            "a day, YYYY-MM-DD, of a card that is valid",
            f"Give a day from {rules.today} on; at most {rules.maximum_days} in all.",
        )
    return said


def _text(rules: Rules, name: str, said: str, before: Mapping[str, Any]) -> str:
    if not says(said):
        raise _refused(
            name,
            repr(said),
            "words that a reader sees",
            "Write it out; spaces, dashes and characters without a shape say nothing.",
        )
    return said


_CHECKS: dict[str, Check] = {
    "force_limit_n": _force,
    "spotter": _spotter,
    "reviewer": _reviewer,
    "not_before": _first,
    "expires": _last,
}


def _number(name: str, said: str) -> float:
    try:
        return float(said)
    except ValueError:
        raise _refused(
            name, repr(said), "a number", "Write digits and a decimal point, without the unit."
        ) from None


def _refused(name: str, found: str, expected: str, action: str) -> ConfigError:
    return ConfigError(where=f"the card's {name}", found=found, expected=expected, action=action)


def rules_of(root: Path, today: datetime.date) -> Rules:
    """What answers are held against in a workspace.

    Raises:
        BadInputError: This is a rehearsal, of which no card can be signed; no draft, no allow-list,
            or section `gate_e` is wrong.
    """
    require_no_rehearsal(root)
    settings = read_settings(read_params(root), stage_of("E"), CardGateSettings)
    return Rules(read_draft(root), load_allow_list(root), today, settings.maximum_days)
