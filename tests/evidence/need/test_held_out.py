"""Held-out situations: the right rows, and errors for rows that are not there."""

import numpy as np
import pytest

from genpolicy.errors import ContractError
from genpolicy.evidence.admission_context import admissible
from genpolicy.evidence.need import held_out
from genpolicy.evidence.need.held_out import (
    admissible_chunks,
    held_out_situations,
    modes_of_policy,
)
from genpolicy.policies.protocol import Samples


def rows_of(data, number):
    """Observations of one episode, cut without the code under test."""
    lengths = data.episodes["rows"].to_numpy()
    first = int(lengths[:number].sum())
    return data.frames.observation[first : first + int(lengths[number])]


def test_each_situation_gets_its_own_history(data, kit, tmp_path):
    names = kit.uuids(data)
    audit = kit.write_situations(tmp_path / "audit", [(names[8], 5, {}), (names[9], 0, {})])
    found = held_out_situations(audit, data, horizons=kit.HORIZONS)
    by_name = dict(zip([s.episode_uuid for s in found.situations], found.observations, strict=True))
    np.testing.assert_array_equal(by_name[names[8]], rows_of(data, 8)[4:6])
    # At the first row there is nothing earlier: it is repeated, no other episode looks in.
    np.testing.assert_array_equal(by_name[names[9]], rows_of(data, 9)[[0, 0]])


def test_one_situation_per_episode_and_phase_and_only_persistent_ones(data, kit, tmp_path):
    name = kit.uuids(data)[9]
    audit = kit.write_situations(
        tmp_path / "audit",
        [
            (name, 7, {}), (name, 3, {}), (name, 9, {"phase": "align"}),
            (name, 1, {"persistent": False}), (name, 2, {"two_mode": False}),
            (name, 0, {"split": "train"}),
        ],
    )  # fmt: skip
    found = held_out_situations(audit, data, horizons=kit.HORIZONS)
    assert [(s.phase, s.index) for s in found.situations] == [("align", 9), ("approach", 3)]


@pytest.mark.parametrize(("number", "index"), [(None, 0), (0, -1), (0, 10_000)])
def test_a_row_that_the_dataset_does_not_have_is_refused(data, kit, tmp_path, number, index):
    name = "nobody" if number is None else kit.uuids(data)[number]
    audit = kit.write_situations(tmp_path / "audit", [(name, index, {})])
    with pytest.raises(ContractError, match=f"situation {name}, row {index} is not in the dataset"):
        held_out_situations(audit, data, horizons=kit.HORIZONS)


def test_no_situation_gives_no_row(data, kit, tmp_path, policy, task, checker):
    audit = kit.write_situations(
        tmp_path / "audit", [(kit.uuids(data)[0], 0, {"persistent": False})]
    )
    found = held_out_situations(audit, data, horizons=kit.HORIZONS)
    rows = modes_of_policy(
        policy, found, seed=0, convention="x", samples=2, task=task, checker=checker,
    )  # fmt: skip
    assert rows == []


def test_rows_count_modes_and_samples(data, kit, tmp_path, policy, task, checker):
    audit = kit.write_situations(
        tmp_path / "audit", [(kit.uuids(data)[8], 4, {}), (kit.uuids(data)[9], 4, {})]
    )
    found = held_out_situations(audit, data, horizons=kit.HORIZONS)
    rows = modes_of_policy(
        policy, found, seed=3, convention="euler", samples=4, task=task, checker=checker,
    )  # fmt: skip
    assert len(rows) == 2
    for row in rows:
        assert (row.method, row.seed, row.convention) == ("flow", 3, "euler")
        assert row.samples == 4 and row.nfe == 2 and row.modes_present == 2
        assert 0 <= row.modes_covered <= 2
        assert 0 <= row.between_modes + row.admissible <= 8
        assert 0 <= row.modes_valid <= row.valid <= row.admissible
        assert row.spread_m > 0


def test_a_mode_counts_the_samples_that_reach_it_and_may_be_executed(
    data, kit, tmp_path, policy, task, checker, monkeypatch
):
    """Left three times, once inadmissible; right twice; between, far away: the fewest is two."""
    name = kit.uuids(data)[9]
    audit = kit.write_situations(tmp_path / "audit", [(name, 0, {})])
    found = held_out_situations(audit, data, horizons=kit.HORIZONS)
    side = [1.0, 1.0, 1.0, -1.0, -1.0, 0.0, 5.0]
    chunks = np.zeros((7, 16, 10))
    chunks[:, :, 1] = 0.1 * np.array(side)[:, None]
    verdicts = [True, True, False, True, True, True, True]

    def drawn(observations, *, noise_names, candidates):
        return Samples(chunks[None], nfe=2)

    monkeypatch.setattr(policy, "sample", drawn)
    monkeypatch.setattr(held_out, "admissible_chunks", lambda *_, **__: np.array(verdicts))
    asked = {"seed": 0, "convention": "euler", "samples": 7, "task": task, "checker": checker}
    (row,) = modes_of_policy(policy, found, **asked)
    assert (row.between_modes, row.far_from_modes, row.admissible) == (1, 1, 6)
    assert (row.modes_covered, row.fewest_admissible) == (2, 2)
    verdicts[3] = verdicts[4] = False
    (row,) = modes_of_policy(policy, found, **asked)
    assert (row.modes_covered, row.fewest_admissible) == (2, 0)


def demonstrated(data, number, index, steps=16):
    lengths = data.episodes["rows"].to_numpy()
    first = int(lengths[:number].sum())
    return (
        data.frames.action[first + index : first + index + steps],
        data.frames.observation[first + index],
    )


def test_a_demonstrated_chunk_is_admissible_and_its_damage_is_named(data, kit, task, checker):
    actions, observation = demonstrated(data, 9, 0)
    keywords = {"action_period_s": 0.05}
    assert admissible(task, checker, actions, observation, **keywords) == (True, "")
    broken = np.array(actions)
    broken[3, 0] = np.nan
    far = np.array(actions)
    far[:, 0] += 0.5
    chunks = np.stack([actions, broken, far])
    passed = admissible_chunks(task, checker, chunks, observation, **keywords)
    assert passed.tolist() == [True, False, False]
    verdict, reason = admissible(task, checker, broken, observation, **keywords)
    assert not verdict and reason == "representation: finite"
