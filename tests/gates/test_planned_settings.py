"""The plan leaves out nothing of `params.yaml` that can make other evidence or another verdict."""

import copy
from pathlib import Path

import pytest

from gates.planned_settings import (
    COSTS,
    IF_STATED,
    OPEN,
    PLANNED,
    SECTIONS,
    SECTIONS_STRICT,
    UNMATCHED,
)
from gates.preregistration import asked_by, moves, plan_of
from gates.settings import read_params

ROOT = Path(__file__).parents[2]
FREE = {
    "compute.workers": "how many processes share the work; no byte hangs on it",
    "compute.scheduler": "which machine they run on; no byte hangs on it",
    "card.name": "how the card is called, filled in behind the rollouts",
    "card.authors": "who made the candidate; git says it too, and a team is named when it signs",
}
"""What no plan names, and why."""


def _settings(value, path=()):
    """Every setting by its path; a limit is its number, since reasons and owners are free."""
    if isinstance(value, dict) and value:
        for name, inner in value.items():
            yield from _settings(inner, (*path, name))
    else:
        yield path


def _moved(change):
    params = copy.deepcopy(read_params(ROOT))
    plan = plan_of(read_params(ROOT))
    change(params)
    return {move.place: move.kind for move in moves(plan, params)}


def _put(params, path, value):
    for part in path[:-1]:
        params = params.setdefault(part, {})
    params[path[-1]] = value


def test_whatever_moves_in_the_settings_shows_or_is_named_with_its_reason():
    unseen = [
        ".".join(path)
        for path in _settings(read_params(ROOT))
        if not _moved(lambda params, path=path: _put(params, path, "another"))
    ]
    assert sorted(unseen) == sorted(FREE)


@pytest.mark.parametrize("section", SECTIONS)
def test_a_setting_that_stood_at_its_default_shows_when_it_is_put_in(section):
    """`policy.training` names four of a dozen; the learning rate is no less one of the plan."""
    if isinstance(read_params(ROOT).get(section), dict):
        found = _moved(lambda params: _put(params, (section, "inner", "one_more"), 1))
        assert found == {f"{section}.inner.one_more": "changed"}


@pytest.mark.parametrize(
    ("path", "value", "gate"),
    [
        ("rehearsal", True, "A"), ("source.path", "elsewhere", "A"), ("task.name", "other", "A"),
        ("policy.training.warmup_updates", 0, "A"), ("policy.training.validation_every", 8000, "A"),
        ("policy.training.learning_rate", 0.1, "A"), ("compute.device", "cuda", "A"),
        ("reload.sweep.flow", [1], "B"), ("card.failure_search.evaluations", 0, "D"),
        ("monitors.alpha", 0.5, "D"),
    ],
)  # fmt: skip
def test_what_is_strict_on_neither_side_changed(path, value, gate):
    ((place, kind),) = _moved(lambda params: _put(params, path.split("."), value)).items()
    assert path.startswith(place) and (kind, asked_by(place)) == ("changed", gate)


@pytest.mark.parametrize(
    "path",
    ["wall_clock.episodes", "monitors.threshold_starts", "monitors.judged_starts",
     "monitors.probe_starts"],
)  # fmt: skip
def test_of_what_is_counted_fewer_are_looser(path):
    assert _moved(lambda params: _put(params, path.split("."), 1)) == {path: "loosened"}
    assert _moved(lambda params: _put(params, path.split("."), 999)) == {path: "tightened"}


def test_an_exception_more_is_looser_and_one_fewer_tighter():
    excepted = {"mine": {"owner": "ann", "reason": "larger", "expires": "2027-01-01"}}
    plan = plan_of(read_params(ROOT))
    params = copy.deepcopy(read_params(ROOT))
    params["gate_b"]["unmatched"] = excepted
    assert [(m.place, m.kind) for m in moves(plan, params)] == [(UNMATCHED, "loosened")]
    (move,) = moves(plan_of(params), read_params(ROOT))
    assert (move.place, move.kind) == (UNMATCHED, "tightened")
    later = copy.deepcopy(params)
    later["gate_b"]["unmatched"]["mine"]["expires"] = "2028-01-01"
    (move,) = moves(plan_of(params), later)
    assert (move.place, move.kind) == (UNMATCHED, "changed")


def test_a_cost_of_a_monitor_has_no_looser_side_and_its_reason_is_free():
    def cost(place, value):
        def change(params):
            params["gate_d"][COSTS]["model"]["false_alarm"][place] = value

        return change

    assert _moved(cost(0, 9)) == {f"gate_d.{COSTS}.false_alarm": "changed"}
    assert _moved(cost(1, "other words")) == {}
    dropped = _moved(lambda params: params["gate_d"][COSTS]["model"].pop("false_alarm"))
    assert dropped == {f"gate_d.{COSTS}.false_alarm": "changed"}


def test_no_setting_is_named_twice():
    plan = plan_of(read_params(ROOT))
    for whole in (*PLANNED, *IF_STATED):
        assert not [place for place in plan if place.startswith(f"{whole}.")]


def test_every_strict_side_belongs_to_a_section_that_is_planned_whole():
    assert {place.partition(".")[0] for place in SECTIONS_STRICT} <= set(SECTIONS)
    assert set(OPEN) <= set(PLANNED)
