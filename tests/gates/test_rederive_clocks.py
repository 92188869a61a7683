"""What Gate D prints of the two clocks is what their journals say, whoever recorded it."""

import shutil
from pathlib import Path

import pytest
import yaml
from makers import maker, write_policy

from gates import rederive as module
from gates.rederive_clocks import rederive_clocks
from gates.stress.clocks import WALL_CLOCK
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.data.dataset import load_dataset
from genpolicy.errors import BadInputError, RefusedError
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.rows.clocks import ClockAgeRow, ClockInvocationRow, ClockTickRow
from genpolicy.evidence.shadow.tables import checked
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.execution.executor import Executor
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.execution.stub import ControllerStub
from genpolicy.execution.supervisor import Supervisor
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.rows import write_rows
from genpolicy.integrity.tables import read_table, write_table
from genpolicy.tasks.api import load_task
from genpolicy.verification.checker import check_journal
from genpolicy.verification.clocks import derived_windows
from genpolicy.wall_clock import bench
from genpolicy.wall_clock.bench import WallClockSection, windows

PARAMS = yaml.safe_load((Path(__file__).parents[2] / "params.yaml").read_text())
PARAMS["wall_clock"] = {"episodes": 2, "rows": 5}
TASK = load_task("tabletop_insertion")
EXECUTION = ExecutionSettings(**PARAMS["execution"])
HELD_TO = module._held_to(PARAMS)
TABLES = {"invocations": ClockInvocationRow, "ages": ClockAgeRow, "ticks": ClockTickRow}


def window(clock, replay, *, made_by="flow", row=0):
    """A window in which the policy never answers."""
    episode = replay.episode_uuid
    labels = {"method": "flow", "episode": episode}
    journal = Journal(f"flow/{clock}/{episode}", labels)
    cell = Cell(HorizonConfig(**PARAMS["horizons"]), EXECUTION)
    supervisor = Supervisor(EXECUTION, journal)
    executor = Executor(cell, journal, ControllerStub(cell, journal, supervisor))
    executor.set_active(0.0, *maker(made_by))
    executor.controller(0.0, cell.controller_mode)
    for tick in range(5):
        now_s = tick * cell.horizons.action_period_s
        executor.observe(now_s, now_s, "approach", "epoch_1", 0.0)
        executor.tick(now_s)
        if tick == 0:
            journal.scene(now_s, TASK.scene_poses(replay.observation_rows[row]))
            executor.begin_invocation(now_s, f"{clock}/{episode}")
        elif tick == 3:
            executor.end_invocation(now_s, f"{clock}/{episode}", "deadline")
    executor.end_episode(0.2)
    return journal


def drawn(root, seed=PARAMS["seed"]):
    section = WallClockSection(**PARAMS["wall_clock"])
    return windows(load_dataset(root / "artifacts/ingest"), TASK, section, root_seed=seed)


def write(root, replays=None, **changes):
    """Journals of both clocks, and what they say."""
    folder = root / WALL_CLOCK
    replays = drawn(root) if replays is None else replays
    (folder / "journals").mkdir(parents=True)
    paths = []
    for clock in ("wall", "virtual"):
        path = folder / "journals" / f"flow__{clock}.mcap"
        write_journal(path, [window(clock, replay, **changes) for replay in replays])
        paths.append(path)
    found = derived_windows(paths, deadline_s=EXECUTION.deadline_s)
    for name, row in TABLES.items():
        rows = [row(**columns) for columns in getattr(found, name)]
        write_rows(folder / f"{name}.parquet", row, rows)
    documents = {path.name: check_journal(path, *HELD_TO).as_document() for path in paths}
    CHECKER.write(folder, checked(documents))
    return root


@pytest.fixture
def place(dataset, tmp_path, monkeypatch):
    """A workspace with a dataset, of whose few episodes those that train are replayed."""
    monkeypatch.setattr(bench, "HELD_OUT", "train")
    shutil.copytree(dataset, tmp_path / "artifacts/ingest")
    write_policy(tmp_path, "flow")
    return tmp_path


@pytest.fixture
def root(place):
    return write(place)


@pytest.fixture
def e1(root):
    return drawn(root)[0].episode_uuid


def edit(root, name, change):
    path = root / WALL_CLOCK / f"{name}.parquet"
    table = read_table(path)
    write_table(path, table.from_pylist(change(table.to_pylist()), schema=table.schema))


def test_true_evidence_stands(root):
    rederive_clocks(root, PARAMS, HELD_TO)
    rows = read_table(root / WALL_CLOCK / "invocations.parquet").to_pylist()
    assert [row["missed"] for row in rows] == [True] * 4


def test_where_no_clock_was_compared_there_is_nothing_to_derive(tmp_path):
    rederive_clocks(tmp_path, PARAMS, HELD_TO)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda own, other: own[:1], "replays is "),
        (lambda own, other: own[::-1], "replays is "),
        (lambda own, other: other, "replays is |asked at another scene"),
        (lambda own, other: [own[0], own[1].model_copy(update={
            "observations": other[0].observations})], "asked at another scene"),
    ],
)  # fmt: skip
def test_windows_that_were_chosen_are_refused(place, change, said):
    chosen = change(drawn(place), drawn(place, seed=PARAMS["seed"] + 1))
    write(place, chosen)
    with pytest.raises(RefusedError, match=said):
        rederive_clocks(place, PARAMS, HELD_TO)


def test_a_first_ask_may_come_at_a_later_row_of_its_window(place):
    """A tick may be missed by the wall clock."""
    rederive_clocks(write(place, row=3), PARAMS, HELD_TO)


def test_a_miss_that_was_taken_back_is_refused_by_name(root):
    edit(root, "invocations", lambda rows: [rows[0] | {"missed": False}, *rows[1:]])
    with pytest.raises(RefusedError, match=r"flow/\w+/[\w-]+/0: missed is False"):
        rederive_clocks(root, PARAMS, HELD_TO)


def test_an_episode_that_was_left_out_is_refused(root):
    edit(root, "ticks", lambda rows: rows[1:])
    with pytest.raises(RefusedError, match="only in a journal"):
        rederive_clocks(root, PARAMS, HELD_TO)


def test_an_age_that_no_journal_has_is_refused(root, e1):
    key = {"method": "flow", "clock": "wall", "episode": e1, "invocation": 0}
    edit(root, "ages", lambda rows: [*rows, key | {"row": 1, "age_s": 0.05}])
    with pytest.raises(RefusedError, match="without a journal"):
        rederive_clocks(root, PARAMS, HELD_TO)


def test_a_finding_of_the_checker_is_made_again(root):
    folder = root / WALL_CLOCK
    stated = CHECKER.plain(CHECKER.read(folder))
    stated["checked_actions"] += 1
    write_bytes(folder / CHECKER.file, canonical_json(stated))
    with pytest.raises(RefusedError, match="checked_actions"):
        rederive_clocks(root, PARAMS, HELD_TO)


def test_windows_of_another_policy_are_refused(place):
    write_policy(place, "bc")
    write(place, made_by="bc")
    with pytest.raises(RefusedError, match="made by"):
        rederive_clocks(place, PARAMS, HELD_TO)


def test_a_damaged_journal_is_bad_input(root):
    path = root / WALL_CLOCK / "journals" / "flow__wall.mcap"
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(BadInputError, match="no journal"):
        rederive_clocks(root, PARAMS, HELD_TO)


def test_gate_d_asks_for_it(root, monkeypatch):
    asked = []
    monkeypatch.setattr(module, "rederive_clocks", lambda *given: asked.append(given))
    for name in ("rederive_checked", "_tables", "rederive_sessions", "rederive_latency",
                 "rederive_disturbance", "rederive_rollout_draws", "rederive_distilled",
                 "_envelope", "_power", "rederive_trainings"):  # fmt: skip
        monkeypatch.setattr(module, name, lambda *given: None)
    (root / "params.yaml").write_text(yaml.safe_dump(PARAMS))
    module.rederive(root, "D")
    assert len(asked) == 1
