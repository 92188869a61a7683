"""What was made before of the same bytes: answers of criteria and figures of pages, given again.

So is what Gate B says of its two rules of training. All of them are functions of the files that
they read and of what else they are given. Most tests change one file of a whole ladder and judge or
print all of it, and what did not read that file is as it was. So within one process it is given
again where every file that it read has the same hash as then, the same files lie there, and those
of each training (which are found by pattern) are the same; where any differs, and in every test
that puts something else in the place of a function or a constant, it is made. A function that asks
for nothing and always answers the same is told apart by its code, so that what was made with it in
a place is given again where it stands there again.
`FRESH=1` makes everything always.
"""

import os
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from types import CodeType, FunctionType, ModuleType
from typing import Any, TypeVar

import pytest

from gates import engine
from gates.criterion import Criterion
from gates.evidence import Evidence
from gates.need.settings import TRAINED as BASELINES
from gates.pages.figures import Listing, Plot, Series
from gates.report import Answer, GateReport
from gates.reproducibility import gate as gate_b
from gates.reproducibility.convergence import has_training
from gates.reproducibility.matching import matched_by
from gates.reproducibility.settings import GENERATORS
from gates.settings import GateSettings, Limit
from genpolicy.integrity.hashing import sha256_file
from genpolicy.policies.validation_row import VALIDATION_FILE

Made = TypeVar("Made")
MISSING = ""
TRAINED = "/seed_"
"""In the names of files that some criteria find by pattern and do not name."""
BESIDE = (
    "gates.rederive.rederive", "gates.printed.", "gates.report.", "stages.",
    "genpolicy.candidates.judged.",
)  # fmt: skip
"""Whatever stands in the place of these, no criterion and no figure calls it, nor do they read the
environment."""
PICTURED = (Plot, Series, Listing)
_answer = engine._answer
_picture: dict[type, Callable[..., dict[str, Any]]] = {kind: kind.picture for kind in PICTURED}
_known: dict[Hashable, list[tuple[dict[str, str], Any]]] = {}
_replaced: list[object] = []
_fixed: list[tuple[ModuleType, str, CodeType]] = []
_said: dict[int, tuple[object, str]] = {}
_lying: list[tuple[Evidence, Hashable]] = []


@contextmanager
def nothing_made_twice() -> Iterator[None]:
    """Around one test."""
    if os.environ.get("FRESH"):
        yield
        return
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "_answer", answer)
        patch.setattr(gate_b, "matched_by", matched)
        for kind in PICTURED:
            patch.setattr(kind, "picture", picture)
        for name in ("setattr", "setitem"):
            patch.setattr(pytest.MonkeyPatch, name, _noting(getattr(pytest.MonkeyPatch, name)))
        forget()
        yield


def forget() -> None:
    """Nothing stands in the place of anything yet."""
    _replaced.clear()
    _fixed.clear()


def _noting(change: Callable[..., None]) -> Callable[..., None]:
    def noted(self: pytest.MonkeyPatch, target: Any, *others: Any, **named: Any) -> None:
        place = f"{target.__name__}." if isinstance(target, ModuleType) else str(target)
        code = _code_of_fixed(others[-1]) if isinstance(target, ModuleType) else None
        if code is not None:
            _fixed.append((target, others[0], code))
        elif not (target is os.environ or place.startswith(BESIDE)):
            _replaced.append(target)
        change(self, target, *others, **named)

    return noted


def _code_of_fixed(value: object) -> CodeType | None:
    """Of a function that reads no name of elsewhere, so that its code says what it answers."""
    if not isinstance(value, FunctionType) or value.__defaults__ or value.__kwdefaults__:
        return None
    code = value.__code__
    return None if code.co_names or code.co_freevars else code


def _in_place() -> Hashable | None:
    """The functions that answer in the place of others; none where one of them has gone since."""
    for module, name, code in _fixed:
        if getattr(getattr(module, name), "__code__", None) is not code:
            return None
    return tuple((module.__name__, name, code) for module, name, code in _fixed)


def answer(
    item: Criterion, evidence: Evidence, inputs: Any, limit: Limit | None, candidate: str | None
) -> Answer:
    """In the place of `gates.engine._answer`."""

    def measure() -> Answer:
        return _answer(item, evidence, inputs, limit, candidate)

    if not isinstance(inputs, GateSettings):
        return measure()
    return _again((item, _in_words(inputs), limit, candidate), evidence, measure)


def picture(plot: Any, evidence: Evidence, report: GateReport, salt: str) -> dict[str, Any]:
    """In the place of `picture` of what a page shows."""
    key = (plot, _in_words(report), salt)
    return _again(key, evidence, lambda: _picture[type(plot)](plot, evidence, report, salt))


def matched(
    evidence: Evidence,
    *,
    candidates: Sequence[str],
    baselines: Sequence[str],
    limit: float | None,
    confidence: float,
) -> list[str]:
    """In the place of `matched_by` where Gate B says what holds of both of its rules."""

    def say() -> list[str]:
        return matched_by(
            evidence, candidates=candidates, baselines=baselines, limit=limit,
            confidence=confidence,
        )  # fmt: skip

    key = (matched_by, tuple(candidates), tuple(baselines), limit, confidence)
    said = _again(key, evidence, say)
    if limit is None or any("not measured" in sentence for sentence in said):
        return say()  # it ended before it had bound all
    stages = {BASELINES: [name for name in baselines if has_training(evidence, name)]}
    for root, names in {**stages, GENERATORS: candidates}.items():
        for name in names:  # found by pattern, and so not among what was read
            folder = f"{root}/{name}/seed_*"
            evidence.bind(f"{folder}/{VALIDATION_FILE}", f"{folder}/model.safetensors")
    return list(said)


def _again(key: Hashable, evidence: Evidence, make: Callable[[], Made]) -> Made:
    fixed = None if _replaced else _in_place()
    if fixed is None or type(evidence) is not Evidence:  # another kind reads no files
        return make()
    known = _known.setdefault((key, fixed, lying(evidence)), [])
    for read, made in known:
        if all(_digest(evidence, name) == digest for name, digest in read.items()):
            evidence._touched |= dict.fromkeys(read)
            return made
    with evidence.recorded() as paths:
        found = make()
    known.append(({name: _digest(evidence, name) for name in paths}, found))
    return found


def lying(evidence: Evidence) -> Hashable:
    """Which files lie there, and the hashes of those of trainings; once for an evidence."""
    if not _lying or _lying[0][0] is not evidence:
        artifacts = evidence.root / "artifacts"
        files = [path for path in artifacts.rglob("*") if path.is_file()]
        names = sorted(path.relative_to(evidence.root).as_posix() for path in files)
        trained = tuple(sha256_file(evidence.root / name) for name in names if TRAINED in name)
        _lying[:] = [(evidence, (tuple(names), trained))]
    return _lying[0][1]


def _digest(evidence: Evidence, name: str) -> str:
    """Hash of a file as it is bound, by which it counts among the report's materials."""
    bound = name in evidence._materials or evidence.bind(name)
    return evidence._materials[name] if bound else MISSING


def _in_words(thing: Any) -> str:
    """All that settings or a report say, and the limits that a gate judges by."""
    kept = _said.get(id(thing))
    if kept is None or kept[0] is not thing:
        if len(_said) > 50:
            _said.clear()
        limits = getattr(thing, "_held_to", None)
        kept = _said[id(thing)] = (thing, f"{thing!r} {limits!r}")
    return kept[1]
