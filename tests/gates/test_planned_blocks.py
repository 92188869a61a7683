"""What blocks save: the more a candidate is worth, the further it runs."""

from pathlib import Path

import pytest

from gates import planned_blocks
from gates.planned_blocks import saved_by_blocks
from gates.report import stage_of
from gates.settings import read_params, read_settings
from gates.stress.rollouts import StressSettings

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def shipped():
    return read_settings(read_params(ROOT), stage_of("D"), StressSettings)


def test_one_block_saves_nothing(shipped):
    assert shipped.block is None and saved_by_blocks(shipped) == ()
    whole = shipped.model_copy(update={"block": shipped.planned_starts})
    assert saved_by_blocks(whole) == ()


def test_who_gains_nothing_is_stopped_and_who_is_worth_it_runs_on(shipped, monkeypatch):
    monkeypatch.setattr(planned_blocks, "TRIALS", 60)
    settings = shipped.model_copy(update={"block": 15})
    none, margin, good = saved_by_blocks(settings)
    assert [one.candidate_success for one in (none, margin, good)] == [0.5, 0.55, 0.8]
    assert none.ran_share <= margin.ran_share < good.ran_share
    assert none.stopped_share >= margin.stopped_share > good.stopped_share
    # Decision 228, asked behind every start: 66 and 69 of 90 starts; a block waits for its end.
    assert none.ran_share == pytest.approx(66 / 90 + 7 / 90, abs=0.06)
    assert good.ran_share > 0.95
    assert saved_by_blocks(settings) == (none, margin, good)


def test_smaller_blocks_stop_no_later(shipped, monkeypatch):
    monkeypatch.setattr(planned_blocks, "TRIALS", 30)
    shares = [
        saved_by_blocks(shipped.model_copy(update={"block": block}))[0].ran_share
        for block in (5, 15, 45)
    ]
    assert shares == sorted(shares) and shares[0] < shares[-1]
