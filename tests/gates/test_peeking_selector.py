"""A selector that peeks is found by what it proposes: the draw of another turn than its own.

That no selector imports what it could peek with is a contract (`tests/contracts`); this is what is
left where the contract was not asked, or the selector is handed what it sees. The selector is that
of the planted wrong, which `benchmarks/ladder_truth` runs through a whole ladder.
"""

import shutil
from types import ModuleType

import pytest
from one_flow import PARAMS, SAMPLES, folder_of, roll_out, train_flow

from benchmarks.ladder_truth.catalogue import execution
from benchmarks.ladder_truth.outcome import Stop
from benchmarks.ladder_truth.workspace import ROOT
from gates.rederive_draws import rederive_rollout_draws
from genpolicy.candidates import votes
from genpolicy.errors import RefusedError

(WRONG,) = [wrong for wrong in execution.WRONGS if wrong.name == "peeking_selector"]
DRAWN = r"candidate \d+ is (up to|drawn as) .* required what [0-9a-f]{16}… draws"
PARAMS_OF = PARAMS | {"stress": PARAMS["stress"] | {"samples": SAMPLES}}


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trained")
    return folder, train_flow(folder, seed=3)


@pytest.fixture
def root(checkpoint, tmp_path):
    shutil.copytree(checkpoint[0], folder_of(tmp_path))
    return tmp_path


def planted(monkeypatch, worth):
    """The planted selector, which is given this to see of each candidate."""
    module = ModuleType("peeking")
    exec(compile(execution.PEEKS.text(ROOT), execution.SELECTOR, "exec"), vars(module))
    module.WORTH = worth
    monkeypatch.setattr(votes, "propose", module.propose)


def leftmost(candidate):
    """How far to the right it ends: who knows where the post stands takes the other side."""
    return -float(candidate.actions[-1, 1])


def test_a_selector_that_peeks_is_refused_where_the_draws_are_drawn_again(
    root, checkpoint, tmp_path, monkeypatch
):
    planted(monkeypatch, leftmost)
    journal = roll_out(tmp_path / "flow__envelope.mcap", checkpoint)
    with pytest.raises(RefusedError, match=DRAWN) as refused:
        rederive_rollout_draws(root, PARAMS_OF, [journal])
    said = str(refused.value)
    assert "flow__envelope.mcap: flow/envelope/" in said
    assert WRONG.expected.names(Stop("D", "refusal", said))


def test_the_planted_selector_that_sees_nothing_stands(root, checkpoint, tmp_path, monkeypatch):
    """It is the order that is found, and not the plant."""
    planted(monkeypatch, lambda candidate: 0.0)
    journal = roll_out(tmp_path / "flow__envelope.mcap", checkpoint)
    rederive_rollout_draws(root, PARAMS_OF, [journal])
