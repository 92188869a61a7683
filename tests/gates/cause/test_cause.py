"""The cause from numbers alone: first red layer first, one limit each, NaN never holds."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from gates.cause import (
    Cause,
    CauseLimits,
    CauseName,
    Layer,
    default_limits,
    limits_of,
    name_cause,
)
from gates.cause.limits import OWN, SHARED
from gates.cause.numbers import Counts, Finding, Kept, Labels, Mode, Numbers, Stratum
from gates.need.gate import read_cause_limits
from genpolicy.audit.settings import AuditSettings
from genpolicy.errors import ConfigError

ROOT = Path(__file__).parents[3]
LIMITS = default_limits()
STRATUM = Stratum("operator", "approach", 0.9, 0.05, 0.0, 100, True, False, "")
HIDDEN = replace(STRATUM, p_adjusted=0.001, effect=0.8, effect_lower=0.6)
VALID = Numbers(
    findings=(), floors=AuditSettings().floors, metre=1.0, unit="m",
    labels=Labels(60, 0, 0.06),
    counts=Counts(200, 180, 50, 120, 45, 50, 0, 0, 110, 0.1, 0.01),
    kept=Kept(0.95, 0.6, 118), strata=(STRATUM,),
    modes=(Mode("m0", 40, 40, 0.91, 50, 50), Mode("m1", 40, 39, 0.87, 48, 50)),
)  # fmt: skip
OFFSET = Finding("clock", "robot", "epoch e1", "clock_residual_s", 0.05, "s", "Correct it.")


def named(numbers: Numbers, limits: CauseLimits = LIMITS, draws=()) -> Cause:
    return name_cause(numbers, draws, limits)


def limit(**changes: float) -> CauseLimits:
    found = dict(LIMITS.by_question)
    for question, value in changes.items():
        found[question] = replace(found[question], limit=value)
    return CauseLimits(found)


def counts(**changes) -> Numbers:
    return replace(VALID, counts=replace(VALID.counts, **changes))


BROKEN = {
    "data": (replace(VALID, findings=(OFFSET,)), "data_defect", "clock"),
    "labels": (replace(VALID, labels=Labels(60, 12, 0.32)), "label_contamination", "replay"),
    "support": (counts(analysed_episodes=19), "insufficient_support", "neighbourhoods"),
    "structure": (counts(two_mode_episodes=9), "unimodal", ""),
    "hidden": (replace(VALID, strata=(HIDDEN,)), "hidden_state", "stratum"),
    "validity": (
        replace(VALID, modes=(VALID.modes[0], replace(VALID.modes[1], success_lower=0.69))),
        "unimodal", "one_valid_mode",
    ),
}  # fmt: skip


def test_all_green_is_valid_modes():
    cause = named(VALID)
    assert (cause.name, cause.layer, cause.text) == ("valid_modes", Layer.NONE, "valid_modes")
    assert all(answer.holds for answer in cause.answers)
    assert json.loads(json.dumps([a.as_json() for a in cause.answers]))


@pytest.mark.parametrize("layer", BROKEN)
def test_each_layer_names_its_cause_and_says_which_number_is_beyond(layer):
    numbers, name, kind = BROKEN[layer]
    cause = named(numbers)
    assert (cause.name.value, cause.kind, cause.layer.value) == (name, kind, layer)
    assert any(answer.red for answer in cause.answers if answer.layer is cause.layer)


def test_an_earlier_red_layer_is_believed_before_a_later_one():
    both = replace(BROKEN["hidden"][0], findings=(OFFSET,))
    assert named(both).name is CauseName.DATA_DEFECT
    # Below its limit the offset is no fault, and the next red layer decides.
    assert named(both, limit(clock_residual_s=0.05)).name is CauseName.HIDDEN_STATE


@pytest.mark.parametrize(
    ("numbers", "kind"),
    [(counts(analysed=99), "neighbourhoods"), (counts(queries=2000), "neighbourhoods"),
     (replace(VALID, kept=Kept(0.95, 0.6, 29)), "persistence"),
     (counts(persistent=29), "persistence"),
     (counts(two_mode_episodes=0, queries=500), "neighbourhoods"),
     (replace(VALID, labels=Labels(10, 0, 0.31)), "replay"),
     (replace(VALID, modes=VALID.modes[:1]), "linking")],
)  # fmt: skip
def test_too_little_is_said_to_be_too_little(numbers, kind):
    cause = named(numbers)
    assert (cause.name, cause.kind) == (CauseName.INSUFFICIENT_SUPPORT, kind)


def test_clusters_that_do_not_persist_and_white_spread_are_noise():
    fading = replace(VALID, kept=Kept(0.65, 0.6, 118))
    assert named(fading).name is CauseName.POINTWISE_NOISE
    assert named(fading, limit(persistence_margin=0.04)).name is CauseName.VALID_MODES
    white = counts(two_mode_episodes=0, noise_ratio=0.9)
    assert named(white).name is CauseName.POINTWISE_NOISE
    quiet = counts(two_mode_episodes=0, noise_ratio=0.9, noise_spread=0.001)
    assert named(quiet).name is CauseName.UNIMODAL
    # In pixels a metre is a thousand of them, and a spread of a hundredth of one is nothing.
    assert named(replace(white, metre=1000.0)).name is CauseName.UNIMODAL


def test_of_equal_variables_the_most_concrete_is_named_and_the_past_must_show_more():
    past = replace(HIDDEN, variable="history", effect=0.95)
    both = replace(VALID, strata=(past, HIDDEN))
    assert named(both).variable == "operator"
    assert named(both, limit(nearly_equal_effect=0.01, everything_handicap=0.0)).kind == "history"
    lucky = replace(VALID, strata=(replace(HIDDEN, effect_lower=0.05),))
    assert named(lucky).name is CauseName.VALID_MODES
    assert not any(answer.red for answer in named(lucky).answers)
    seen = replace(VALID, strata=(replace(HIDDEN, observed=True),))
    assert (named(seen).name, named(seen).kind) == (CauseName.UNIMODAL, "observed_variable")
    epoch = replace(VALID, strata=(replace(HIDDEN, variable="calibration_epoch"),))
    assert named(epoch).name is CauseName.DATA_DEFECT


@pytest.mark.parametrize(
    "numbers",
    [replace(VALID, findings=(replace(OFFSET, measured=math.nan),)),
     replace(VALID, labels=Labels(60, 3, math.nan)), replace(VALID, kept=Kept(math.nan, 0.6, 118)),
     replace(VALID, modes=tuple(replace(m, success_lower=math.nan) for m in VALID.modes))],
)  # fmt: skip
def test_a_number_that_is_none_holds_no_limit(numbers):
    assert named(numbers).name is not CauseName.VALID_MODES


def test_confidence_is_the_share_of_draws_that_name_the_same():
    draws = [VALID] * 3 + [BROKEN["hidden"][0]]
    assert named(VALID, draws=draws).confidence == 0.75
    assert named(VALID).confidence is None


@pytest.mark.parametrize("question", sorted(AuditSettings().floors))
def test_a_limit_below_what_the_audit_looked_for_is_refused(question):
    below = 0.5 * AuditSettings().floors[question]
    with pytest.raises(ConfigError, match=rf"limit of {question} is .*, expected at least"):
        named(VALID, limit(**{question: below}))


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
    watched = Watched(LIMITS.by_question)
    others = (counts(two_mode_episodes=0), counts(two_mode_episodes=0, noise_ratio=0.9))
    for numbers in (VALID, *others, *(item[0] for item in BROKEN.values())):
        named(numbers, watched)
    of_findings = _of_findings()
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


def test_a_shared_question_that_does_not_apply_turns_nothing_red_and_is_written_as_such(tmp_path):
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    del params["gate_a"]["limits"]["perception"]["clock_residual_s"]
    params["gate_a"]["not_applicable"] = {"perception": {"clock_residual_s": "one clock only"}}
    path = tmp_path / "params.yaml"
    path.write_text(yaml.safe_dump(params))
    limits = read_cause_limits(path)
    late = replace(VALID, findings=(OFFSET,))
    assert named(late).name is CauseName.DATA_DEFECT
    assert named(late, limits).name is CauseName.VALID_MODES
    written = limits.as_json()["perception"]["clock_residual_s"]
    assert written == ["not applicable", "one clock only"]
    json.dumps([answer.as_json() for answer in named(late, limits).answers], allow_nan=False)
