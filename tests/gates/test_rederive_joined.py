"""A chunk that was joined otherwise than it says is refused, however well it fits the layers.

The forger runs the whole program, the six layers and the executor included, and changes nothing
but how chunks are joined. So every event fits every other, and the checker finds nothing.
"""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from one_flow import PARAMS, SAMPLES, folder_of, roll_out, train_flow

from gates import rederive_draws as module
from gates.rederive import _held_to
from gates.rederive_draws import rederive_rollout_draws
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.selector import propose
from genpolicy.candidates.votes import join, prefix, rest_of_plan
from genpolicy.errors import RefusedError
from genpolicy.evidence.stress import joined as product
from genpolicy.execution.journal import read_journal
from genpolicy.verification.checker import check_journal

OLDEST = JoiningSettings(rule="ensemble_oldest", decay=1.0)
NEWEST = JoiningSettings(rule="ensemble_newest", decay=1.0)
RUNNING = JoiningSettings(rule="running_average", newest=0.6)
NEAREST = JoiningSettings(rule="bidirectional", decay=0.3)
GUIDED = JoiningSettings(rule="real_time")
WARM = JoiningSettings(rule="warm_start", strength=0.5)
LEAD = 6
"""Rows by which a plan lasts while the next one is made: several earlier ones speak for a row."""


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trained") / "flow"
    return folder, train_flow(folder, seed=3)


@pytest.fixture
def root(checkpoint, tmp_path):
    shutil.copytree(checkpoint[0], folder_of(tmp_path))
    return tmp_path


def params_of(joining):
    stress = PARAMS["stress"] | {"samples": SAMPLES, "joining": joining.model_dump()}
    execution = PARAMS["execution"] | {"replan_lead_rows": LEAD}
    return PARAMS | {"stress": stress, "execution": execution}


@pytest.fixture
def rolled(checkpoint, tmp_path):
    def roll(joining):
        path = tmp_path / "journals" / "flow__envelope.mcap"
        path.parent.mkdir()
        return roll_out(path, checkpoint, joining=joining, replan_lead_rows=LEAD, starts=2)

    return roll


@pytest.fixture(autouse=True)
def _all(monkeypatch):
    monkeypatch.setattr(module, "OF_A_JOURNAL", 1000)


def seen_by_the_checker(path, joining, *, motion=False):
    expected, robot = _held_to(params_of(joining))
    return check_journal(path, expected, robot if motion else None).violations


def made(path):
    return [
        event.payload
        for events in read_journal(path).values()
        for event in events
        if event.kind == "joined"
    ]


@pytest.mark.parametrize(
    "joining", [OLDEST, NEWEST, RUNNING, NEAREST, GUIDED, WARM], ids=lambda own: own.rule
)
def test_what_was_joined_as_it_says_stands(root, rolled, joining):
    path = rolled(joining)
    assert not seen_by_the_checker(path, joining, motion=True)
    parents = [len(payload["parents"]) for payload in made(path)]
    assert max(parents) == (1 if joining in (NEAREST, GUIDED, WARM) else 2), "nothing was joined"
    rederive_rollout_draws(root, params_of(joining), [path])


def leaning(drawn, index, votes, joining):
    """A blend that somebody leads a millimetre on, row by row."""
    told = join(drawn, index, votes, joining)
    led = np.array(told.actions)
    led[:, 1] += 1e-4 * np.arange(len(led)) if votes else 0.0
    return replace(told, actions=led)


def by(**changes):
    """A blend by other settings than are stated."""

    def joined(drawn, index, votes, joining):
        other = joining.model_copy(update=changes)
        return replace(join(drawn, index, votes, other), selected_by=joining.rule)

    return joined


def as_drawn(drawn, index, votes, joining):
    return propose(drawn, index)


@pytest.mark.parametrize(("joining", "forged", "said"), [
    (OLDEST, leaning, "a blend up to 0.0015 beside it"),
    (NEWEST, leaning, "a blend up to 0.0015 beside it"),
    (OLDEST, by(rule="ensemble_newest"), "beside it"),
    (NEWEST, by(rule="ensemble_oldest"), "beside it"),
    (NEWEST, by(decay=1.1), "beside it"),
    (RUNNING, leaning, "a blend up to 0.0015 beside it"),
    (RUNNING, by(newest=0.65), "beside it"),
    (NEAREST, as_drawn, "is sample"),
])  # fmt: skip
def test_a_blend_or_a_choice_that_is_another_is_refused(
    root, rolled, monkeypatch, joining, forged, said
):
    monkeypatch.setattr(product, "join", forged)
    path = rolled(joining)
    assert not seen_by_the_checker(path, joining, motion=forged is leaning)
    with pytest.raises(RefusedError, match=said):
        rederive_rollout_draws(root, params_of(joining), [path])


def nobody(self, votes):
    return []


def without_the_oldest(self, votes):
    return votes[1:]


def shorter(self, votes):
    return [replace(vote, stop=vote.stop - 1) for vote in votes if vote.stop - vote.first > 1]


def later(self, votes):
    return [replace(vote, first=vote.first + 1) for vote in votes if vote.stop - vote.first > 1]


@pytest.mark.parametrize(("joining", "forged"), [
    (OLDEST, nobody), (NEWEST, nobody), (NEAREST, nobody), (GUIDED, nobody),
    (WARM, nobody),
    (OLDEST, without_the_oldest), (NEWEST, shorter), (NEAREST, shorter), (GUIDED, shorter),
    (RUNNING, shorter), (RUNNING, without_the_oldest),
    (OLDEST, later), (NEAREST, later),
])  # fmt: skip
def test_who_had_a_say_cannot_be_chosen(root, rolled, monkeypatch, joining, forged):
    honest = product.Joined._votes

    def votes(self, metadata, *, first):
        return forged(self, honest(self, metadata, first=first))

    monkeypatch.setattr(product.Joined, "_votes", votes)
    path = rolled(joining)
    assert not seen_by_the_checker(path, joining)
    with pytest.raises(RefusedError, match=r"rests on .*, required .* by its journal"):
        rederive_rollout_draws(root, params_of(joining), [path])


def freely(votes, *, rows, frozen):
    actions, weights = prefix(votes, rows=rows, frozen=frozen)
    return actions, np.zeros_like(weights)


def elsewhere(votes, *, rows, frozen):
    actions, weights = prefix(votes, rows=rows, frozen=frozen)
    actions[:, 1] += 0.002
    return actions, weights


def fixed_shorter(votes, *, rows, frozen):
    return prefix(votes, rows=rows, frozen=frozen - 3)


def cold(votes, *, rows):
    actions, weights = rest_of_plan(votes, rows=rows)
    return actions, np.zeros_like(weights)


def beside(votes, *, rows):
    actions, weights = rest_of_plan(votes, rows=rows)
    actions[:, 1] += 0.002
    return actions, weights


def only_what_may_be_executed(votes, *, rows):
    actions, weights = rest_of_plan(votes, rows=rows)
    if votes:
        actions[votes[-1].stop :] = actions[votes[-1].stop - 1]
    return actions, weights


@pytest.mark.parametrize(("name", "rule", "forged"), [
    ("prefix", GUIDED, freely), ("prefix", GUIDED, elsewhere), ("prefix", GUIDED, fixed_shorter),
    ("rest_of_plan", WARM, cold), ("rest_of_plan", WARM, beside),
    ("rest_of_plan", WARM, only_what_may_be_executed),
])  # fmt: skip
def test_what_went_on_or_started_from_something_else_is_refused(
    root, rolled, monkeypatch, name, rule, forged
):
    monkeypatch.setattr(product, name, forged)
    path = rolled(rule)
    assert not seen_by_the_checker(path, rule)
    with pytest.raises(RefusedError, match=r"candidate \d is (up to .* beside it|drawn as \w+)"):
        rederive_rollout_draws(root, params_of(rule), [path])


def test_another_strength_than_the_stated_one_is_refused(root, rolled, monkeypatch):
    """The sampler took three steps of four, and its chunks bear the name of two."""
    monkeypatch.setattr(JoiningSettings, "starts_at", 0.75)
    path = rolled(WARM)
    monkeypatch.undo()
    monkeypatch.setattr(module, "OF_A_JOURNAL", 1000)
    with pytest.raises(RefusedError, match=r"candidate \d is (up to .* beside it|drawn as \w+)"):
        rederive_rollout_draws(root, params_of(WARM), [path])
