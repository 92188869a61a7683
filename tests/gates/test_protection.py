"""Floors and ceilings in code: looser settings are refused by name, tighter ones are free."""

import evidence
import pytest
import yaml

from flows.workspace import merged
from gates.asked_for import CHECKS_ASKED_FOR
from gates.criterion import Criterion
from gates.proof import SPECS, judge
from gates.protection import (
    BOUNDS,
    NAMED,
    REHEARSED,
    is_rehearsal,
    lacking,
    loosened,
    require_protection,
)
from gates.report import GATES
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import read_yaml


def _put(params, bound, value):
    """Set the value at the place of a bound; criteria where their limit stands."""
    if "." in bound.place or bound.place in params:
        *path, last = bound.place.split(".")
        section = params
        for part in path:
            section = section.setdefault(part, {})
        section[last] = value
        return
    for entries in params[f"gate_{bound.gate.lower()}"]["limits"].values():
        if bound.place in entries:
            entries[bound.place][0] = value


@pytest.mark.parametrize("bound", BOUNDS, ids=lambda bound: f"{bound.gate}-{bound.place}")
@pytest.mark.parametrize("rehearsal", [False, True])
def test_a_looser_limit_is_bad_configuration_but_in_a_rehearsal(bound, rehearsal, tmp_path):
    sign = 1 if bound.comparison == "<=" else -1
    for value, loose in (
        (bound.bound, False),
        (bound.bound - sign * 0.01, False),
        (bound.bound + sign * 1e-6, True),
        (float("nan"), True),
        ("derived", True),
    ):
        evidence.write_params(tmp_path, lambda p, v=value: _put(p, bound, v))
        params = {**yaml.safe_load((tmp_path / "params.yaml").read_text()), "rehearsal": rehearsal}
        if loose and not rehearsal:
            with pytest.raises(ConfigError, match=bound.place.split(".")[-1]) as refused:
                require_protection(params, bound.gate)
            assert bound.reason in str(refused.value) and refused.value.exit_code == 2
        else:
            said = require_protection(params, bound.gate)
            assert bool(said) == rehearsal
            assert not rehearsal or (REHEARSED in said[0] and (bound.place in said[0]) == loose)


def test_every_bound_is_of_a_criterion_or_a_setting(request):
    params = read_yaml(request.config.rootpath / "params.yaml")
    for bound in BOUNDS:
        if "." in bound.place or bound.place in params:
            value = params
            for part in bound.place.split("."):
                value = value[part]
            continue
        criterion = {item.id: item for item in SPECS[bound.gate].criteria}[bound.place]
        assert isinstance(criterion, Criterion) and criterion.comparison == bound.comparison


@pytest.mark.parametrize("named", NAMED, ids=lambda named: named.place)
@pytest.mark.parametrize("rehearsal", [False, True])
def test_a_list_that_leaves_out_a_check_is_bad_configuration_but_in_a_rehearsal(named, rehearsal):
    section = {named.place: [*named.names, "one_more"]}
    params = {"gate_c": section, "rehearsal": rehearsal}
    assert lacking(params, "C") == [] == lacking(params, "D")
    assert bool(require_protection(params, "C")) == rehearsal
    for broken in (list(named.names[1:]), [], "all", None):
        params["gate_c"] = {named.place: broken}
        if rehearsal:
            assert named.place in require_protection(params, "C")[0]
            continue
        with pytest.raises(ConfigError, match=named.place) as refused:
            require_protection(params, "C")
        assert named.names[0] in str(refused.value) and named.reason in str(refused.value)


def test_what_must_be_asked_for_is_every_row_of_both_tables():
    assert list(CHECKS_ASKED_FOR) == [f"{layer}.{name}" for layer, name in evidence.CHECKS]


def test_the_shipped_lists_name_what_they_must(request):
    params = read_yaml(request.config.rootpath / "params.yaml")
    assert {named.place for named in NAMED} <= set(params["gate_c"])
    assert lacking(params, "C") == []


def test_a_protective_criterion_cannot_be_waived():
    params = {"gate_c": {"not_applicable": {"safety": {"mutants_undetected": "no time"}}}}
    with pytest.raises(ConfigError, match="mutants_undetected"):
        require_protection(params, "C")


def test_judging_refuses_a_looser_limit(ladder):
    evidence.write_params(ladder, evidence.set_limit("gate_d", "stub_violations", 5))
    with pytest.raises(ConfigError, match=r"stub_violations is 5.*<= 0"):
        judge(ladder, "D")


@pytest.mark.parametrize("value", ["yes", 1, None, "true"])
def test_a_rehearsal_is_declared_in_one_word(value):
    with pytest.raises(ConfigError, match="rehearsal"):
        is_rehearsal({"rehearsal": value})


def test_the_shipped_ladder_keeps_every_bound_and_the_smoke_ladder_is_a_rehearsal(request):
    root = request.config.rootpath
    params = read_yaml(root / "params.yaml")
    assert not is_rehearsal(params)
    assert [loosened(params, gate) for gate in GATES] == [[]] * len(GATES)
    smoke = merged(params, read_yaml(root / "params.smoke.yaml"))
    assert is_rehearsal(smoke)
    looser = {bound.place for gate in GATES for bound, _ in loosened(smoke, gate)}
    assert looser == {"stub_violation_upper", "stress.alpha"}
