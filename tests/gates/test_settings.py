"""Limits by owner, waivers, and numbers that have one home."""

import copy
import re
from typing import ClassVar

import evidence
import pytest

from flows.workspace import merged
from gates.card.card import CardSettings
from gates.proof import SPECS, judge
from gates.settings import (
    GateSettings,
    Limit,
    Limits,
    read_limits,
    read_params,
    read_settings,
    require_plain,
    section_of,
)
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import read_yaml


def _params(change=lambda params: None):
    params = copy.deepcopy(evidence.PARAMS)
    change(params)
    return params


def _limits(change, gate="A"):
    return read_limits(_params(change), gate, SPECS[gate].criteria)


def test_a_limit_has_its_reason_and_owner():
    limits = _limits(lambda params: None)
    assert set(limits.of) == evidence.limited("gate_a") and not limits.waived
    one = limits.of["clock_residual_s"]
    assert (one.limit, one.reason, one.owner) == (0.01, "test", "perception")


@pytest.mark.parametrize(
    ("owner", "entry", "text"),
    [
        ("perception", {"clock_residul_s": [1, "r"]}, "limit of no criterion"),
        ("nobody", {"held_out_situations": [1, "r"]}, "no owner"),
        ("controller", {"clock_residual_s": [1, "r"]}, "a second entry"),
        ("perception", {"clock_residual_s": [1, ""]}, "a reason in words"),
        ("perception", {"clock_residual_s": [1, "  "]}, "a reason in words"),
        ("perception", {"clock_residual_s": [1]}, r"\[limit, reason\]"),
        ("perception", {"clock_residual_s": 1}, r"\[limit, reason\]"),
        ("perception", {"clock_residual_s": ["1", "r"]}, "limit"),
        ("perception", {"clock_residual_s": [True, "r"]}, "limit"),
        ("perception", {"clock_residual_s": [float("nan"), "r"]}, "clock_residual_s"),
        ("perception", {"clock_residual_s": ["derived", "r"]}, "a number"),
        ("perception", [1], "owners, and under each"),
    ],
)
def test_a_malformed_limit_is_a_configuration_error(owner, entry, text):
    def change(params):
        limits = params["gate_a"]["limits"]
        limits[owner] = {**limits.get(owner, {}), **entry} if isinstance(entry, dict) else entry

    with pytest.raises(ConfigError, match=text):
        _limits(change)


def test_a_limit_that_follows_from_settings_is_not_written_as_a_number(ladder):
    evidence.write_params(ladder, evidence.set_limit("gate_d", "promotion_e_value", 5))
    with pytest.raises(ConfigError, match="`derived`, because it follows from settings"):
        judge(ladder, "D")


def test_the_promotion_limit_is_one_over_the_alpha_of_one_candidate(ladder):
    found = [c for c in judge(ladder, "D").criteria if c.id == "promotion_e_value"]
    assert {c.threshold for c in found} == {len(evidence.CANDIDATES) / 0.1}


def _waive(owner, name, reason="no such thing in this cell", gate="gate_a"):
    def change(params):
        for entries in params[gate]["limits"].values():
            entries.pop(name, None)
        params[gate]["not_applicable"] = {owner: {name: reason}}

    return change


def test_a_criterion_that_does_not_apply_is_said_and_not_asked(ladder):
    evidence.write_params(ladder, _waive("perception", "calibration_residual_m"))
    evidence.replace(ladder, "audit/calibration.parquet", None)
    report = judge(ladder, "A")
    assert report.verdict == "PASS"
    assert "calibration_residual_m" not in {c.id for c in report.criteria}
    assert any("calibration_residual_m" in c and "no such thing" in c for c in report.caveats)


@pytest.mark.parametrize(
    ("gate", "name"), [(g, i.id) for g, s in SPECS.items() for i in s.criteria if i.always]
)
def test_what_always_applies_cannot_be_waived(gate, name):
    change = _waive("safety", name, gate=f"gate_{gate.lower()}")
    with pytest.raises(ConfigError, match="It applies to every cell"):
        _limits(change, gate)


def test_a_waiver_needs_a_reason_and_excludes_a_limit():
    with pytest.raises(ConfigError, match="a reason in words"):
        _limits(_waive("perception", "calibration_residual_m", ""))
    with pytest.raises(ConfigError, match="a second entry"):
        _limits(
            lambda p: p["gate_a"].update(not_applicable={"model": {"cause_accepted": "because"}})
        )


def test_a_number_has_one_home():
    settings = read_settings(_params(), "gate_d", SPECS["D"].settings)
    assert settings.candidates == evidence.CANDIDATES
    assert (settings.margin, settings.planned_starts) == (0.1, evidence.STARTS)
    assert settings.alpha == 0.05
    with pytest.raises(ConfigError, match=r"gate_d\.margin is a second home.*stress\.margin"):
        read_settings(
            _params(lambda p: p["gate_d"].update(margin=0.2)), "gate_d", SPECS["D"].settings
        )
    with pytest.raises(ConfigError, match=r"stress\.margin is missing"):
        read_settings(_params(lambda p: p["stress"].pop("margin")), "gate_d", SPECS["D"].settings)
    card = read_settings(_params(), "card", CardSettings)
    assert (card.task, card.authors) == ("tabletop_insertion", ("ada",))


def test_conditions_are_the_undisturbed_one_and_more():
    for left in ({"push": {}}, {"nominal": {}}):
        params = _params(lambda p, n=left: p["stress"].update(perturbations=n))
        with pytest.raises(ConfigError, match="at least one more"):
            read_settings(params, "gate_d", SPECS["D"].settings)


def test_the_smoke_ladder_gives_its_own_limits_and_reasons(request):
    root = request.config.rootpath
    params = merged(read_yaml(root / "params.yaml"), read_yaml(root / "params.smoke.yaml"))
    for gate, spec in SPECS.items():
        limits = read_limits(params, gate, spec.criteria)
        assert set(limits.of) | set(limits.waived) == {item.id for item in spec.criteria}
    one = read_limits(params, "B", SPECS["B"].criteria).of["mode_coverage_lower"]
    assert (one.limit, one.owner) == (0.0, "model") and one.reason.startswith("smoke:")


def test_a_measure_sees_the_limits_that_its_gate_judges_by():
    limits = _limits(lambda params: None)
    settings = read_settings(_params(), "gate_a", SPECS["A"].settings)
    assert settings.limits.of == {} and settings.under(limits).limits is limits
    assert settings.under(limits).model_dump() == settings.model_dump()


@pytest.mark.parametrize(
    ("path", "good", "bad"),
    [
        (("confidence",), [0.51, 0.99], [0.5, 1.0, 0.0]),
        (("stress", "margin"), [0.0, -0.99, 0.99], [1.0, -1.0]),
        (("stress", "alpha"), [0.001, 0.999], [0.0, 1.0]),
        (("stress", "starts"), [1], [0, -1]),
        (("horizons", "execution_horizon"), [1], [0]),
        (("horizons", "action_period_s"), [0.001], [0.0]),
        (("train_generators", "samplers"), [{"flow": {}}], [{}]),
    ],
)
def test_a_setting_of_gate_d_ends_where_it_means_nothing(path, good, bad):
    def with_(value):
        def change(params):
            for part in path[:-1]:
                params = params[part]
            params[path[-1]] = value

        return read_settings(_params(change), "gate_d", SPECS["D"].settings)

    for value in good:
        assert with_(value)
    for value in bad:
        with pytest.raises(ConfigError, match=re.escape("params.yaml: " + ".".join(path))):
            with_(value)


def test_the_same_clusters_are_drawn_whenever_a_gate_is_judged():
    settings = read_settings(_params(), "gate_d", SPECS["D"].settings)
    one, again = (settings.draws("D", "force").integers(0, 1000, 5).tolist() for _ in range(2))
    assert one == again != settings.draws("D", "latency").integers(0, 1000, 5).tolist()


def test_a_settings_file_that_is_not_there_or_says_nothing_is_a_bad_setting(tmp_path):
    with pytest.raises(ConfigError, match=r"params\.yaml"):
        read_params(tmp_path)
    (tmp_path / "moved.yaml").write_text("seed: 1")
    (tmp_path / "params.yaml").symlink_to("moved.yaml")
    with pytest.raises(ConfigError, match=r"params\.yaml"):
        read_params(tmp_path)
    (tmp_path / "params.yaml").unlink()
    for text in ("", "[1]", "seed: 1", "gate_a: [1]"):
        (tmp_path / "params.yaml").write_text(text)
        with pytest.raises(ConfigError, match="gate_a is missing"):
            section_of(read_params(tmp_path), "gate_a")


@pytest.mark.parametrize(("text", "said"), [
    ("a: 2026-11-20", r"params\.yaml: a is a date"), ("a: {b: .nan}", r"params\.yaml: a\.b is nan"),
    ("a: {b: [!!binary aGk=]}", r"params\.yaml: a\.b is a bytes"), ("1: 2", r"is the key 1,"),
    ("a: !!set {b}", r"params\.yaml: a is a set"), ("a: &x [*x]", r"a is more than 30 levels deep"),
    ("a: {null: 1}", r"params\.yaml: a is the key None"),
])  # fmt: skip
def test_what_json_cannot_say_is_bad_configuration(tmp_path, text, said):
    (tmp_path / "params.yaml").write_text(text)
    with pytest.raises(ConfigError, match=said):
        read_params(tmp_path)


@pytest.mark.parametrize(("levels", "fits"), [(30, True), (31, False)])
@pytest.mark.parametrize("kind", [dict, list])
def test_settings_are_thirty_levels_deep_at_the_most(levels, fits, kind):
    document = 1
    for _ in range(levels):
        document = {"a": document} if kind is dict else [document]
    if fits:
        return require_plain(document, where="params.yaml")
    with pytest.raises(ConfigError, match="more than 30 levels deep"):
        require_plain(document, where="params.yaml")


def test_a_place_is_named_from_the_top_of_the_file(tmp_path):
    (tmp_path / "other.yaml").write_text("a: {b: {c: [{d: .inf}]}}")
    with pytest.raises(ConfigError, match=r"params\.yaml: a\.b\.c\.d is inf, expected plain"):
        read_params(tmp_path, name="other.yaml")
    for plain in (True, None, 1, 1.5, "x", [], {}):
        require_plain({"a": [plain]}, where="params.yaml")


def test_a_home_is_one_setting_or_the_names_of_a_table():
    params = {"a": {"b": {"x": 1, "y": 2}, "c": 3}}
    assert read_settings({"g": {}, **params}, "g", _Homes).model_dump() == {
        "names": ["x", "y"], "number": 3,
    }  # fmt: skip
    for broken in ({}, {"a": 1}, {"a": {"b": {}}}):
        with pytest.raises(ConfigError, match=r"params\.yaml: a\.[bc] is missing, expected a sett"):
            read_settings({"g": {}, **broken}, "g", _Homes)


def test_a_field_that_takes_a_table_whole_takes_its_values_too():
    table = {"x": 1.5, "y": 2.0}
    for value in (table, 3.0):
        assert read_settings({"g": {}, "a": {"b": value}}, "g", _Whole).ages == value


class _Whole(GateSettings):
    homes: ClassVar = {"ages": "a.b"}
    whole: ClassVar = frozenset({"ages"})

    ages: float | dict[str, float]


class _Homes(GateSettings):
    homes: ClassVar = {"names": "a.b", "number": "a.c"}

    names: list[str]
    number: int


def test_no_limits_and_no_waivers_are_none():
    assert read_limits({"gate_a": {"limits": None}}, "A", SPECS["A"].criteria) == Limits()
    for part in ("limits", "not_applicable"):
        for wrong in ([1], "x", {"model": [1]}):
            with pytest.raises(ConfigError, match=rf"gate_a\.{part}.*owners, and under each"):
                read_limits({"gate_a": {part: wrong}}, "A", SPECS["A"].criteria)
    assert GateSettings().caveats == ()


def test_the_number_of_a_limit_or_another_one():
    limits = Limits({"a": Limit(0.5, "why", "safety"), "b": Limit(None, "why", "safety")})
    assert limits.number("a", otherwise=9.0) == 0.5
    assert limits.number("b", otherwise=9.0) == limits.number("c", otherwise=9.0) == 9.0
