"""Blocks of starts: what is written is what one block gives, of the starts that were run."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from genpolicy.candidates.judged import JudgedPolicy
from genpolicy.evidence.documents.stress import BLOCKS
from genpolicy.evidence.rows.stress import RefusedRow, RolloutRow
from genpolicy.evidence.stress import in_blocks
from genpolicy.evidence.stress.latency import (
    DECLARED_TERMS,
    MEASURED_TERMS,
    DeclaredTerm,
    LatencyModel,
)
from genpolicy.evidence.stress.matched import matched_starts
from genpolicy.evidence.stress.perturbations import Nominal, QueueReorder
from genpolicy.evidence.stress.shard import Comparison
from genpolicy.evidence.stress.tables import plan_shards, write_stress
from genpolicy.evidence.stress.trainings import as_far
from genpolicy.execution.cell import Cell
from genpolicy.integrity.rows import read_rows
from genpolicy.statistics.planned_blocks import Rule
from genpolicy.verification.rollouts import derived_with_recoveries

STARTS = 4
CONDITIONS = {
    "nominal": Nominal(),
    "queue_reorder": QueueReorder(probability=0.5, magnitude_s=0.25),
}


def rule(*, block, alpha=0.2, simple=("chunked_bc",)):
    """Without bounds of counts; of four starts a candidate that wins all reaches about 7 to 1."""
    return Rule(STARTS, block, tuple(CONDITIONS), simple, 0.0, alpha, (), 0.9)


@pytest.fixture(scope="module")
def shards(task, fleet, kit):
    """The shards of a comparison, and where their journals are to lie."""
    root, trained = fleet
    judged = [
        JudgedPolicy(method, 0, root / method / "seed_0", trained[method][0], "cpu")
        for method in ("chunked_bc", "flow")
    ]
    latency = LatencyModel(
        {name: DeclaredTerm(0.001, 0.002) for name in DECLARED_TERMS},
        {name: np.full(4, 0.006) for name in MEASURED_TERMS},
        0.0,
    )
    comparison = Comparison(
        task=task.name,
        starts=tuple(s.to_json() for s in matched_starts(task, root_seed=1, count=STARTS)),
        episode_limit_s=1.0, samples=2, cell=Cell(kit.HORIZONS, kit.EXECUTION),
        feasibility=kit.FEASIBILITY, root_seed=1,
    )  # fmt: skip

    def planned(folder, conditions=None):
        return plan_shards(
            comparison, judged, conditions or CONDITIONS,
            latency=dict.fromkeys(("chunked_bc", "flow"), latency), journals=folder / "journals",
        )  # fmt: skip

    return planned


@pytest.fixture(scope="module")
def whole(shards, tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    ran = write_stress(folder, shards(folder), workers=1, scheduler="local")
    assert ran == {"chunked_bc": STARTS, "flow": STARTS}
    return folder


def files(folder):
    """Every file by its place, and its bytes."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.mark.parametrize("block", [1, 3])
def test_where_nobody_is_out_every_byte_is_that_of_one_block(shards, whole, tmp_path, block):
    """An alpha that all can still reach: blocks change how it is run, and nothing of what is."""
    found = write_stress(
        tmp_path, shards(tmp_path), workers=1, scheduler="local", rule=rule(block=block, alpha=0.9)
    )
    assert found == {"chunked_bc": STARTS, "flow": STARTS}
    written = files(tmp_path)
    blocks = BLOCKS.read(tmp_path)
    assert blocks.last == dict.fromkeys(found, -(-STARTS // block)) and blocks.out == {}
    del written[BLOCKS.file]
    assert written == files(whole) and "refused.parquet" in written


def test_who_is_out_is_run_no_further_and_with_the_last_one_all_end(shards, whole, tmp_path):
    """Nobody wins anything in a second, so that after two starts 1 in 5 is out of reach."""
    planned = shards(tmp_path)
    found = write_stress(
        tmp_path, planned, workers=1, scheduler="local", rule=rule(block=1, alpha=0.2)
    )
    assert found["flow"] == found["chunked_bc"] < STARTS
    blocks = BLOCKS.read(tmp_path)
    assert blocks.out == {"flow": "promotion_e_value"} and blocks.last == found
    rows = read_rows(tmp_path / "rollouts.parquet", RolloutRow)
    full = read_rows(whole / "rollouts.parquet", RolloutRow)
    assert rows == [row for row in full if row.start < found["flow"]]
    journals = sorted((tmp_path / "journals").iterdir())
    assert [path.name for path in journals] == sorted(shard.journal.name for shard in planned)
    derived = [row for path in journals for row in derived_with_recoveries(path)[0].values()]
    assert len(derived) == len(rows)
    assert not (tmp_path / "parts").exists()


def test_of_refused_candidates_those_stay_that_all_rollouts_of_a_shard_say(
    shards, whole, tmp_path, monkeypatch
):
    """A block alone does not know: here the rule names a start of the second one."""
    monkeypatch.setattr(in_blocks, "kept_whole", lambda rows: [row.start == 1 for row in rows])
    write_stress(
        tmp_path, shards(tmp_path), workers=1, scheduler="local", rule=rule(block=1, alpha=0.9)
    )
    every = read_rows(whole / "refused.parquet", RefusedRow)
    named = [row for row in every if row.start == 1]
    assert read_rows(tmp_path / "refused.parquet", RefusedRow) == named
    assert 0 < len(named) < len(every)


def test_how_many_processes_share_the_work_changes_no_byte(shards, tmp_path):
    own = {}
    for workers in (1, 2):
        folder = tmp_path / str(workers)
        folder.mkdir()
        nominal = {"nominal": Nominal()}
        narrow = replace(rule(block=2, alpha=0.1), conditions=("nominal",))
        write_stress(
            folder, shards(folder, nominal), workers=workers, scheduler="local", rule=narrow
        )
        own[workers] = files(folder)
    assert own[1] == own[2] and BLOCKS.file in own[1]


def test_a_simple_method_runs_on_while_any_candidate_is_in(shards, tmp_path, monkeypatch):
    """`flow` is taken for out at once, and `act` for one that may still pass."""
    planned = shards(tmp_path, {"nominal": Nominal()})
    other = [
        replace(
            shard,
            judged=replace(shard.judged, name="act"),
            journal=shard.journal.with_name("act__nominal.mcap"),
        )
        for shard in planned
        if shard.judged.name == "flow"
    ]
    asked = []

    def out(_rule, seen, name):
        asked.append((name, seen[name].starts))
        return (1, None) if name == "flow" else None

    monkeypatch.setattr(in_blocks, "first_out", out)
    (parts := tmp_path / "parts").mkdir()
    (tmp_path / "journals").mkdir()
    narrow = replace(rule(block=1), conditions=("nominal",))
    results = in_blocks.run_in_blocks(
        [*planned, *other], narrow, parts=parts, workers=1, scheduler="local"
    )
    assert [len(result.rollouts) for result in results] == [STARTS, 1, STARTS]
    assert [start for name, start in asked if name == "flow"] == [1]


def test_a_further_training_runs_as_far_as_the_first(shards, tmp_path):
    planned = shards(tmp_path)
    far = as_far(planned, {"flow": 3})
    assert {shard.judged.name: list(shard.numbers) for shard in far} == {
        "chunked_bc": [0, 1, 2, 3], "flow": [0, 1, 2],
    }  # fmt: skip
    assert [list(shard.numbers) for shard in as_far(planned, {})] == 4 * [[0, 1, 2, 3]]
    block = replace(planned[0], first=1, end=3)
    assert list(block.numbers) == [1, 2]
    shutil.rmtree(tmp_path)
