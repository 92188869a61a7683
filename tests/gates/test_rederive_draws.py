"""Chunks of another checkpoint, from other noise or of another moment are no proof of this one."""

import shutil
import sys
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from one_flow import (
    HORIZONS,
    PARAMS,
    SAMPLES,
    TASK,
    edited,
    folder_of,
    roll_out,
    roll_out_planned,
    train_flow,
)

from gates import rederive_draws as module
from gates.rederive_draws import SHADOW, rederive_rollout_draws, rederive_shadow_draws
from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.wire.entry import ServerEntry
from genpolicy.data.dataset import load_dataset
from genpolicy.errors import BadInputError, RefusedError
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.shadow.observations import held_out_observations
from genpolicy.evidence.shadow.shadow import Shadow, shadow_policy
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.execution.journal import encode_actions, read_journal
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.rows import read_rows, write_rows
from genpolicy.seeds import stream
from tests.candidates.conftest import ENTRY

LIMIT = r", required what [0-9a-f]{16}… draws there, within 1e-05; "
"""What a draw is held against, as it is said."""


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory):
    """Two trainings of one method: folder and identity."""
    root = tmp_path_factory.mktemp("trained")
    return [(root / str(seed), train_flow(root / str(seed), seed=seed)) for seed in (3, 4)]


@pytest.fixture(scope="module")
def journals(checkpoints, tmp_path_factory):
    """One shard of rollouts of either training, of a second, in which some chunks are refused."""
    return [
        roll_out(tmp_path_factory.mktemp("journals") / "flow__envelope.mcap", checkpoint)
        for checkpoint in checkpoints
    ]


@pytest.fixture
def root(checkpoints, tmp_path):
    """A workspace in which the first training is the trained policy."""
    shutil.copytree(checkpoints[0][0], folder_of(tmp_path))
    return tmp_path


@pytest.fixture
def params():
    return PARAMS | {"stress": PARAMS["stress"] | {"samples": SAMPLES}}


def test_what_the_checkpoint_drew_stands_and_both_kinds_of_verdict_are_among_it(
    root, params, journals
):
    rederive_rollout_draws(root, params, journals[:1])
    drawn, wrong = module.drawn_chunks(journals[0])
    assert not wrong and len(drawn) > module.OF_A_JOURNAL
    assert {item.actions is None for item in drawn} == {False, True}, "admitted and refused"
    events = [event for each in read_journal(journals[0]).values() for event in each]
    assert any(event.payload["raw"] for event in events if event.kind == "enqueue"), "projected"


def test_rollouts_of_another_checkpoint_under_this_name_are_refused(root, params, journals):
    with pytest.raises(RefusedError, match=r"flow/envelope/\d/\d, candidate \d is up to 0\.\d"):
        rederive_rollout_draws(root, params, journals[1:])


@pytest.mark.parametrize(("numbered", "hashed", "asked"), [(3, 100, 3), (100, 2, 10), (50, 50, 6)])
def test_of_a_journal_what_has_numbers_is_asked_where_there_is_some(
    journals, numbered, hashed, asked
):
    """Hashes alone do not tell another checkpoint from another machine's rounding."""
    drawn, _ = module.drawn_chunks(journals[0])
    one = next(item for item in drawn if item.actions is not None)
    many = [one] * numbered + [replace(one, actions=None)] * hashed
    chosen = module._of_either(many, journals[0].name, "salt")
    assert len(chosen) == module.OF_A_JOURNAL
    assert sum(item.actions is not None for item in chosen) == asked


def test_a_policy_that_nobody_trained_drew_nothing(root, params, journals):
    shutil.rmtree(folder_of(root))
    with pytest.raises(RefusedError, match="drawn by flow"):
        rederive_rollout_draws(root, params, journals[:1])


def test_a_server_that_does_not_start_again_is_refused_with_its_last_words(
    root, params, journals, monkeypatch, tmp_path
):
    command = [sys.executable, "-c", "raise SystemExit('no weights here')  # {port}"]
    entry = ServerEntry.model_validate({**ENTRY, "address": None, "command": command})
    other = BroughtPolicy("flow", tmp_path / "flow.yaml", entry, "c" * 64, 0)
    monkeypatch.setattr(module, "brought_policy", lambda *_: other)
    with pytest.raises(RefusedError, match=r"asked again without an answer.*no weights here"):
        rederive_rollout_draws(root, params, journals[:1])


def _other_noise(kind, payload):
    if kind == "conditioning":
        payload["key"] = [*payload["key"][:-1], payload["key"][-1] + 1]
    return payload


def _seen_elsewhere(kind, payload):
    """The post, as the policy saw it, a centimetre beside where it was."""
    if kind == "conditioning":
        seen = np.frombuffer(bytes.fromhex(payload["history"]), dtype="<f8").reshape(2, -1).copy()
        seen[:, 17] += 0.01
        payload["history"] = encode_actions(seen)
    return payload


def test_chunks_of_the_planner_are_planned_again(params, tmp_path, monkeypatch):
    """It has no checkpoint; another planner of the task, or other numbers, are found."""
    path = roll_out_planned(tmp_path / "classical_planner__nominal.mcap")
    rederive_rollout_draws(tmp_path, params, [path])

    class Aside:
        """A planner that goes a little beside it."""

        checkpoint_hash, stochastic = "e" * 64, False

        def __init__(self, own):
            self.own = own

        def load(self):
            return self

        def sample(self, *words, **named):
            drawn = self.own.sample(*words, **named)
            return replace(drawn, actions=drawn.actions + 1e-3)

    own = module.planner_of_ladder(params)
    monkeypatch.setattr(module, "planner_of_ladder", lambda _: Aside(own.load()))
    with pytest.raises(RefusedError, match=r"classical_planner/nominal/\d/\d+.*0\.001 beside it"):
        rederive_rollout_draws(tmp_path, params, [path])


@pytest.mark.parametrize(("change", "said"), [
    (_other_noise, r"the noise of 'flow/envelope/0/0' is named .*, \['stress', 'envelope', 0, 1\]"),
    (_seen_elsewhere, r"saw is another scene"),
    (lambda kind, p: None if kind == "conditioning" else p, r"nobody says what it was drawn from"),
    (lambda kind, p: p | {"id": "flow/envelope/0/9"} if kind == "conditioning" else p,
     r"saw is stated, and it does not begin there"),
    (lambda kind, p: p | {"raw": "00" + (p["raw"] or p["actions"])[2:]} if kind == "enqueue" else p,
     r"is enqueued, and what was judged is not"),
    (lambda kind, p: p | {"measures": {"drawn_sha256": "0" * 64}}
     if kind == "candidate" and p["first_reason"] else p, r"is drawn as 0000000000000000…"),
    (lambda kind, p: None if kind == "candidate" else p, r"no candidate of it passed"),
])  # fmt: skip
def test_what_was_not_drawn_so_is_refused_by_name(
    root, params, journals, tmp_path, change, said, monkeypatch
):
    monkeypatch.setattr(module, "OF_A_JOURNAL", 1000)
    path = edited(journals[0], tmp_path / "edited" / "flow__envelope.mcap", change)
    with pytest.raises(RefusedError, match=said):
        rederive_rollout_draws(root, params, [path])


def test_an_invocation_that_cannot_be_read_is_bad_input(root, params, journals, tmp_path):
    def change(kind, payload):
        return payload | {"rows": 7} if kind == "conditioning" else payload

    path = edited(journals[0], tmp_path / "edited" / "flow__envelope.mcap", change)
    with pytest.raises(BadInputError, match="cannot be read"):
        rederive_rollout_draws(root, params, [path])


def test_another_processor_may_round_and_what_is_further_away_is_another_draw(
    root, params, journals, monkeypatch
):
    class Rounds:
        """A policy on a processor that rounds by so much."""

        def __init__(self, policy, by):
            self.policy, self.by = policy, by
            self.stochastic, self.checkpoint_hash = True, policy.checkpoint_hash

        def sample(self, *words, **named):
            drawn = self.policy.sample(*words, **named)
            return replace(drawn, actions=drawn.actions + self.by)

    monkeypatch.setattr(module, "OF_A_JOURNAL", 1000)
    monkeypatch.setattr(module, "AnsweringPolicy", lambda own: Rounds(own, 9e-6))
    rederive_rollout_draws(root, params, journals[:1])
    monkeypatch.setattr(module, "AnsweringPolicy", lambda own: Rounds(own, 1.1e-5))
    with pytest.raises(RefusedError, match=r"up to 1\.1e-05 beside it" + LIMIT):
        rederive_rollout_draws(root, params, journals[:1])


def test_whoever_changes_one_journal_or_the_table_draws_all_samples_anew(tmp_path, monkeypatch):
    """Else a lie in one is missed by trying out that one alone, as often as it takes."""
    folder = tmp_path / "journals"
    folder.mkdir()
    paths = [folder / f"flow__{name}.mcap" for name in ("nominal", "push")]
    for path in paths:
        path.write_bytes(b"1")
    made = [SimpleNamespace(method="flow", actions=number, n=number) for number in range(40)]
    asked = []
    monkeypatch.setattr(module, "drawn_chunks", lambda path: (made, ""))
    monkeypatch.setattr(module, "_asked", lambda task, path, item: (path.name, item.n))
    monkeypatch.setattr(module, "_draw_again", lambda *a, **k: asked.append(a[3]["flow"]))
    for change in (None, paths[0], paths[1], tmp_path / "rollouts.parquet", None):
        if change is not None:
            change.write_bytes(b"2")
        rederive_rollout_draws(tmp_path, PARAMS, paths)
    assert asked[-1] == asked[-2] and len(asked[0]) == 2 * module.OF_A_JOURNAL
    for before, after in pairwise(asked[:-1]):
        for path in paths:
            own = [{n for name, n in one if name == path.name} for one in (before, after)]
            assert own[0] != own[1]


@pytest.fixture(scope="module")
def shadows(checkpoints, dataset, tmp_path_factory):
    """Candidates of the shadow test of either training, on the same moments."""
    data = load_dataset(dataset)
    checker = make_checker(
        TASK, FeasibilitySettings(**PARAMS["feasibility"]),
        action_period_s=HORIZONS.action_period_s,
    )  # fmt: skip
    tried = Shadow(
        task=TASK, checker=checker, cell=Cell(HORIZONS, ExecutionSettings(**PARAMS["execution"])),
        late_rows=1, samples=SAMPLES,
    )  # fmt: skip
    seen = held_out_observations(
        data, horizons=HORIZONS, count=12, generator=stream(1, "shadow", "observations")
    )
    found = []
    for folder, _ in checkpoints:
        root = tmp_path_factory.mktemp("shadow")
        (root / SHADOW).mkdir(parents=True)
        policy = module.loaded_on("cpu", folder)
        rows = shadow_policy(tried, policy, seen[:4], seed=0, two_mode=seen[4:]).candidates
        write_rows(root / SHADOW / "candidates.parquet", CandidateRow, rows)
        (root / SHADOW / "journal.mcap").write_bytes(b"only its hash is asked for")
        shutil.copytree(dataset, root / module.DATASET)
        shutil.copytree(checkpoints[0][0], folder_of(root))
        found.append(root)
    return found


@pytest.fixture
def shadow_params():
    return PARAMS | {"shadow": PARAMS["shadow"] | {"samples": SAMPLES}}


def test_shadow_candidates_of_this_checkpoint_stand_and_of_another_are_refused(
    shadows, shadow_params
):
    rederive_shadow_draws(shadows[0], shadow_params)
    with pytest.raises(RefusedError, match=r"candidate flow/\w+/\d+/0 is up to 0\.\d+ beside it"):
        rederive_shadow_draws(shadows[1], shadow_params)


def test_which_of_the_shadow_are_drawn_again_follows_from_the_table_as_well(
    shadows, shadow_params, tmp_path, monkeypatch
):
    """Else whoever writes the table knows beforehand at which of its moments nobody asks."""
    root = shutil.copytree(shadows[0], tmp_path / "repo")
    path = root / SHADOW / "candidates.parquet"
    asked = []
    monkeypatch.setattr(module, "OF_A_METHOD", 4)
    monkeypatch.setattr(module, "_draw_again", lambda *a, **k: asked.append(a[3]["flow"]))
    rederive_shadow_draws(root, shadow_params)
    rows = read_rows(path, CandidateRow)
    for number in range(6):
        rows[0] = replace(rows[0], raw=[float(number), *rows[0].raw[1:]])
        write_rows(path, CandidateRow, rows)
        rederive_shadow_draws(root, shadow_params)
    assert len({tuple(one.place for one in items) for items in asked}) > 1


@pytest.mark.parametrize(("changes", "said"), [
    ({"situation": "elsewhere:1"}, "a row of an episode of the dataset"),
    ({"situation": None}, "beside it"),
    ({"candidate": SAMPLES}, rf"drawn, required one of {SAMPLES} candidates"),
    ({"candidate": -1}, rf"drawn, required one of {SAMPLES} candidates"),
])  # fmt: skip
@pytest.mark.parametrize("fixture", ["held_out", "two_modes"])
def test_a_candidate_of_another_moment_is_refused(
    shadows, shadow_params, tmp_path, changes, said, fixture
):
    root = shutil.copytree(shadows[0], tmp_path / "repo")
    path = root / SHADOW / "candidates.parquet"
    rows = read_rows(path, CandidateRow)
    place = next(i for i, row in enumerate(rows) if row.fixture == fixture)
    if changes.get("situation", "") is None:
        name, _, index = rows[place].situation.rpartition(":")
        changes = {"situation": f"{name}:{int(index) + 5}"}
    rows[place] = replace(rows[place], **changes)
    write_rows(path, CandidateRow, rows)
    with pytest.raises(RefusedError, match=said):
        rederive_shadow_draws(root, shadow_params)


def test_a_policy_of_one_action_is_read_as_what_it_says(shadows):
    """Plain behaviour cloning: its chunk has one row, whatever the horizon of the others."""
    (row, *_) = read_rows(shadows[0] / SHADOW / "candidates.parquet", CandidateRow)
    data = load_dataset(shadows[0] / module.DATASET)
    short = module._of_row(data, HORIZONS, replace(row, raw=row.raw[:10]))
    whole = module._of_row(data, HORIZONS, row)
    assert short.actions.shape == (1, 10) and whole.actions.shape == (16, 10)
    np.testing.assert_array_equal(short.actions[0], whole.actions[0])
