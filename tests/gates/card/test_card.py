"""The card: limits checked on every side, and days at their borders."""

import datetime
from dataclasses import replace

import pytest
from evidence import edit_document
from team import FILLED

from gates.card.card import (
    CardSettings,
    TrialCard,
    envelope_violations,
    missing_fields,
    promoted,
    validity,
)
from gates.card.envelope import beyond_simulation, simulated_envelope
from gates.card.signing import read_draft
from gates.claim import CHECKPOINT_ONLY
from gates.evidence import Evidence
from gates.report import parse_section, read_report
from genpolicy.errors import ConfigError, IntegrityError, RefusedError


@pytest.fixture
def draft(team):
    return read_draft(team.root)


@pytest.fixture
def simulated(team):
    return simulated_envelope(Evidence(team.root))


@pytest.fixture
def card(draft):
    return TrialCard.model_validate({**draft.model_dump(), **FILLED})


def test_a_card_allows_exactly_what_was_simulated(draft, simulated, card):
    assert envelope_violations(card, draft, simulated) == []
    for change in (
        {"workspace_lower_m": (0.2, -0.2, 0.03)},
        {"workspace_lower_m": (0.36, -0.2, 0.03)},
        {"workspace_upper_m": (0.7, 0.2, float("nan"))},
        {"speed_limit_m_s": 0.24},
        {"speed_limit_m_s": float("nan")},
        {"robot_model": "fr3"},
        {"force_limit_n": None},
        {"force_limit_n": float("nan")},
        {"force_limit_n": 80.1},
        {"force_limit_n": 5000.0},
        {"candidate": "another"},
        {"abort_thresholds": {}},
        {"abort_thresholds": {**draft.abort_thresholds, "latency_s": -1.0}},
        {"abort_thresholds": {**draft.abort_thresholds, "mood": 0.0}},
        {"force_limit_n": 1e9},
        {"force_limit_n": 1e308},
        {"workspace_lower_m": tuple(high - 1e-12 for high in draft.workspace_upper_m)},
    ):
        assert envelope_violations(card.model_copy(update=change), draft, simulated), change


def test_a_threshold_that_the_draft_lacks_is_missing_on_the_card(draft, simulated, card):
    for name in draft.abort_thresholds:
        less = {key: value for key, value in draft.abort_thresholds.items() if key != name}
        changed = draft.model_copy(update={"abort_thresholds": less})
        bad = envelope_violations(card, changed, simulated)
        assert bad == [f"abort_thresholds.{name}"]
    empty = {"abort_thresholds": {}}
    bad = envelope_violations(
        card.model_copy(update=empty), draft.model_copy(update=empty), simulated
    )
    assert len(bad) == len(draft.abort_thresholds) > 0


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("commands", 0, "was not run"),
        ("fastest_m_s", 0.251, "0.251 m/s"),
        ("fastest_m_s", None, "nan m/s"),
        ("fastest_m_s", -0.1, "-0.1 m/s"),
        ("lowest_m", [0.34, -0.18, 0.03], "in x"),
        ("lowest_m", None, "in x"),
        ("highest_m", None, "in z"),
        ("highest_m", [0.35, 0.2, 0.25], "in x"),
        ("highest_m", [0.69, 0.201, 0.25], "in y"),
    ],
)
def test_commands_beyond_the_envelope_void_it(team, key, value, text):
    def change(document):
        document["reached"]["flow"][key] = value

    edit_document(team.root, "stress/envelope.json", change)
    simulated = simulated_envelope(Evidence(team.root))
    assert any(text in found for found in beyond_simulation(simulated, "flow"))
    assert beyond_simulation(simulated, "diffusion") == []
    assert "was not run" in beyond_simulation(simulated, "another")[0]


def test_a_workspace_of_nothing_holds_no_rollout(simulated):
    """Planned so, and the rollouts as they were: each of them left it."""
    low = simulated.workspace_lower_m
    point = replace(simulated, workspace_upper_m=tuple(value + 1e-12 for value in low))
    assert [text for text in beyond_simulation(point, "flow") if "outside the workspace" in text]


def test_an_envelope_looser_than_the_task_is_none(team):
    def change(identity):
        identity["workspace_m"][1][2] = 0.24

    edit_document(team.root, "task/identity.json", change)
    found = beyond_simulation(simulated_envelope(Evidence(team.root)), "flow")
    assert found == ["workspace z not inside the task's"]


@pytest.mark.parametrize("missing", ["stress/envelope.json", "task/identity.json"])
def test_without_rollouts_inside_an_envelope_there_is_no_card(team, missing):
    (team.root / "artifacts" / missing).unlink()
    with pytest.raises(IntegrityError, match="no envelope"):
        simulated_envelope(Evidence(team.root))
    report = team.judge()
    assert report.verdict in ("FAIL", "INCONCLUSIVE")
    assert {c.id for c in report.criteria if c.verdict == "FAIL"} >= {"upstream_passed"}


SAID = [name for name in TrialCard.model_fields if name not in ("caveats", "schema_version")]


@pytest.mark.parametrize("name", SAID)
def test_every_field_but_the_caveats_is_required(card, name):
    assert missing_fields(card) == []
    value = getattr(card, name)
    if not isinstance(value, float) and not name.startswith("workspace"):
        for empty in {str: ["", "  "], dict: [{}], tuple: [()]}[type(value)]:
            assert missing_fields(card.model_copy(update={name: empty})) == [name]
    if name == "force_limit_n":
        assert missing_fields(card.model_copy(update={name: None})) == [name]


@pytest.mark.parametrize("name", ["spotter", "stop_path", "force_limit_reason", "nonce"])
@pytest.mark.parametrize(
    "text", ["\u200b" * 16, "\u00ad", "\u2060\u2060", "-" * 15, "...", "\u3164", "mo\u200b",
             "a\u202eb", "\x00" * 16],
)  # fmt: skip
def test_a_text_that_shows_nothing_or_hides_something_is_empty(card, name, text):
    assert missing_fields(card.model_copy(update={name: text})) == [name]


def test_other_scripts_and_several_lines_say_something(card):
    for text in ("Ümit Özdağ", "佐藤", "left of the cell\nat the door", "2nd button, red"):
        assert missing_fields(card.model_copy(update={"stop_path": text})) == []


@pytest.mark.parametrize("text", ["Sam", "sam s.", "sa\u0301m", "<b>sam</b>", "sam\n", "s\u0430m"])
def test_a_spotter_who_is_no_id_of_a_list_is_missing(card, text):
    assert missing_fields(card.model_copy(update={"spotter": text})) == ["spotter"]


def test_both_days_count(card):
    def on(day, first="2026-11-01", last="2026-11-30", days=30):
        dated = card.model_copy(update={"not_before": first, "expires": last})
        return validity(dated, today=datetime.date.fromisoformat(day), maximum_days=days)[0]

    assert on("2026-11-01") and on("2026-11-30")
    assert not on("2026-10-31") and not on("2026-12-01")
    assert on("2026-11-05", days=30) and not on("2026-11-05", days=29)
    assert not on("2026-11-05", last="2026-12-01")
    assert on("2026-11-05", "2026-11-05", "2026-11-05", 1)
    assert not on("2026-11-05", "2026-11-06", "2026-11-05")
    assert not on("2026-11-05", last="2026-11-31")  # no day of the calendar
    assert not on("2026-11-05", last="20261130")


@pytest.mark.parametrize(
    ("key", "value"),
    [("commands", 1), ("fastest_m_s", 0.0), ("highest_m", [0.36, -0.18, 0.03])],
)
def test_a_candidate_that_hardly_moves_stays_inside(team, key, value):
    """One command, at no speed, at one point: little, but nothing beyond."""
    edit_document(
        team.root, "stress/envelope.json", lambda d: d["reached"]["flow"].__setitem__(key, value)
    )
    assert beyond_simulation(simulated_envelope(Evidence(team.root)), "flow") == []


def test_the_whole_workspace_of_the_task_is_inside_it_and_a_flat_one_is_none(simulated):
    whole = {
        "task_lower_m": simulated.workspace_lower_m,
        "task_upper_m": simulated.workspace_upper_m,
    }
    assert beyond_simulation(replace(simulated, **whole), "flow") == []
    x, y, _ = simulated.workspace_upper_m
    flat = {"workspace_upper_m": (x, y, simulated.workspace_lower_m[2])}
    found = beyond_simulation(replace(simulated, **flat), "flow")
    assert "workspace z not inside the task's" in found


def test_borders_of_what_people_fill_in(draft, simulated, card):
    def with_(**changes):
        changed = card.model_copy(update=changes)
        return missing_fields(changed) + envelope_violations(changed, draft, simulated)

    assert with_(nonce="0123456789abcdef") == [] and with_(nonce="0123456789abcde") == ["nonce"]
    assert with_(force_limit_n=0.5) == [] == with_(force_limit_n=80.0)
    assert with_(abort_thresholds=dict.fromkeys(draft.abort_thresholds, 0.0)) == []
    three = {key: value for key, value in card.reports.items() if key != "D"}
    assert with_(reports=three) == ["reports"]


def test_only_a_passing_method_of_a_passing_gate_is_promoted(team):
    report = read_report(team.root, "D")[0]
    assert promoted(report) == "flow"
    for change in (
        {"verdict": "FAIL"},
        {"promoted": None},
        {"candidates": {**report.candidates, "flow": "FAIL"}},
        {"promoted": "another"},
    ):
        with pytest.raises(RefusedError, match="promoted"):
            promoted(report.model_copy(update=change))


def test_the_first_caveat_of_a_draft_is_what_was_tested(draft):
    assert draft.caveats[0] == CHECKPOINT_ONLY


def test_a_card_is_of_a_task_that_has_a_name():
    section = {"name": "trial", "authors": ["ada"], "task": "t"}
    assert parse_section(CardSettings, section, where="card").task == "t"
    with pytest.raises(ConfigError, match=r"card\.task"):
        parse_section(CardSettings, {**section, "task": ""}, where="card")


@pytest.mark.parametrize(("beyond", "inside"), [(0.9e-6, True), (1.1e-6, False)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_rounding_of_a_command_is_a_millionth_and_no_more(simulated, axis, beyond, inside):
    reached = simulated.reached["flow"]
    lowest, highest = list(simulated.workspace_lower_m), list(simulated.workspace_upper_m)
    lowest[axis] -= beyond
    highest[axis] += beyond
    for change in (
        {"lowest_m": tuple(lowest)},
        {"highest_m": tuple(highest)},
        {"fastest_m_s": simulated.speed_limit_m_s * (1 + beyond)},
    ):
        other = replace(simulated, reached={"flow": replace(reached, **change)})
        assert (beyond_simulation(other, "flow") == []) is inside, change
