"""The plan: what moved since shows, loosened apart from tightened."""

import copy

import evidence
import pytest
import yaml

from gates.cause.limits import OWN
from gates.may_differ import PLACE
from gates.planned_settings import CAUSE_STRICT, PLANNED
from gates.preregistration import (
    NONE,
    PREREGISTRATION,
    Move,
    moved_caveats,
    moves,
    plan_bytes,
    plan_of,
    read_plan,
)
from gates.proof import SPECS, judge
from gates.report import stage_of


def _moved(change):
    params = copy.deepcopy(evidence.PARAMS)
    change(params)
    return [(m.place, m.kind) for m in moves(plan_of(evidence.PARAMS), params)]


@pytest.mark.parametrize(
    ("path", "value", "kind"),
    [
        (("stress", "margin"), 0.05, "loosened"),
        (("stress", "margin"), 0.2, "tightened"),
        (("stress", "alpha"), 0.2, "loosened"),
        (("stress", "alpha"), 0.01, "tightened"),
        (("stress", "starts"), 10, "loosened"),
        (("stress", "starts"), 1000, "tightened"),
        (("stress", "baselines"), ["bc"], "changed"),
        (("stress", "perturbations"), {"nominal": {}}, "changed"),
        (("seed",), 2, "changed"),
        (("confidence",), 0.9, "loosened"),
        (("reload", "samples"), 1, "loosened"),
        (("gate_b", "budget_reference"), "act", "changed"),
        (("gate_a", "one_mode"), "bc", "changed"),
        (("gate_e", "maximum_days"), 300, "loosened"),
    ],
)
def test_what_moved_is_told_from_what_was_planned(path, value, kind):
    def change(params):
        for part in path[:-1]:
            params = params[part]
        params[path[-1]] = value

    assert _moved(change) == [(".".join(path), kind)]


@pytest.mark.parametrize(
    ("name", "limit", "kind"),
    [
        ("fallback_share_upper", 0.5, "loosened"),
        ("fallback_share_upper", 0.1, "tightened"),
        ("nominal_success_lower", 0.1, "loosened"),
        ("nominal_success_lower", 0.9, "tightened"),
    ],
)
def test_a_limit_moves_to_its_own_side(name, limit, kind):
    found = _moved(evidence.set_limit("gate_d", name, limit))
    assert found == [(f"gate_d.{name}", kind)]


@pytest.mark.parametrize(
    ("question", "limit", "kind"),
    [
        ("gain_factor", 30.0, "loosened"),
        ("gain_factor", 1.5, "tightened"),
        ("supported_share", 0.0, "loosened"),
        ("supported_share", 0.9, "tightened"),
        ("noise_ratio", 0.9, "changed"),
    ],
)
def test_a_limit_of_the_cause_is_planned_as_well(question, limit, kind):
    def change(params):
        owner = next(part for part in params["gate_a"]["cause"].values() if question in part)
        owner[question][0] = limit

    assert _moved(change) == [(f"gate_a.cause.{question}", kind)]


EXECUTION = {"watchdog_s": 0.1, "queue_capacity": 4, "force_limit_n": {"open": 40.0}}
SECTION = {"execution": EXECUTION, "feasibility": {"position_change_limit_m": 0.05}}


@pytest.mark.parametrize(
    ("section", "name", "value", "kind"),
    [
        ("execution", "watchdog_s", 0.2, "loosened"),
        ("execution", "watchdog_s", 0.05, "tightened"),
        ("execution", "queue_capacity", 5, "changed"),
        ("execution", "deadline_s", 0.1, "changed"),
        ("feasibility", "position_change_limit_m", 0.1, "loosened"),
    ],
)
def test_every_setting_that_actions_are_executed_and_checked_by_is_planned(
    section, name, value, kind
):
    params = {**evidence.PARAMS, **SECTION}
    plan = plan_of(params)
    moved = {**params, section: {**SECTION[section], name: value}}
    assert [(m.place, m.kind) for m in moves(plan, moved)] == [(f"{section}.{name}", kind)]


def test_the_force_of_each_phase_is_planned_and_a_setting_that_went_has_changed():
    plan = plan_of({**evidence.PARAMS, **SECTION})
    now = {"execution": {**EXECUTION, "force_limit_n": {"open": 50.0, "touch": 1.0}}}
    found = {m.place: m.kind for m in moves(plan, {**evidence.PARAMS, **now})}
    assert found == {
        "execution.force_limit_n.open": "loosened",
        "execution.force_limit_n.touch": "changed",
        "feasibility.position_change_limit_m": "changed",
    }


@pytest.mark.parametrize(
    ("section", "name", "value"),
    [
        ("gate_b", "mode_minimum_share", 0.01), ("gate_c", "mode_observations", 3),
        ("shadow", "observations", 3), ("record", "episodes", 30), ("policy", "fixtures", 1),
        ("latency", "warm", 1), ("latency", "cold", 1), ("measure_baselines", "samples", 4),
        ("measure_factors", "samples", 1),
    ],
)  # fmt: skip
def test_how_much_is_looked_at_is_planned(section, name, value):
    counts = {
        "shadow": {"observations": 400}, "record": {"episodes": 80}, "policy": {"fixtures": 16},
        "latency": {"warm": 70, "cold": 5, "declared": {}}, "measure_baselines": {"samples": 16},
        "measure_factors": {"samples": 8},
    }  # fmt: skip
    plan = plan_of({**evidence.PARAMS, **counts})
    params = copy.deepcopy({**evidence.PARAMS, **counts})
    params[section][name] = value
    assert [(m.place, m.kind) for m in moves(plan, params)] == [(f"{section}.{name}", "loosened")]


@pytest.mark.parametrize("name", ["updates", "batch_size"])
def test_the_training_is_planned(name):
    def more(params):
        params["policy"]["training"] = {name: 9}

    assert _moved(more) == [(f"policy.training.{name}", "changed")]


def test_the_network_and_the_shares_of_demonstrations_are_planned():
    def other(params):
        params["policy"]["network"] = {"trunk_width": 8}
        params["record"] = {"shares": {"nominal": 1.0}}

    moved = _moved(other)
    assert ("policy.network", "changed") in moved and ("record.shares", "changed") in moved


@pytest.mark.parametrize("name", ["train", "validation"])
def test_how_many_episodes_judge_is_planned(name):
    def other(params):
        params["ingest"] = {name: 0.1}

    assert _moved(other) == [(f"ingest.{name}", "changed")]


def test_every_strict_side_of_the_cause_belongs_to_a_question():
    assert set(CAUSE_STRICT) < set(OWN)


def test_a_limit_that_was_dropped_is_loosened_and_a_reason_or_owner_is_free():
    def drop(params):
        del params["gate_d"]["limits"]["safety"]["intervention_upper"]
        params["gate_d"]["limits"]["safety"]["fallback_share_upper"][1] = "other words"

    assert _moved(drop) == [("gate_d.intervention_upper", "loosened")]
    assert _moved(lambda params: None) == []


def test_the_report_binds_the_plan_and_says_what_moved(ladder):
    (ladder / PREREGISTRATION).write_bytes(plan_bytes(evidence.PARAMS))
    report = judge(ladder, "D")
    assert PREREGISTRATION in report.materials
    assert not any(PREREGISTRATION in caveat for caveat in report.caveats)

    def change(params):
        evidence.set_limit("gate_d", "fallback_share_upper", 0.5)(params)
        evidence.set_limit("gate_c", "admissible_share", 0.7)(params)
        params["seed"] = 5

    evidence.write_params(ladder, change)
    said = [caveat for caveat in judge(ladder, "D").caveats if PREREGISTRATION in caveat]
    assert [caveat.split()[0] for caveat in said] == ["Loosened", "Tightened", "Changed"]
    assert "fallback_share_upper (0.15 -> 0.5)" in said[0]
    assert "gate_c.admissible_share" in said[1] and "seed (1 -> 5)" in said[2]


def test_what_was_loosened_furthest_is_named_first(ladder):
    """By the share of itself; a limit of none, and one that was dropped, before all others."""
    (ladder / PREREGISTRATION).write_bytes(plan_bytes(evidence.PARAMS))

    def change(params):
        for name, limit in (("fallback_share_upper", 0.2), ("hold_share_upper", 9.0)):
            evidence.set_limit("gate_d", name, limit)(params)
        del params["gate_d"]["limits"]["safety"]["intervention_upper"]

    evidence.write_params(ladder, change)
    said = moved_caveats(ladder, yaml.safe_load((ladder / "params.yaml").read_text()), "D")[0]
    order = [said.index(name) for name in ("intervention", "hold_share", "fallback_share")]
    assert order == sorted(order)


OWN_LIMIT = {
    "A": "told_share", "B": "late_change_upper", "C": "projection_p95_m",
    "D": "fallback_share_upper",
}  # fmt: skip


@pytest.mark.parametrize("gate", OWN_LIMIT)
def test_what_moved_shows_in_the_report_of_the_gate_and_of_those_above(ladder, gate):
    (ladder / PREREGISTRATION).write_bytes(plan_bytes(evidence.PARAMS))
    assert not any(PREREGISTRATION in caveat for caveat in judge(ladder, gate).caveats)

    def change(params):
        for own, name in OWN_LIMIT.items():
            # Beyond these `gates.protection` refuses the limits.
            looser = {"A": 0.65, "B": 0.19, "C": 0.09, "D": 0.45}[own]
            evidence.set_limit(stage_of(own), name, looser)(params)

    evidence.write_params(ladder, change)
    (said,) = [caveat for caveat in judge(ladder, gate).caveats if PREREGISTRATION in caveat]
    assert said.startswith("Loosened since")
    below = list(OWN_LIMIT)[: list(OWN_LIMIT).index(gate) + 1]
    shown = {own for own, name in OWN_LIMIT.items() if f"{stage_of(own)}.{name} (" in said}
    assert shown == set(below)


def test_the_plan_is_material_of_no_gate_whose_verdict_trains_or_measures_again(ladder):
    materials = {gate: judge(ladder, gate).materials for gate in OWN_LIMIT}
    assert [gate for gate in materials if PREREGISTRATION in materials[gate]] == ["D"]


@pytest.mark.parametrize("text", [None, "", "[1]", "seed: 1", "{seed: ['', 1]}", "a: ["])
def test_without_a_plan_the_report_says_so(ladder, text):
    path = ladder / PREREGISTRATION
    path.unlink() if text is None else path.write_text(text)
    assert read_plan(ladder) is None
    assert moved_caveats(ladder, evidence.PARAMS, "D") == (NONE,)


def _written(tmp_path, plan):
    (tmp_path / PREREGISTRATION).write_text(yaml.safe_dump(plan))
    return read_plan(tmp_path)


@pytest.mark.parametrize("entry", [["<", 1], ["<="], ["<=", 1, 2], "<=", {"<=": 1}, [1, "<="]])
def test_one_entry_of_another_form_voids_the_plan(tmp_path, entry):
    plan = plan_of(evidence.PARAMS)
    assert _written(tmp_path, plan) is not None
    assert _written(tmp_path, {**plan, "gate_d.reset_upper": entry}) is None


def test_a_plan_names_every_setting_that_is_planned_and_may_name_no_limit(tmp_path):
    bare = {place: entry for place, entry in plan_of(evidence.PARAMS).items() if place in PLANNED}
    assert _written(tmp_path, bare) is not None
    for place in bare:
        assert _written(tmp_path, {k: v for k, v in bare.items() if k != place}) is None


@pytest.mark.parametrize(("before", "now"), [(0.1, "derived"), ("derived", 0.1), (0.1, True)])
def test_a_limit_that_is_no_number_any_more_changed(before, now):
    plan = {"gate_d.reset_upper": ["<=", before]}
    found = {move.place: move.kind for move in moves(plan, evidence.PARAMS)}
    changed = copy.deepcopy(evidence.PARAMS)
    evidence.set_limit("gate_d", "reset_upper", now)(changed)
    found = {move.place: move.kind for move in moves(plan, changed)}
    assert found["gate_d.reset_upper"] == "changed"
    assert found["gate_d.force_peak_p95_n"] == "changed"  # a limit that nobody planned


@pytest.mark.parametrize(
    ("gate", "item"),
    [pytest.param(g, c, id=f"{g}-{c.id}") for g, spec in SPECS.items() for c in spec.criteria],
)
def test_every_limit_is_strict_on_the_side_of_its_criterion(gate, item):
    plan = plan_of({stage_of(gate): {"limits": {"model": {item.id: [0.5, "why"]}}}})
    assert plan[f"{stage_of(gate)}.{item.id}"] == [item.comparison, 0.5]


def test_what_counts_as_looser_is_not_read_from_the_plan():
    """A plan whose side was turned said "Tightened" of a limit that was loosened."""
    plan = plan_of(evidence.PARAMS)
    place = "gate_d.fallback_share_upper"
    side, before = plan[place]
    plan[place] = [">=", before]
    params = copy.deepcopy(evidence.PARAMS)
    evidence.set_limit("gate_d", "fallback_share_upper", 0.9)(params)
    (move,) = moves(plan, params)
    assert (move.place, move.kind) == (place, "changed")
    assert str(move) == f"{place} (>= {before} -> {side} 0.9)"
    assert [m.kind for m in moves(plan, evidence.PARAMS)] == ["changed"]


def test_a_line_struck_out_of_the_plan_is_not_told_as_tightened():
    plan = {p: e for p, e in plan_of(evidence.PARAMS).items() if p != "gate_d.reset_upper"}
    assert [(m.place, m.kind) for m in moves(plan, evidence.PARAMS)] == [
        ("gate_d.reset_upper", "changed")
    ]


@pytest.mark.parametrize(("length", "shown"), [(59, 59), (60, 60), (61, 60), (500, 60)])
def test_a_long_value_is_cut_where_it_is_longer_than_sixty(length, shown):
    text = str(Move("a", "x" * length, None, "changed"))
    before = text.removeprefix("a (").removesuffix(" -> None)")
    assert len(before) == shown and before.endswith("…") == (length > 60)


def test_a_plan_is_written_in_the_order_in_which_it_is_read():
    """A person compares it line by line with what changed: not by the alphabet."""
    plan = plan_of(evidence.PARAMS)
    assert list(yaml.safe_load(plan_bytes(evidence.PARAMS))) == list(plan)
    assert list(plan)[: len(PLANNED)] == list(PLANNED)
    assert plan_bytes(evidence.PARAMS).startswith(b"# Written by `genpolicy gates preregister`.")


def test_the_shipped_plan_can_be_read(request):
    plan = read_plan(request.config.rootpath)
    assert plan is not None
    text = plan_bytes(yaml.safe_load((request.config.rootpath / "params.yaml").read_text()))
    assert set(yaml.safe_load(text)) >= {"stress.margin", "gate_d.stub_violations"}


@pytest.mark.parametrize(
    ("now", "kind"),
    [
        ([["a", "r"], ["b", "r"], ["c", "r"]], "loosened"),
        ([["b", "r"]], "tightened"),
        ([], "tightened"),
        ([["a", "r"], ["c", "r"]], "changed"),
        ([["a", "another reason"], ["b", "r"]], "changed"),
        (None, "changed"),
    ],
)
def test_a_list_of_what_may_differ_is_looser_by_each_setting_on_it(now, kind):
    params = copy.deepcopy(evidence.PARAMS)
    params["comparison"] = {"may_differ": [["a", "r"], ["b", "r"]]}
    plan = plan_of(params)
    params["comparison"]["may_differ"] = now
    (move,) = moves(plan, params)
    assert (move.place, move.kind) == (PLACE, kind)
