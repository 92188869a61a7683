"""Which rollouts are played again: mostly successes, by a hash of everything that was written."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np

from gates import rederive_outcomes as module
from gates.played_again import Recorded


def test_most_of_a_sample_are_successes_and_one_in_the_last_moment_is_among_it():
    cells = SimpleNamespace(period_s=0.05, limit_ticks=100)

    def chosen(good, bad, *, late=0, seed=1):
        made = {f"g{n}": Recorded({}, outcome="success", end_ns=50_000_000) for n in range(good)}
        made |= {f"b{n}": Recorded({}, outcome="timeout") for n in range(bad)}
        for n in range(late):
            made[f"g{n}"] = Recorded({}, outcome="success", end_ns=100 * 50_000_000)
        found = module._asked(made, module.OF_A_JOURNAL, np.random.default_rng(seed), cells)
        return found, sum(name.startswith("g") for name in found)

    found, good = chosen(40, 40)
    assert (len(found), good) == (6, 4)
    assert [(len(f), g) for f, g in (chosen(40, 0), chosen(1, 40), chosen(2, 1), chosen(40, 1))] \
        == [(6, 6), (6, 1), (3, 2), (6, 5)]  # fmt: skip
    late, _ = chosen(40, 40, late=9)
    assert {f"g{n}" for n in range(9)} <= set(late)
    assert chosen(40, 40, seed=2)[0] != found


def test_whoever_changes_one_journal_or_the_table_draws_all_samples_anew(tmp_path, monkeypatch):
    """Else a lie in one is missed by trying out that one alone, as often as it takes."""
    folder = tmp_path / "journals"
    folder.mkdir()
    paths = [folder / f"flow__{name}.mcap" for name in ("nominal", "push")]
    for path in paths:
        path.write_bytes(b"1")
    made = {f"s/{n}": Recorded({}, outcome="success", end_ns=50_000_000) for n in range(40)}
    monkeypatch.setattr(module, "recorded_rollouts", lambda path: made)
    monkeypatch.setattr(module, "_hold", lambda cells, place, one: held.append(place))
    cells = SimpleNamespace(gate="D", execution=None, period_s=0.05, limit_ticks=100)
    found = []
    for change in (None, paths[0], paths[1], tmp_path / module.ROLLOUTS):
        if change is not None:
            change.write_bytes(b"2")
        held = []
        module.play_again(cells, paths, module.OF_A_JOURNAL)
        assert len(held) == 2 * module.OF_A_JOURNAL
        found.append([{one for one in held if one.startswith(path.name)} for path in paths])
    for before, after in pairwise(found):
        assert all(one != other for one, other in zip(before, after, strict=True))
