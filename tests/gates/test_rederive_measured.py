"""Counts of modes that no checkpoint gives are refused by name, wherever in a table they stand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gates import rederive_measured as module
from genpolicy.errors import RefusedError
from genpolicy.evidence.need.held_out import HeldOut
from genpolicy.evidence.rows.need import ModeRow
from genpolicy.integrity.rows import write_rows

ROW = ModeRow(
    method="bc_noise", seed=0, convention="offset", episode_uuid="", index=3, samples=16,
    modes_present=2, modes_covered=2, between_modes=3, far_from_modes=1, admissible=9, valid=8,
    modes_valid=2, fewest_admissible=4, nfe=1, spread_m=0.01,
)  # fmt: skip
PLACES = [(f"e{n:02}", 3) for n in range(30)]
PATH = "modes.parquet"


def true_rows(names=("bc_noise", "chunked_bc")):
    return [replace(ROW, method=name, episode_uuid=uuid) for name in names for uuid, _ in PLACES]


@pytest.fixture
def hold(tmp_path, monkeypatch):
    """Holds rows against two checkpoints that give the true ones."""
    situations = tuple(SimpleNamespace(episode_uuid=uuid, index=at) for uuid, at in PLACES)
    held_out = HeldOut(situations, np.arange(float(len(PLACES)))[:, None])
    policies = {name: SimpleNamespace(horizons=SimpleNamespace(observation_horizon=2), name=name)
                for name in ("bc_noise", "chunked_bc")}  # fmt: skip
    asked = []

    def again(policy, held_out, *, seed, convention, samples, **_):
        assert (seed, convention, samples) == (0, "offset", 16)
        asked.append([s.episode_uuid for s in held_out.situations])
        return [replace(ROW, method=policy.name, episode_uuid=s.episode_uuid)
                for s in held_out.situations]  # fmt: skip

    monkeypatch.setattr(module, "modes_of_policy", again)
    bench = SimpleNamespace(
        gate="A", root=tmp_path, params={}, task=None, checker=None, held_out=lambda _: held_out,
        horizons=SimpleNamespace(observation_horizon=2),
    )  # fmt: skip

    def holds(rows, **more):
        write_rows(tmp_path / PATH, ModeRow, rows)
        known = {**policies, **more}
        groups = iter([((name, 0, "offset"), policy) for name, policy in known.items()])
        module._hold(bench, PATH, ModeRow, groups, lambda _: 16)
        return asked

    return holds


def test_true_rows_are_asked_again_at_a_sample_that_all_tables_choose(hold, tmp_path):
    first, second = hold(true_rows())[:2]
    assert len(first) == module.OF_A_TABLE and first == second
    other = [replace(row, spread_m=0.02) for row in true_rows()]
    assert hold(other)[-1] != first
    (tmp_path / PATH).with_name("beside.parquet").write_bytes(b"2")
    assert hold(true_rows())[-1] != first


def test_a_row_within_one_sample_is_rounding_and_all_of_a_policy_are_not(hold):
    one_off = true_rows()
    one_off = [replace(row, valid=row.valid - (row.episode_uuid in ("e00", "e01", "e02")))
               for row in one_off]  # fmt: skip
    hold(one_off)
    everywhere = [replace(row, valid=row.valid - 1) for row in true_rows()]
    with pytest.raises(RefusedError, match=r"bc_noise.*modes is 16 counts otherwise at 16"):
        hold(everywhere)


@pytest.mark.parametrize("column", [*module.EXACT, *module.COUNTED])
def test_a_count_that_its_checkpoint_does_not_give_is_refused_by_name(hold, column):
    forged = [replace(row, **{column: getattr(row, column) + 2}) for row in true_rows()]
    with pytest.raises(RefusedError, match=rf"bc_noise \(seed 0\) by offset at e\d\d.*: {column}"):
        hold(forged)


@pytest.mark.parametrize("column", module.EXACT)
def test_what_is_no_count_of_samples_is_held_exactly(hold, column):
    forged = [replace(row, **{column: getattr(row, column) + 1}) for row in true_rows()]
    with pytest.raises(RefusedError, match=f": {column} is"):
        hold(forged)


def test_every_situation_has_one_row_of_everybody(hold):
    rows = true_rows()
    with pytest.raises(RefusedError, match=r"chunked_bc.* at e29, row 3 is no row"):
        hold(rows[:-1])
    with pytest.raises(RefusedError, match="is a row, required one row of"):
        hold([*rows, replace(rows[0], episode_uuid="another")])
    with pytest.raises(RefusedError, match="e00, row 3 is stated twice"):
        hold([rows[0], *rows])
    with pytest.raises(RefusedError, match=r"bc_noise.*e00, row 3 is no row"):
        hold(true_rows(["chunked_bc"]))


def test_rows_of_nobody_are_refused(hold):
    with pytest.raises(RefusedError, match=r"act .*nobody of that name"):
        hold(true_rows(["bc_noise", "chunked_bc", "act"]))


def test_of_evaluations_a_table_may_state_more_and_no_less(hold):
    hold([replace(row, nfe=2) for row in true_rows()])
    with pytest.raises(RefusedError, match="nfe is 0, required 1 or more"):
        hold([replace(row, nfe=0) for row in true_rows()])


def test_of_who_answers_otherwise_each_time_only_the_rows_are_asked_for(hold):
    rows = true_rows(["bc_noise", "chunked_bc", "restless"])
    forged = [replace(row, valid=0) if row.method == "restless" else row for row in rows]
    hold(forged, restless=None)
    with pytest.raises(RefusedError, match=r"restless.* at e29, row 3 is no row"):
        hold(forged[:-1], restless=None)
