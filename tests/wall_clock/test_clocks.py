"""The same windows by both clocks, in real processes; nothing is judged by how long it took."""

import sys

import numpy as np
import pytest
import yaml
from arranged import PERIOD_S, ROOT, SLOW

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.judged import trained
from genpolicy.candidates.wire.served import ServedPolicy
from genpolicy.contract.latency import DECLARED_TERMS, MEASURED_TERMS
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.stress.latency import DeclaredTerm, LatencyModel
from genpolicy.execution.cell import Cell
from genpolicy.execution.journal import read_journal
from genpolicy.integrity.tables import read_table
from genpolicy.verification.clocks import derived_windows
from genpolicy.wall_clock import bench as bench_module
from genpolicy.wall_clock import clocks
from genpolicy.wall_clock.bench import WallClockSection, bench, limits_of, windows
from genpolicy.wall_clock.clocks import line, write_clocks
from genpolicy.wall_clock.limits import read_limits
from tests.candidates.conftest import entry_of, serving  # noqa: F401

ROWS = 16
MODEL = LatencyModel(
    declared={str(term): DeclaredTerm(0.01, 0.03) for term in DECLARED_TERMS},
    measured={str(term): np.array([0.002]) for term in MEASURED_TERMS},
    cold_extra_s=0.0,
)


@pytest.fixture
def shared(data, kit, monkeypatch):
    """Two windows, on limits so slow that a busy machine does not decide."""
    monkeypatch.setattr(bench_module, "HELD_OUT", "train")
    horizons = kit.HORIZONS.model_copy(update={"action_period_s": PERIOD_S})
    slow = {name: value for name, value in SLOW.items() if name != "maximum_age_s"}
    ages = dict.fromkeys(kit.EXECUTION.maximum_age_s, SLOW["maximum_age_s"])
    execution = kit.EXECUTION.model_copy(
        update=slow | {"maximum_age_s": ages, "hold_before_recovery_s": SLOW["silence_stop_s"]}
    )
    limits = limits_of("tabletop_insertion", Cell(horizons, execution), kit.FEASIBILITY)
    section = WallClockSection(episodes=2, rows=ROWS)
    pins = ROOT / "fixtures.yaml"
    with bench(data, limits, section=section, samples=2, root_seed=3, pins=pins) as made:
        yield made


def told(folder):
    names = ("invocations", "ages", "ticks")
    return {name: read_table(folder / f"{name}.parquet").to_pylist() for name in names}


def test_a_trained_policy_by_both_clocks(shared, fleet, tmp_path):
    candidates = trained(fleet[0], ["flow"], seeds=[0], device="cpu")
    write_clocks(tmp_path, shared, candidates, {"flow": MODEL})
    found, checked = told(tmp_path), CHECKER.read(tmp_path)
    assert set(checked.journals) == {"flow__wall.mcap", "flow__virtual.mcap"}
    assert checked.violations == [] and checked.reproved_actions == checked.checked_actions
    episodes = {replay.episode_uuid for replay in shared.windows}
    assert len(episodes) == 2
    for clock in ("wall", "virtual"):
        own = [row for row in found["invocations"] if row["clock"] == clock]
        assert {row["episode"] for row in own} == episodes
        assert {row["invocation"] for row in own} >= {0}
    deadline_s = read_limits(shared.root).cell.execution.deadline_s
    again = derived_windows((tmp_path / "journals").iterdir(), deadline_s=deadline_s)
    assert found == {"invocations": again.invocations, "ages": again.ages, "ticks": again.ticks}
    exact = [row for row in found["ticks"] if row["clock"] == "virtual"]
    assert {(row["ticks"], row["late_max_s"]) for row in exact} == {(ROWS, 0.0)}
    ages = [row["age_s"] / PERIOD_S for row in found["ages"] if row["clock"] == "virtual"]
    assert np.allclose(ages, np.rint(ages))
    wall, virtual = (seen(tmp_path / f"journals/flow__{c}.mcap") for c in ("wall", "virtual"))
    assert len(virtual) == 2 * ROWS and wall.items() <= virtual.items()  # a late tick may miss one
    assert len(wall) > ROWS
    kinds = {e.kind for path in (tmp_path / "journals").iterdir()
             for events in read_journal(path).values() for e in events}  # fmt: skip
    assert "reset" not in kinds


def seen(journal):
    """By session and row of its window: where bodies were seen, and in which phase."""
    found = {}
    for name, events in read_journal(journal).items():
        for event in events:
            at = found.setdefault((name.split("/")[-1], int(event.t / 1e9 / PERIOD_S + 0.01)), {})
            if event.kind == "scene":
                at["bodies"] = event.payload["bodies"]
            elif event.kind == "observation":
                at["phase"] = event.payload["phase"]
    return {place: at for place, at in found.items() if at}


def test_the_virtual_clock_is_one_journal_for_one_seed(shared, policy, tmp_path):
    request = clocks.WallClockRequest(
        root=str(shared.root), method="flow", checkpoint=policy.checkpoint_hash,
        sampler=policy.sampler_config_hash, replay=shared.windows[0],
    )  # fmt: skip
    written = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        clocks.virtually(shared, policy, 2, request, MODEL, folder=tmp_path / name)
        written.append((tmp_path / name / "journal.mcap").read_bytes())
    assert written[0] == written[1]


def test_both_clocks_draw_the_same_declared_terms(shared):
    plan = line(shared, MODEL)
    for window in range(2):
        terms = shared.terms_s(MODEL, window, 3)
        ask, answer = plan["asks"][f"{window}/3"][0], plan["answers"][f"{window}/3"][0]
        compute_s = len(MEASURED_TERMS) * 0.002
        assert ask + answer + compute_s == pytest.approx(sum(terms.values()))
        assert 0.04 <= ask <= 0.12 and 0.02 <= answer <= 0.06


def test_a_policy_behind_the_wire_is_asked_by_both(
    shared,
    policy,
    serving,  # noqa: F811
    entry_of,  # noqa: F811
    tmp_path,
):
    served = ServedPolicy(policy)
    with serving(served.answer, served.metadata) as address:
        entry = entry_of(address=address)
        path = tmp_path / "planted.yaml"
        path.write_text(yaml.safe_dump(entry.model_dump(mode="json", exclude_none=True)))
        brought = BroughtPolicy("planted", path, entry, "c" * 64, 0)
        write_clocks(tmp_path, shared, [brought], {"planted": MODEL})
    found, checked = told(tmp_path), CHECKER.read(tmp_path)
    assert checked.violations == []
    assert {row["clock"] for row in found["invocations"]} == {"wall", "virtual"}
    by = [row["discarded_by"] for row in found["invocations"]]
    assert "checkpoint_mismatch" not in by and "sampler_mismatch" not in by


DYING = """
import os, sys
from pathlib import Path
from genpolicy.candidates.wire.connection import Listening
from genpolicy.candidates.wire.served import ServedPolicy
from genpolicy.policies.policy import load_policy

served, asked = ServedPolicy(load_policy(Path(sys.argv[1]))), []

def answer(message):
    asked.append(message)
    if len(asked) == 3:
        os._exit(9)
    return served.answer(message)

with Listening(answer, served.metadata, port=int(sys.argv[2])) as listening:
    listening.serve_forever()
"""


def test_a_server_that_dies_at_its_third_question_moves_nothing_more(
    shared,
    fleet,
    policy,
    entry_of,  # noqa: F811
    tmp_path,
):
    """What it had answered is executed and proved; from there on nobody commands anything new."""
    (tmp_path / "dying.py").write_text(DYING)
    command = [sys.executable, "dying.py", str(fleet[0] / "flow" / "seed_0"), "{port}"]
    entry = entry_of(address=None, command=command, timeout_s=1.0)
    path = tmp_path / "planted.yaml"
    path.write_text(yaml.safe_dump(entry.model_dump(mode="json", exclude_none=True)))
    brought = BroughtPolicy("planted", path, entry, "c" * 64, 0)
    with clocks._asked_elsewhere(brought, shared) as asked:
        request = clocks.WallClockRequest(
            root=str(shared.root), method="planted", checkpoint=asked.checkpoint,
            sampler=asked.sampler, replay=shared.windows[0], then=tuple(shared.windows[1:]),
        )  # fmt: skip
        told = [*asked.command, "--candidates", "2"]
        running = clocks.start(tmp_path / "run", request, told, ready=True)
        running.wait()
    journal = tmp_path / "run" / clocks.JOURNAL
    found = [e for events in read_journal(journal).values() for e in events]
    # One of the first two may have come too late; none of those behind them came at all.
    assert 1 <= len([e for e in found if e.kind == "candidate"]) <= 2
    checker = shared.checker()
    limits = read_limits(shared.root)
    checked = clocks.checker_document([journal], cell=limits.cell, robot=checker.cell)
    assert checked.violations == []


def test_windows_are_drawn_by_name_and_short_episodes_are_left_out(data, task, monkeypatch):
    monkeypatch.setattr(bench_module, "HELD_OUT", "train")
    section = WallClockSection(episodes=3, rows=ROWS)
    first = windows(data, task, section, root_seed=3)
    assert first == windows(data, task, section, root_seed=3)
    assert first != windows(data, task, section, root_seed=4)
    assert [len(replay) for replay in first] == [ROWS] * 3
    assert len({replay.episode_uuid for replay in first}) == 3
    longest = int(data.episodes["rows"].max())
    assert windows(data, task, WallClockSection(episodes=3, rows=longest + 1), root_seed=3) == []
