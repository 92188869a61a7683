"""What a cause says to a person, whole: worlds with one thing wrong each, and their golden texts.

Made by the code of decision 156 and read through then, sentence by sentence; a test holds what is
said now to it. After a change that is meant: `python tests/gates/cause/golden_causes.py`, and read
the difference.
"""

import json
from dataclasses import replace
from pathlib import Path

from planted import BROKEN, HIDDEN, OFFSET, TOLD, VALID, component, counts, learned, named

from gates.cause import Cause
from gates.cause.numbers import Kept, Labels, Numbers, Residual
from genpolicy.audit.reach_rows import Alternative
from genpolicy.audit.rows import ModeOutcome
from genpolicy.audit.variable import INSIDE

FILE = Path(__file__).with_name("golden_causes.json")
ABSENT = {"two_mode_episodes": 0, "two_mode": 0, "persistent": 0}
WHITE = {"noise_ratio": 0.9, "noise_spread": 0.01, "white_share": 0.3}
THIN = counts(**ABSENT, analysed=0, analysed_episodes=0)
HIDDEN = replace(HIDDEN, effect_upper=0.9)


def _reach(*shares: float) -> Numbers:
    rows = zip(VALID.reach, shares, strict=True)
    found = tuple(replace(row, queries=100, spoke=round(100 * share)) for row, share in rows)
    return replace(counts(**ABSENT), reach=found)


def _component(name: str, **changes: object) -> tuple:
    return tuple(replace(c, **changes) if c.component == name else c for c in VALID.components)


def _strata(**changes: object) -> Numbers:
    return replace(VALID, strata=(replace(HIDDEN, **changes),))


def _told(*rows: tuple[str, float, float], **changes: object) -> Numbers:
    told = (
        replace(TOLD, variable=v, told=t, told_lower=t - h, told_upper=t + h, **changes)
        for v, t, h in rows
    )
    return replace(VALID, told=tuple(told))


def _modes(*outcomes: tuple[int, int], pairs: tuple[tuple[int, int], ...] = ((0, 1),)) -> Numbers:
    """Modes by (successes, episodes), and which of them stand beside each other."""
    modes = tuple(
        ModeOutcome(f"m{k}", "approach", n, good, 0.0, 1.0, 19, 20)
        for k, (good, n) in enumerate(outcomes)
    )
    beside = tuple(Alternative("approach", f"m{a}", f"m{b}", 9) for a, b in pairs)
    return replace(VALID, modes=modes, alternatives=beside)


_FOUR = ((0, 1), (2, 3), (4, 5), (6, 7))
_POOLED = ((12, 12), (9, 10)) * 4
_CALIBRATION = replace(OFFSET, question="calibration_residual_m", kind="calibration", unit="m")
_BLOCKED = replace(VALID.modes[1], admissible=20)
WORLDS: dict[str, Numbers] = {
    **{f"broken in {layer}": numbers for layer, (numbers, _, _) in BROKEN.items()},
    "two findings, one harmless": replace(
        VALID, findings=(replace(OFFSET, measured=0.009, variable="camera"), OFFSET)
    ),
    "lengths in pixels": replace(
        VALID, metre=1000.0, unit="px", findings=(replace(_CALIBRATION, measured=9.0),),
        residuals={"clock_residual_s": Residual(0.004)},
    ),
    "residuals known, beyond and unknown": replace(
        VALID, residuals={"clock_residual_s": Residual(0.5),
                          "calibration_residual_m": Residual(None, "not measured")},
    ),
    "a residual that keeps its limit": replace(
        VALID, metre=1000.0, unit="px", residuals={"calibration_residual_m": Residual(1.5)}
    ),
    "no replay": replace(VALID, labels=Labels(0, 0)),
    "few replays": replace(VALID, labels=Labels(10, 0)),
    "few episodes": counts(analysed_episodes=19),
    "few situations": counts(analysed=99),
    "a small share of situations": counts(queries=2000),
    "few near, the other kind speaks": replace(THIN, **learned()),
    "few of both kinds": replace(THIN, **learned(spoke=0.1)),
    "the other kind has modes": replace(counts(**ABSENT), **learned(modes=40)),
    "the other kind contradicts": replace(VALID, **learned(confirmed=2, contradicted=60)),
    "the other kind denies what is thin here": replace(
        _reach(0.3, 0.4, 0.6, 0.9, 1.0), **learned()
    ),
    "crowded at the end": _reach(0.3, 0.4, 0.6, 0.9, 1.0),
    "too few situations to deny": counts(**ABSENT, queries=500),
    "one action": counts(**ABSENT),
    "one action, the observation decides": counts(**ABSENT, resolved=4),
    "one action where it could not be read": replace(
        counts(**ABSENT), components=_component("rotation", state="unreadable", situations=0)
    ),
    "nothing varies": replace(
        counts(**ABSENT),
        components=tuple(replace(c, state="hardly_varies") for c in VALID.components),
    ),
    "one component varies, another is missing": replace(
        counts(**ABSENT),
        components=(component("position", followed=True), component("rotation", state="absent")),
    ),
    "few clusters": counts(two_mode=27, two_mode_episodes=9, persistent=0, primary_episodes=48),
    "clusters that fall apart": counts(**ABSENT, incoherent=120),
    "white": counts(**ABSENT, **WHITE),
    "modes that do not persist": replace(VALID, kept=Kept(0.62, 0.6, 118)),
    "too short to see modes persist": replace(VALID, kept=Kept(0.95, 0.6, 29)),
    "few modes that persist": counts(persistent=29),
    "nothing to keep": replace(VALID, kept=Kept(0.0, 0.0, 0)),
    "few modes, and an episode tells them": replace(
        VALID, kept=Kept(0.95, 0.6, 29), strata=(HIDDEN,)
    ),
    "modes of the gripper too": replace(
        VALID, components=_component("gripper", state="varies", two_mode=60, two_mode_episodes=30)
    ),
    "a seen variable": _strata(observed=True, detail="of the frame"),
    "an epoch": _strata(variable="calibration_epoch"),
    "a sequence as it was recorded": _strata(variable="recording_sequence"),
    "a sequence as it was stored": _strata(variable="recording_sequence", detail="by file"),
    "the past": _strata(variable="history", detail="x at first"),
    "inside an episode": _strata(variable="subtask", detail=INSIDE),
    "a large share by luck": _strata(effect_lower=0.05),
    "a small share that is sure": _strata(effect=0.2, effect_lower=0.15, effect_upper=0.25),
    "told for sure": _told(("operator", 0.61, 0.1), ("previous_episodes", 0.2, 0.15)),
    "told by the epoch": _told(("calibration_epoch", 0.7, 0.1)),
    "told by the past": _told(("history", 0.7, 0.1)),
    "told perhaps": _told(("operator", 0.45, 0.1)),
    "told by no more than a guess": _told(("operator", 0.0, 0.1), ("object", -0.1, 0.1)),
    "nothing to tell": replace(VALID, told=(), strata=()),
    "one mode": replace(VALID, modes=VALID.modes[:1], alternatives=()),
    "modes never side by side": replace(VALID, alternatives=()),
    "no outcome": _modes((0, 0), (0, 0)),
    "one mode fails": _modes((38, 40), (8, 40)),
    "a mode that is not feasible": replace(VALID, modes=(VALID.modes[0], _BLOCKED)),
    "too few outcomes": _modes((7, 8), (9, 9)),
    "all starts together": _modes(*_POOLED, pairs=_FOUR),
    "a third mode beside the choice": _modes((39, 40), (40, 40), (2, 40), pairs=((0, 1), (1, 2))),
}  # fmt: skip
DRAWS: dict[str, list[Numbers]] = {
    "draws agree": [VALID] * 3 + [BROKEN["hidden"][0]],
    "draws contradict": [VALID] * 2 + [BROKEN["hidden"][0]] * 2 + [BROKEN["data"][0]] * 3
    + [BROKEN["support"][0]],
}  # fmt: skip


def said(cause: Cause) -> dict:
    """All that is said, numbers to nine digits."""
    answers = [
        [a.question, a.what, _plain(a.measured), _plain(a.limit), a.comparison, a.unit, a.note,
         a.interval and [_plain(end) for end in a.interval], a.topic.value]
        for a in cause.answers
    ]  # fmt: skip
    return {
        "name": cause.name.value, "variable": cause.variable, "kind": cause.kind,
        "topic": cause.topic.value, "text": cause.text, "next_action": cause.next_action,
        "confidence": _plain(cause.confidence), "agreeing": list(cause.agreeing),
        "found": list(cause.found), "answers": answers,
    }  # fmt: skip


def _plain(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.9g}")


def whole() -> dict[str, dict]:
    """What is said of each world; of all but the first only what is said otherwise there."""
    first = said(named(VALID))
    found = {"as it is": first}
    causes = {name: named(numbers) for name, numbers in WORLDS.items()}
    causes |= {name: named(VALID, draws=draws) for name, draws in DRAWS.items()}
    for name, cause in causes.items():
        other = said(cause)
        answers = other.pop("answers")
        known = first["answers"]
        found[name] = {key: value for key, value in other.items() if value != first[key]} | {
            "answers": [answer for answer in answers if answer not in known],
            "left out": [answer[1] for answer in known if answer not in answers],
        }
    return found


def written() -> str:
    """The file: a line for each value of a list, so that a difference can be read."""
    worlds = [
        f" {_line(name)}: {{\n"
        + ",\n".join(f"  {_line(key)}: {_lines(value)}" for key, value in told.items())
        + "}"
        for name, told in whole().items()
    ]
    return "{\n" + ",\n".join(worlds) + "}\n"


def _lines(value: object) -> str:
    several = isinstance(value, list) and len(value) > 1
    return "[\n   " + ",\n   ".join(map(_line, value)) + "]" if several else _line(value)


def _line(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)


if __name__ == "__main__":
    FILE.write_text(written())
