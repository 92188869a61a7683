"""Limits of the cause: complete, with reasons, packaged as the ladder has them."""

import math
import re
from pathlib import Path

import pytest
from planted import BROKEN, LIMITS, VALID, counts, limit, named

from gates.cause import (
    CauseLimits,
    limits_of,
)
from gates.cause.limits import OWN, SHARED
from gates.need.gate import read_cause_limits
from genpolicy.errors import ConfigError

ROOT = Path(__file__).parents[3]


def test_a_limit_below_what_the_audit_looked_for_is_refused():
    with pytest.raises(ConfigError, match=r"limit of clock_residual_s is 0\.005, expected at l"):
        named(VALID, limit(clock_residual_s=0.005))


class Watched(CauseLimits):
    """Notes which limits are asked for."""

    def __getitem__(self, question: str) -> float:
        ASKED.add(question)
        return super().__getitem__(question)


ASKED: set[str] = set()


def test_every_limit_is_asked_for_and_every_finding_has_one():
    watched = Watched(LIMITS.by_question)
    others = (counts(two_mode_episodes=0), counts(two_mode_episodes=0, noise_ratio=0.9))
    for numbers in (VALID, *others, *(item[0] for item in BROKEN.values())):
        named(numbers, watched)
    sources = (ROOT / "genpolicy/audit/semantics").glob("*.py")
    words = set(re.findall(r'"(\w+)"', "".join(path.read_text() for path in sources)))
    of_findings = words & {*SHARED, *OWN}
    assert {"clock_disorder", "gain_epoch_factor", "calibration_residual_m"} <= of_findings
    assert ASKED | of_findings == {*SHARED, *OWN}


def test_the_packaged_limits_are_those_of_the_ladder():
    ladder = read_cause_limits(ROOT / "params.yaml")
    assert ladder == LIMITS
    assert not set(SHARED) & set(OWN)


@pytest.mark.parametrize(
    ("cause", "match"),
    [({"model": {"noise": [1, "x"]}}, "a limit of no question"),
     ({"nobody": {}}, "no owner"), ({"model": {"noise_ratio": [1, ""]}}, "a number and a sentence"),
     ({"model": {"noise_ratio": [math.nan, "x"]}}, "a number and a sentence"),
     ({}, "missing"), (None, "NoneType")],
)  # fmt: skip
def test_a_limit_without_reason_or_question_is_refused(cause, match):
    with pytest.raises(ConfigError, match=match):
        limits_of(cause, {}, where="params.yaml: gate_a.cause")
