"""Floors and ceilings in code: looser settings are refused by name, tighter ones are free."""

import copy

import evidence
import pytest
import yaml

from flows.workspace import merged
from gates.asked_for import CHECKS_ASKED_FOR, INCIDENTS_ASKED_FOR, OF_TWO
from gates.floors import BOUNDS
from gates.need.settings import NeedSettings
from gates.planned_settings import CAUSE
from gates.proof import SPECS, judge
from gates.protection import (
    NAMED,
    REHEARSED,
    SHARED,
    is_rehearsal,
    lacking,
    loosened,
    require_protection,
)
from gates.report import GATES, stage_of
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import read_yaml

DEFAULTED = ("remedies", "factors", "conditioning_factors")
"""Settings of Gate A with a default in code."""


def _put(params, bound, value):
    """Set the value at the place of a bound; criteria where their limit stands."""
    if "." in bound.place or bound.place in SHARED:
        *path, last = bound.place.split(".")
        section = params
        for part in path:
            section = section.setdefault(part, {})
        if path[-1:] == [CAUSE]:
            (section,) = [entries for entries in section.values() if last in entries]
            value = [value, section[last][1]]
        section[last] = [0, value] if bound.of and not isinstance(value, list) else value
        return
    for entries in params[f"gate_{bound.gate.lower()}"]["limits"].values():
        if bound.place in entries:
            entries[bound.place][0] = value


@pytest.mark.parametrize("bound", BOUNDS, ids=lambda bound: f"{bound.gate}-{bound.place}")
@pytest.mark.parametrize("rehearsal", [False, True])
def test_a_looser_limit_is_bad_configuration_but_in_a_rehearsal(bound, rehearsal):
    sign = 1 if bound.comparison == "<=" else -1
    for value, loose in (
        (bound.bound, False),
        (bound.bound - sign * 0.01, False),
        (bound.bound + sign * 1e-6, True),
        (float("nan"), True),
        ("derived", not bound.derives),
    ):
        params = copy.deepcopy({**evidence.PARAMS, "rehearsal": rehearsal})
        _put(params, bound, value)
        if loose and not rehearsal:
            with pytest.raises(ConfigError, match=bound.place.split(".")[-1]) as refused:
                require_protection(params, bound.gate)
            assert bound.reason in str(refused.value) and refused.value.exit_code == 2
        else:
            said = require_protection(params, bound.gate)
            assert bool(said) == rehearsal
            assert not rehearsal or (REHEARSED in said[0] and (bound.place in said[0]) == loose)


@pytest.mark.parametrize("named", NAMED, ids=lambda named: named.place)
@pytest.mark.parametrize("rehearsal", [False, True])
def test_a_list_that_leaves_out_a_check_is_bad_configuration_but_in_a_rehearsal(named, rehearsal):
    names, gate = list(named.names), named.gate
    params = {"rehearsal": rehearsal}
    more = [*names, "one_more"]
    good, bad = (
        ([names, [], names[0] if len(names) == 1 else names], [more, "all", ["one_more"], None])
        if named.at_most
        else ([names, more], [names[1:], [], "all", None])
    )
    section, _, place = named.place.rpartition(".")
    for kept in good:
        params[section or stage_of(gate)] = {place: kept}
        assert lacking(params, gate) == [] == lacking(params, "E")
        assert bool(require_protection(params, gate)) == rehearsal
    for broken in bad:
        params[section or stage_of(gate)] = {place: broken}
        if rehearsal:
            assert named.place in require_protection(params, gate)[0]
            continue
        with pytest.raises(ConfigError, match=named.place) as refused:
            require_protection(params, gate)
        assert named.names[0] in str(refused.value) and named.reason in str(refused.value)


@pytest.mark.parametrize("named", NAMED, ids=lambda named: named.place)
def test_the_refusal_of_a_list_says_what_is_wrong_with_it(named):
    section, _, place = named.place.rpartition(".")
    broken = {section or stage_of(named.gate): {place: [*named.names[1:], "odd"]}}
    with pytest.raises(ConfigError) as refused:
        require_protection(broken, named.gate)
    if named.at_most:
        found, rule = "with odd", f"nothing but {named.names[0]}, because"
    else:
        found, rule = f"without {named.names[0]}", "all that the code names: "
    where = named.place if section else f"{stage_of(named.gate)}: {named.place}"
    assert refused.value.where == f"params.yaml: {where}"
    assert refused.value.found == found and refused.value.expected.startswith(rule)


def test_golden_what_each_list_must_or_may_name():
    assert {(n.gate, n.place, n.names, n.at_most) for n in NAMED} == {
        ("A", "remedies", ("chunked_l1", "bc_noise"), False),
        ("A", "factors", ("reference", "representation", "trunk", "head", "temporal"), False),
        ("A", "conditioning_factors", ("representation", "trunk"), False),
        ("A", "deployed_conventions", ("direct", "z_zero", "offset"), False),
        ("A", "chunked_baseline", ("chunked_bc",), True),
        ("A", "generative_baselines", ("ibc",), True),
        ("C", "required_fixtures",
         ("stale_observation", "infeasible_rotation", "phase_change", "reordered_chunk"), False),
        ("D", "stress.baselines",
         ("chunked_bc", "chunked_l1", "one_mode_bc", "bc_noise", "act"), False),
        ("D", "stress.perturbations",
         ("nominal", "camera_delay", "compute_contention", "network_jitter", "queue_reorder",
          "envelope"), False),
    }  # fmt: skip


@pytest.mark.parametrize(
    "bound", [b for b in BOUNDS if "." not in b.place and b.place not in SHARED],
    ids=lambda bound: f"{bound.gate}-{bound.place}",
)  # fmt: skip
def test_a_section_of_the_name_of_a_criterion_does_not_hide_its_limit(bound, tmp_path):
    """`stub_violations: 0` at the top of the file took the place of the gate's limit of 5."""
    sign = 1 if bound.comparison == "<=" else -1
    evidence.write_params(tmp_path, lambda p: _put(p, bound, bound.bound + sign))
    params = yaml.safe_load((tmp_path / "params.yaml").read_text()) | {bound.place: bound.bound}
    with pytest.raises(ConfigError, match=bound.place):
        require_protection(params, bound.gate)


def test_what_must_be_asked_for_is_every_row_of_both_tables():
    assert list(CHECKS_ASKED_FOR) == [f"{layer}.{name}" for layer, name in evidence.CHECKS]
    assert list(INCIDENTS_ASKED_FOR.items()) == [pair[:2] for pair in evidence.INCIDENTS]
    assert tuple(name for name, _, moved in evidence.INCIDENTS if moved) == OF_TWO


def test_the_shipped_lists_name_what_they_must(request):
    params = read_yaml(request.config.rootpath / "params.yaml")
    assert [lacking(params, gate) for gate in GATES] == [[]] * len(GATES)
    for named in NAMED:
        section, _, place = named.place.rpartition(".")
        assert place in params[section or stage_of(named.gate)] or place in DEFAULTED


def test_a_condition_counts_by_its_kind_and_not_by_its_name():
    """`camera_delay: {kind: nominal}` is no camera delay, by whatever name it goes."""
    conditions = {"nominal": {}, "camera_delay": {}, "compute_contention": {}, "queue_reorder": {},
                  "envelope": {}}  # fmt: skip
    jitter = {"slow_line": {"kind": "network_jitter"}}
    assert lacking({"stress": {"perturbations": conditions | jitter}}, "D") == []
    for bad in ({"network_jitter": {"kind": "nominal"}}, {"slow_line": {}}):
        ((named, wrong),) = lacking({"stress": {"perturbations": conditions | bad}}, "D")
        assert (named.place, wrong) == ("stress.perturbations", ["network_jitter"])


def test_what_a_list_that_is_not_written_stands_for_names_all_that_it_must():
    fields = NeedSettings.model_fields
    for named in NAMED:
        if named.place in DEFAULTED:
            assert set(named.names) <= set(fields[named.place].default)


OF_CRITERIA = [
    bound for bound in BOUNDS if bound.place in {i.id for s in SPECS.values() for i in s.criteria}
]
ASKED_FOR = {"stress": {"perturbations": {"push": {"contact_force_n": 30.0}, "recovery_drill": {}}}}


@pytest.mark.parametrize("bound", OF_CRITERIA, ids=lambda bound: f"{bound.gate}-{bound.place}")
@pytest.mark.parametrize("reason", ["no time", "derived"])
def test_a_protective_criterion_cannot_be_waived_but_what_a_task_lacks(bound, reason):
    """A waiver's reason may be the word that stands for a limit that follows from settings."""
    waived = {stage_of(bound.gate): {"not_applicable": {"safety": {bound.place: reason}}}}
    if bound.waivable and bound.waivable(ASKED_FOR):  # no setting says that a task has it
        assert require_protection({**ASKED_FOR, **waived}, bound.gate) == ()
        return
    with pytest.raises(ConfigError, match=bound.place):
        require_protection({**ASKED_FOR, **waived}, bound.gate)
    rehearsed = require_protection({**ASKED_FOR, **waived, "rehearsal": True}, bound.gate)
    assert bound.place in rehearsed[0]
    if bound.waivable:
        assert require_protection(waived, bound.gate) == ()


def test_the_false_promotion_of_every_recovery_failed_is_not_two_lines_away(ladder):
    """Gate D once promoted with every recovery failed and a latency p95 of 9 s."""
    limits = evidence.PARAMS["gate_d"]["limits"]
    assert limits["safety"]["recovery_success_lower"] and limits["controller"]["latency_p95_s"]
    for name, owner in (("recovery_success_lower", "safety"), ("latency_p95_s", "controller")):

        def waive(params, name=name, owner=owner):
            del params["gate_d"]["limits"][owner][name]
            params["gate_d"]["not_applicable"] = {owner: {name: "we have no time"}}

        evidence.write_params(ladder, waive)
        with pytest.raises(ConfigError, match=rf"{name} is 'we have no time', expected"):
            judge(ladder, "D")
    evidence.write_params(ladder, evidence.set_limit("gate_d", "recovery_success_lower", 0.0))
    with pytest.raises(ConfigError, match=r"recovery_success_lower is 0.0, expected >= 0.2"):
        judge(ladder, "D")


@pytest.mark.parametrize(
    ("gate", "place", "value"),
    [
        ("B", "nonfinite_weights", 1), ("B", "samples_difference", 0.01),
        ("B", "unpinned_items", 1), ("B", "metadata_mismatches", 1), ("B", "nfe_mismatch", 1),
        ("B", "varied_difference", 0.01),
        ("C", "gate_c.mode_observations", 29), ("D", "force_peak_p95_n", 1e6),
        ("D", "intervention_upper", 1.0), ("D", "reset_upper", 1.0),
        ("D", "verdict_reachable", 0), ("D", "stress.starts", 2),
        ("C", "execution.watchdog_s", 100.0), ("D", "execution.watchdog_s", 100.0),
        ("D", "execution.force_limit_n", {"open": 40.0, "touch": 1e6}),
        ("D", "execution.maximum_age_s", {"default": 0.3, "insert": 5.0}),
        ("C", "execution.maximum_divergence_m", 9.0), ("D", "execution.maximum_scene_shift_m", 1.0),
        ("A", "data_defects", 99), ("A", "label_disagreement", 1), ("A", "factor_valid_share", 1),
        ("A", "gate_a.cause.swapped_columns", 99), ("A", "gate_a.cause.supported_share", 0),
        ("A", "calibration_residual_m", 10), ("A", "mode_success_lower", 0),
        ("D", "stress.planned_effect", [0.01, 0.99]),
        ("C", "feasibility.position_change_limit_m", 9.0), ("A", "cause_accepted", 0),
        ("D", "deadline_miss_upper", 0.9), ("D", "stress_success_lower", 0.0),
        ("D", "recovery_success_lower", 0.0), ("D", "latency_p95_s", 9.0),
        ("D", "rejection_share_upper", 0.99), ("D", "nominal_success_lower", 0.0),
        ("B", "mode_coverage_lower", 0.0), ("B", "outside_modes_upper", 0.45),
        ("B", "gate_b.mode_minimum_share", 1e-9), ("B", "unmatched_keys", 1),
        ("B", "late_change_upper", 1.0), ("B", "baseline_fall_upper", 1.0),
        ("B", "latency_model_ratio_upper", 10.0), ("B", "warm_latency_ratio_upper", 10.0),
        ("B", "latency_terms_missing", 1), ("C", "mode_admissible_gap", 1.0),
        ("C", "admissible_share", 0.0),
    ],
)  # fmt: skip
def test_what_people_and_the_proof_rest_on_has_a_bound_in_code(gate, place, value, tmp_path):
    bound = next(b for b in BOUNDS if (b.gate, b.place) == (gate, place))
    evidence.write_params(tmp_path, lambda params: _put(params, bound, value))
    params = yaml.safe_load((tmp_path / "params.yaml").read_text())
    with pytest.raises(ConfigError, match=place.split(".")[-1]):
        require_protection(params, gate)


def test_a_limit_of_every_phase_is_held_to_the_bound():
    def forces(*limits):
        params = {"execution": {"force_limit_n": dict(zip("ab", limits, strict=True))}}
        return [value for _, value in loosened(params, "D")]

    assert forces(80.0, 10.0) == [] and forces(10.0, 81.0) == [81.0]


@pytest.mark.parametrize(
    ("gate", "name"),
    [
        ("B", "nonfinite_weights"), ("B", "samples_difference"), ("B", "unpinned_items"),
        ("B", "metadata_mismatches"), ("B", "nfe_mismatch"), ("B", "varied_difference"),
        ("D", "verdict_reachable"), ("D", "unmatched_starts"),
    ],
)  # fmt: skip
def test_what_proves_a_candidate_applies_to_every_cell(gate, name):
    assert {item.id: item for item in SPECS[gate].criteria}[name].always


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
    assert looser == {
        "stub_violation_upper", "stress.alpha", "stress.starts", "gate_c.mode_observations",
        "verdict_reachable", "intervention_upper", "reset_upper", "hold_share_upper",
        "fallback_share_upper", "stress_success_lower", "rejection_share_upper",
        "nominal_success_lower", "recovery_success_lower", "latency_p95_s", "force_peak_p95_n",
        "mode_coverage_lower", "outside_modes_upper", "late_change_upper", "baseline_fall_upper",
        "warm_latency_ratio_upper", "latency_model_ratio_upper", "mode_admissible_gap",
        "remedy_valid_share", "boundary_jerk_p95_m_s3", "cold_latency_ratio_upper",
        "projection_p95_m",
    }  # fmt: skip
