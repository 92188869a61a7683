"""Limits of the cause: complete, with reasons, packaged as the ladder has them."""

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from planted import BROKEN, LIMITS, VALID, counts, learned, limit, named

from gates.cause import CauseLimits, limits_of
from gates.cause.limits import OWN, SHARED
from gates.need.gate import read_cause_limits
from genpolicy.audit.settings import AuditSettings
from genpolicy.errors import ConfigError

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("question", sorted(AuditSettings().floors))
def test_a_limit_below_what_the_audit_looked_for_is_refused(question):
    below = 0.5 * AuditSettings().floors[question]
    with pytest.raises(ConfigError, match=rf"limit of {question} is .*, expected at least"):
        named(VALID, limit(**{question: below}))


@pytest.mark.parametrize("question", sorted(AuditSettings().ceilings))
def test_a_limit_above_where_the_audit_takes_modes_back_is_refused(question):
    ceiling = AuditSettings().ceilings[question]
    assert LIMITS[question] <= ceiling
    with pytest.raises(ConfigError, match=rf"limit of {question} is .*, expected at most"):
        named(VALID, limit(**{question: 1.1 * ceiling}))


BORDERS = [(name, "floors", 1.0) for name in sorted(AuditSettings().floors)]
BORDERS += [(name, "ceilings", -1.0) for name in sorted(AuditSettings().ceilings)]


@pytest.mark.parametrize(("question", "kind", "inwards"), BORDERS)
def test_a_limit_may_be_where_the_audit_begins_but_for_rounding(question, kind, inwards):
    border = getattr(AuditSettings(), kind)[question]
    for away in (0.0, 1e-10, -1e-10):
        named(VALID, limit(**{question: border * (1.0 - inwards * away)}))
    with pytest.raises(ConfigError, match=f"limit of {question}"):
        named(VALID, limit(**{question: border * (1.0 - inwards * 1e-8)}))


def test_every_deviation_above_zero_that_is_looked_for_has_a_floor():
    # A finding is made beyond its floor only: without one a lower limit would be without effect.
    zero = {"clock_disorder", "swapped_columns"}
    assert all(LIMITS[question] == 0 for question in zero)
    assert set(AuditSettings().floors) >= _of_findings() - zero


class Watched(CauseLimits):
    """Notes which limits are asked for."""

    def __getitem__(self, question: str) -> float:
        ASKED.add(question)
        return super().__getitem__(question)


ASKED: set[str] = set()


def _of_findings() -> set[str]:
    """Questions that the layer of data semantics reports a deviation for."""
    sources = (ROOT / "genpolicy/audit/semantics").glob("*.py")
    words = set(re.findall(r'"(\w+)"', "".join(path.read_text() for path in sources)))
    return words & {*SHARED, *OWN}


def test_every_limit_is_asked_for_and_every_finding_has_one():
    watched = Watched(LIMITS.by_question, LIMITS.confidence)
    others = (
        counts(two_mode_episodes=0),
        counts(two_mode_episodes=0, noise_ratio=0.9, white_share=0.3),
        replace(VALID, **learned(contradicted=60)),
    )
    for numbers in (VALID, *others, *(item[0] for item in BROKEN.values())):
        named(numbers, watched, draws=[VALID] * 20)
    of_findings = _of_findings()
    assert {"clock_disorder", "gain_epoch_factor", "calibration_residual_m"} <= of_findings
    assert ASKED | of_findings == {*SHARED, *OWN}


def test_the_packaged_limits_are_those_of_the_ladder():
    ladder = read_cause_limits(ROOT / "params.yaml")
    assert _numbers(ladder) == _numbers(LIMITS)
    assert ladder.confidence == LIMITS.confidence
    assert not set(SHARED) & set(OWN)


def _numbers(limits):
    """Limit and owner by question; why a number is right for one task is not why for another."""
    return {name: (item.limit, item.owner) for name, item in limits.by_question.items()}


@pytest.mark.parametrize(
    ("cause", "match"),
    [({"model": {"noise": [1, "x"]}}, "a limit of no question"),
     ({"nobody": {}}, "no owner"), ({"model": {"noise_ratio": [1, ""]}}, "a number and a sentence"),
     ({"model": {"noise_ratio": [math.nan, "x"]}}, "a number and a sentence"),
     ({"model": {"noise_ratio": [True, "x"]}}, "a number and a sentence"),
     ({"model": {"noise_ratio": [math.inf, "x"]}}, "a number and a sentence"),
     ({"model": {"noise_ratio": [1, "x"]}, "safety": {"noise_ratio": [2, "y"]}}, "a second limit"),
     ({"model": [1]}, "no owner with questions"),
     ({}, "missing"), (None, "NoneType")],
)  # fmt: skip
def test_a_limit_without_reason_or_question_is_refused(cause, match):
    with pytest.raises(ConfigError, match=match):
        limits_of(cause, {}, confidence=0.95, where="params.yaml: gate_a.cause")


@pytest.mark.parametrize("question", SHARED)
def test_a_shared_question_that_is_waived_keeps_the_packaged_limit(question, tmp_path):
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    (owner,) = [o for o, entries in params["gate_a"]["limits"].items() if question in entries]
    del params["gate_a"]["limits"][owner][question]
    params["gate_a"]["not_applicable"] = {owner: {question: "nothing to hold it against"}}
    path = tmp_path / "params.yaml"
    path.write_text(yaml.safe_dump(params))
    limits = read_cause_limits(path)
    assert limits[question] == LIMITS[question]
    (limit, reason) = limits.as_json()[owner][question]
    assert limit == LIMITS[question] and reason.startswith("packaged")
    assert "nothing to hold it against" in reason
