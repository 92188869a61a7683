"""What a sampler gave up at its cap is given up when it is drawn again, and nothing else is."""

import shutil
from collections import Counter
from dataclasses import asdict, replace
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
    rolled_out,
    train_flow,
)

from gates import rederive_draws as module
from gates import rederive_fixtures as fixtures
from gates import rederive_measured as measured
from gates.rederive_again import Asked, draw_again, hold_hashes
from gates.rederive_draws import SHADOW, rederive_rollout_draws, rederive_shadow_draws
from gates.rederive_joined import Rule
from gates.rederive_refused import rederive_refused
from gates.rederive_sessions import REPLACING
from gates.stress.rollouts import REFUSED
from genpolicy.candidates.answering import AnsweringPolicy
from genpolicy.candidates.judged import loaded_on
from genpolicy.contract.chunk import actions_sha256
from genpolicy.data.dataset import load_dataset
from genpolicy.errors import RefusedError
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.rows.reproducibility import VariationRow
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.rows.stress import RefusedRow
from genpolicy.evidence.shadow.observations import held_out_observations
from genpolicy.evidence.shadow.shadow import Shadow, shadow_policy
from genpolicy.execution.cell import Cell, ExecutionSettings
from genpolicy.execution.journal import read_journal
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.rows import read_rows, write_rows
from genpolicy.policies.settings import SamplerConfig
from genpolicy.seeds import stream
from genpolicy.verification.drawn import Source
from genpolicy.verification.refused import RefusedCandidates
from genpolicy.verification.rollouts import derived_with_recoveries, differences
from genpolicy.verification.tables import derived_tables

ADAPTIVE = SamplerConfig(name="bosh3", steps=2, tolerance=1e-2, nfe_cap=21)
"""Of an invocation in ten one sample takes a step more than this cap allows."""
REASON = "finite"
NOTHING = actions_sha256(np.full((HORIZONS.prediction_horizon, 10), np.nan))
OF_HALVES = actions_sha256(np.full((HORIZONS.prediction_horizon, 10), 0.5))


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trained") / "flow"
    return folder, train_flow(folder, seed=3, sampler=ADAPTIVE)


@pytest.fixture(scope="module")
def shard(checkpoint, tmp_path_factory):
    """A second of rollouts, in which some invocations end at the cap: a journal and its rows."""
    path = tmp_path_factory.mktemp("stress") / "journals" / "flow__envelope.mcap"
    path.parent.mkdir()
    return path, rolled_out(path, checkpoint)


@pytest.fixture
def journal(shard):
    return shard[0]


@pytest.fixture
def root(checkpoint, tmp_path):
    shutil.copytree(checkpoint[0], folder_of(tmp_path))
    return tmp_path


@pytest.fixture
def params(monkeypatch):
    monkeypatch.setattr(module, "OF_A_JOURNAL", 1000)
    return PARAMS | {part: PARAMS[part] | {"samples": SAMPLES} for part in ("stress", "shadow")}


def judged(path):
    return [event.payload for events in read_journal(path).values() for event in events
            if event.kind == "candidate"]  # fmt: skip


def test_a_journal_in_which_some_answers_are_given_up_stands(root, params, journal):
    hashes = [one["measures"]["drawn_sha256"] for one in judged(journal)]
    assert 0 < hashes.count(NOTHING) < len(hashes) / 2, "one observation of several"
    rederive_rollout_draws(root, params, [journal])


def test_what_is_given_up_is_a_rejection_and_no_missed_deadline_by_table_and_journal(
    shard, tmp_path
):
    """It is known before the deadline that nothing comes; both witnesses say so alike."""
    journal, result = shard
    none = [one for one in judged(journal) if one["measures"]["drawn_sha256"] == NOTHING]
    assert {one["first_reason"] for one in none} == {REASON}
    by_rollout = Counter(one["chunk_id"].rpartition("/")[0] for one in none if one["index"] == 0)
    rollouts, _ = derived_with_recoveries(journal)
    for row in result.rollouts:
        name = f"flow/envelope/{row.start}"
        assert differences(asdict(row), rollouts[name]) == []
        assert row.deadline_misses == 0 and row.rejections >= by_rollout[name]
    assert by_rollout.total() > 0 and {row.fault for row in result.faults} == {""}
    numbers = [row for row in result.refused if row.first_reason == REASON]
    assert len(numbers) == len(none) and all(np.isnan(row.raw).all() for row in numbers)
    table = tmp_path / REFUSED
    table.parent.mkdir(parents=True)
    write_rows(table, RefusedRow, result.refused)
    refused = RefusedCandidates()
    derived_tables([journal], refused=refused)
    rederive_refused(tmp_path, PARAMS, refused, list(rollouts.values()))
    zeros = [0.0] * len(numbers[0].raw)
    forged = [replace(row, raw=tuple(zeros)) if row is numbers[0] else row
              for row in result.refused]  # fmt: skip
    write_rows(table, RefusedRow, forged)
    with pytest.raises(RefusedError, match="raw_sha256"):
        rederive_refused(tmp_path, PARAMS, refused, list(rollouts.values()))


@pytest.mark.parametrize("given_up", [False, True])
def test_a_hash_of_no_answer_where_there_is_one_is_refused_and_the_reverse(
    root, params, journal, tmp_path, given_up
):
    one = next(item for item in judged(journal)
               if (item["measures"]["drawn_sha256"] == NOTHING) == given_up)  # fmt: skip

    def change(kind, payload):
        if kind == "candidate" and (payload["chunk_id"], payload["index"]) == (
            one["chunk_id"], one["index"],
        ):  # fmt: skip
            payload["measures"] = {"drawn_sha256": "0" * 64 if given_up else NOTHING}
        return payload

    said = "is numbers, and it gives up" if given_up else "is NaN throughout, .* and it answers"
    path = edited(journal, tmp_path / "edited" / "flow__envelope.mcap", change)
    with pytest.raises(RefusedError, match=f"{one['chunk_id']}, candidate {one['index']} {said}"):
        rederive_rollout_draws(root, params, [path])


@pytest.fixture(scope="module")
def shadowed(checkpoint, dataset, tmp_path_factory):
    """Candidates of the shadow test, of which some are given up."""
    data, root = load_dataset(dataset), tmp_path_factory.mktemp("shadow")
    checker = make_checker(
        TASK, FeasibilitySettings(**PARAMS["feasibility"]),
        action_period_s=HORIZONS.action_period_s,
    )  # fmt: skip
    tried = Shadow(
        task=TASK, checker=checker, cell=Cell(HORIZONS, ExecutionSettings(**PARAMS["execution"])),
        late_rows=1, samples=SAMPLES,
    )  # fmt: skip
    seen = held_out_observations(
        data, horizons=HORIZONS, count=24, generator=stream(1, "shadow", "observations")
    )
    policy = AnsweringPolicy(loaded_on("cpu", checkpoint[0]))
    rows = shadow_policy(tried, policy, seen[:20], seed=0, two_mode=seen[20:]).candidates
    (root / SHADOW).mkdir(parents=True)
    write_rows(root / SHADOW / "candidates.parquet", CandidateRow, rows)
    shutil.copytree(dataset, root / module.DATASET)
    shutil.copytree(checkpoint[0], folder_of(root))
    return root


def forged(root, tmp_path, *, given_up, change):
    """A copy in which the first candidate that is given up, or is not, has other numbers."""
    root = shutil.copytree(root, tmp_path / "repo")
    path = root / SHADOW / "candidates.parquet"
    rows = read_rows(path, CandidateRow)
    place = next(n for n, row in enumerate(rows)
                 if row.fixture in ("held_out", "two_modes")
                 and np.isnan(row.raw).all() == given_up)  # fmt: skip
    rows[place] = replace(rows[place], raw=tuple(change(np.array(rows[place].raw)).tolist()))
    write_rows(path, CandidateRow, rows)
    return root


def test_a_table_in_which_some_candidates_are_given_up_stands(shadowed, params):
    rows = read_rows(shadowed / SHADOW / "candidates.parquet", CandidateRow)
    given_up = [np.isnan(row.raw).all() for row in rows if row.fixture == "held_out"]
    assert 0 < sum(given_up) < len(given_up)
    rederive_shadow_draws(shadowed, params)


def some_nan(raw):
    raw[3:7] = np.nan
    return raw


@pytest.mark.parametrize(("given_up", "change", "said"), [
    (False, lambda raw: raw * np.nan, "NaN throughout, as of a sampler that gave up"),
    (False, some_nan, "NaN in 4 numbers, of which 4 are drawn"),
    (True, np.nan_to_num, "numbers, and it gives up"),
    (True, lambda raw: np.concatenate([np.zeros(10), raw[10:]]), "numbers, and it gives up"),
])  # fmt: skip
def test_numbers_that_are_none_where_it_answers_are_refused_and_the_reverse(
    shadowed, params, tmp_path, given_up, change, said
):
    root = forged(shadowed, tmp_path, given_up=given_up, change=change)
    with pytest.raises(RefusedError, match=rf"candidate flow/\w+/\d+/\d is {said}"):
        rederive_shadow_draws(root, params)


def test_who_is_measured_again_gives_up_alone_by_each_of_its_samplers(root):
    """One hard situation ends neither the measuring of a table nor that of the fixtures."""
    conventions = {"flow": {"other": {**ADAPTIVE.model_dump(), "tolerance": 2e-2, "nfe_cap": 13}}}
    params = {
        "compute": PARAMS["compute"], "policy": {"seeds": [0]},
        "measure_baselines": {"conventions": conventions},
    }  # fmt: skip
    bench = SimpleNamespace(root=root, params=params, gate="B")
    ((seed, own),) = measured.trained_in(bench, "train_generators", "flow")
    policies = [own, *(policy for _, policy in measured._by_each(bench, "flow", seed, own))]
    assert [policy.sampler.nfe_cap for policy in policies] == [21, 21, 13]
    seen = np.random.default_rng(0).normal(0.0, 1.0, (24, 2, 24))
    for policy in policies:
        names = [("modes", "e", row) for row in range(len(seen))]
        drawn = policy.sample(seen, noise_names=names, candidates=SAMPLES).actions
        none = np.isnan(drawn).all(axis=(1, 2, 3))
        assert none.any() and np.isfinite(drawn[~none]).all()


@pytest.mark.parametrize(("found", "told", "stands"), [
    (np.nan, np.nan, True), (np.nan, 1.0, False), (0.5, np.nan, False), (0.5, 0.5, True),
])  # fmt: skip
def test_who_gives_up_where_it_is_asked_otherwise_is_told_by_nan(found, told, stands, monkeypatch):
    """Twice as many candidates at once reach a cap that half of them did not."""
    row = VariationRow("flow", 0, "cpu", "together", "x", 4, 2, found, "")
    varied = SimpleNamespace(rows=lambda *_, **__: [row])
    monkeypatch.setattr(fixtures, "of_threads", lambda *_: varied)
    stated = [replace(row, max_abs_difference=told)]
    if stands:
        fixtures._ways(stated, None, None, ("flow", 0))
    else:
        with pytest.raises(RefusedError, match=f"together: x is differs by {told}"):
            fixtures._ways(stated, None, None, ("flow", 0))


def test_fixtures_that_are_given_up_here_are_refused_as_what_training_drew(checkpoint):
    """Training draws them without giving up, so that a table of them has numbers throughout."""
    own = loaded_on("cpu", checkpoint[0])
    seen = np.random.default_rng(0).normal(0.0, 1.0, (24, 2, 24))
    with pytest.raises(RefusedError, match=r"flow \(seed 0\): fixtures is .*as training drew them"):
        fixtures._again(own, seen, ("flow", 0))


class Rounds:
    """A policy of one number throughout, on a processor that rounds it."""

    checkpoint_hash, stochastic = "e" * 64, True

    def sample(self, observations, *, candidates, **_):
        shape = (len(observations), candidates, HORIZONS.prediction_horizon, 10)
        return SimpleNamespace(actions=np.full(shape, 0.5 + 1e-6))


def asked(*, numbered, hashed):
    """One candidate with its numbers, where it has some, and one of which only a hash is left."""
    source = Source(("stress", "nominal", 0, 1), np.zeros((2, 24)))
    told = [Asked("two", source, 1, None, hashed)]
    return [Asked("one", source, 0, np.full((16, 10), 0.5)), *told] if numbered else told


def drawn(items, policy):
    rule = Rule(REPLACING, HORIZONS.prediction_horizon)
    return draw_again("D", policy, items, count=2, rule=rule)


@pytest.mark.parametrize(("sha256", "refused"), [("0" * 64, False), (NOTHING, True)])
def test_that_nothing_was_drawn_is_told_by_a_hash_whatever_a_processor_rounds(sha256, refused):
    """Of numbers a hash says nothing there; that there are none it says everywhere."""
    items = asked(numbered=True, hashed=sha256)
    if refused:
        with pytest.raises(RefusedError, match="two is NaN throughout"):
            drawn(items, Rounds())
    else:
        hold_hashes({"flow": drawn(items, Rounds())}, networks=["flow"])


class Exact(Rounds):
    """A policy on the processor that the evidence comes from."""

    def sample(self, observations, *, candidates, **_):
        shape = (len(observations), candidates, HORIZONS.prediction_horizon, 10)
        return SimpleNamespace(actions=np.full(shape, 0.5))


@pytest.mark.parametrize("other", ["flow", "planner", None])
def test_who_has_no_numbers_is_held_to_its_hashes_where_the_others_come_again_to_the_bit(other):
    """On another processor every chunk of who was always refused stood for an invented one."""
    refused = asked(numbered=False, hashed="0" * 64)
    networks = [name for name in ("bc", other) if name not in ("planner", None)]
    for beside, held in ((Exact(), True), (Rounds(), other != "flow")):
        found = {"bc": drawn(refused, beside)}
        if other:
            found[other] = drawn(asked(numbered=True, hashed=OF_HALVES), beside)
        if held:
            with pytest.raises(RefusedError, match="two is drawn as 0000000000000000"):
                hold_hashes(found, networks=networks)
        else:
            hold_hashes(found, networks=networks)
