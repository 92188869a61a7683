"""What the policies of gates C and D answered, drawn again: are these chunks theirs?

Everything else about a journal holds for the chunks of any policy. Here a sample of invocations is
given to the checkpoint of that name again: the same observations, the same names of the noise. The
sample is drawn by a hash of all journals and tables of the folder (`gates.sampled`). What a sampler
gives up at its cap is NaN there and has to be here, whatever a processor rounds.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gates.rederive_again import Again, Asked, draw_again, hold_hashes
from gates.rederive_brought import brought_policy
from gates.rederive_joined import Rule
from gates.rederive_planner import planner_of_ladder
from gates.rederive_sessions import REPLACING, checkpoint_of
from gates.rederive_shadow import TaskSection
from gates.report import Gate
from gates.sampled import ROLLOUTS, salt_of, some
from gates.stated import device_of, refuse, section, training_seed
from genpolicy.candidates.answering import AnsweringPolicy
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.judged import candidates_of, loaded_on
from genpolicy.candidates.wire.policy import running
from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.planner import PLANNER
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.shadow.settings import ShadowSection
from genpolicy.evidence.shadow.shadow import HELD_OUT, TWO_MODES
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.execution.journal import encode_poses
from genpolicy.integrity.rows import read_rows
from genpolicy.tasks.api import Task, load_task
from genpolicy.verification.drawn import Drawn, Source, drawn_chunks
from genpolicy.verification.journal_source import readable

OF_A_JOURNAL = 12
"""Candidates of a journal of Gate D that are drawn again."""
OF_A_METHOD = 48
"""Observations of a method at Gate C whose candidates are drawn again."""
SHADOW = "artifacts/shadow"
DATASET = "artifacts/ingest"


def rederive_rollout_draws(root: Path, params: Mapping[str, Any], journals: Sequence[Path]) -> None:
    """Draw a sample of what was judged in the rollouts again.

    Raises:
        RefusedError: A chunk is not what the checkpoint of its name draws from what it saw, an
            invocation does not say from what it drew, or it saw another scene than was there.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A journal or a checkpoint is missing, or is not what it claims to be.
        BadInputError: A journal cannot be read.
    """
    stress = section(params, "stress", StressSettings)
    task = load_task(section(params, "task", TaskSection).name)
    asked: dict[str, list[Asked]] = defaultdict(list)
    salt = salt_of([*journals, *(path.parent.parent / ROLLOUTS for path in journals)])
    for path in journals:
        with readable(f"{path.parent.name}/{path.name}"):
            drawn, wrong = drawn_chunks(path)
        if wrong:
            refuse("D", path.name, wrong, "every invocation with what it saw and its own noise")
        for item in _of_either(drawn, path.name, salt):
            asked[item.method].append(_asked(task, path, item))
    _draw_again("D", root, params, asked, samples=stress.samples, joining=stress.joining)


def rederive_shadow_draws(root: Path, params: Mapping[str, Any]) -> None:
    """Draw a sample of the candidates of the shadow test again, from the dataset.

    Raises:
        RefusedError: A candidate is not what the checkpoint of its name draws there, or it is of a
            moment that the dataset does not hold.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A file is missing, or is not what it claims to be.
        BadInputError: A table cannot be read.
    """
    shadow = section(params, "shadow", ShadowSection)
    horizons = section(params, "horizons", HorizonConfig)
    data = load_dataset(root / DATASET)
    salt = salt_of([*(root / SHADOW).glob("*.mcap"), *(root / SHADOW).glob("*.parquet")])
    moments: dict[str, dict[tuple[str, int], list[CandidateRow]]] = defaultdict(dict)
    for row in read_rows(root / SHADOW / "candidates.parquet", CandidateRow):
        if row.fixture in (HELD_OUT, TWO_MODES):
            moments[row.method].setdefault((row.fixture, row.observation), []).append(row)
    asked: dict[str, list[Asked]] = {}
    for method, of_method in moments.items():
        chosen = some(sorted(of_method), OF_A_METHOD, name=method, salt=salt)
        rows = [row for moment in chosen for row in of_method[moment]]
        asked[method] = [_of_row(data, horizons, row) for row in rows]
    _draw_again("C", root, params, asked, samples=shadow.samples, joining=REPLACING, always=True)


def _of_either(drawn: Sequence[Drawn], name: str, salt: str) -> list[Drawn]:
    """Some of a journal, half of them with numbers where there are so many.

    Only numbers tell what another processor rounds from what another checkpoint drew.
    """
    kinds = [[one for one in drawn if (one.actions is None) is hidden] for hidden in (False, True)]
    numbered, hashed = kinds
    count = max(OF_A_JOURNAL - len(hashed), OF_A_JOURNAL // 2)
    chosen = some(numbered, count, name=f"{name}, numbers", salt=salt)
    left = OF_A_JOURNAL - len(chosen)
    return [*chosen, *some(hashed, left, name=f"{name}, hashes", salt=salt)]


def _asked(task: Task, path: Path, item: Drawn) -> Asked:
    """A judged candidate of a rollout; what its policy saw is the scene that was there."""
    place = f"{path.name}: {item.chunk_id}, candidate {item.index}"
    with readable(place):
        seen = encode_poses(task.scene_poses(item.source.history[-1]))
    if seen != item.seen:
        refuse("D", f"{place}: saw", "another scene", "the scene of its session at that time")
    return Asked(place, item.source, item.index, item.actions, item.sha256, item)


def _of_row(data: Dataset, horizons: HorizonConfig, row: CandidateRow) -> Asked:
    place = f"candidate {row.method}/{row.fixture}/{row.observation}/{row.candidate}"
    name, _, index = row.situation.rpartition(":")
    numbers = np.flatnonzero(data.episodes["episode_uuid"].to_numpy(dtype=str) == name)
    own = np.flatnonzero(data.frames.episode == numbers[0]) if len(numbers) else numbers
    if not index.isdecimal() or not int(index) < len(own):
        refuse("C", f"{place}: situation", row.situation, "a row of an episode of the dataset")
    at = int(index)
    back = np.maximum(np.arange(at - horizons.observation_horizon + 1, at + 1), 0)
    history = data.frames.observation[own[back]]
    with readable(place):
        # As many rows as its policy predicts: plain behaviour cloning says one action.
        actions = np.array(row.raw).reshape(-1, ACTION_DIM)
    return Asked(place, Source(("shadow", name, at), history), row.candidate, actions)


def _draw_again(
    gate: Gate,
    root: Path,
    params: Mapping[str, Any],
    asked: Mapping[str, Sequence[Asked]],
    *,
    samples: int,
    joining: JoiningSettings,
    always: bool = False,
) -> None:
    """Hold what each method is said to have drawn against its checkpoint.

    Args:
        gate: Whose evidence it is.
        root: The workspace.
        params: Its parameters.
        asked: By method.
        samples: Candidates of an invocation.
        joining: How chunks of all methods join.
        always: A policy that always draws the same was asked for as many, too.
    """
    task = load_task(section(params, "task", TaskSection).name)
    rows = section(params, "horizons", HorizonConfig).prediction_horizon
    device = device_of(params)
    found: dict[str, Again] = {}
    networks: list[str] = []
    for method, items in sorted(asked.items()):
        if method == PLANNER:
            rule = Rule(joining.named(method), rows)
            planner = planner_of_ladder(params).load()
            found[method] = draw_again(gate, planner, items, count=1, rule=rule)
            continue
        other = brought_policy(root, params, method)
        if other is not None:
            with running(other, task.observation, scene=task.scene_path) as wire:
                count = samples if always else candidates_of(wire, samples)
                rule = Rule(joining.named(method), rows)
                found[method] = draw_again(gate, wire, items, count=count, rule=rule)
            continue
        folder = checkpoint_of(root, method, training_seed(params))
        if folder is None:
            refuse(gate, items[0].place, f"drawn by {method}", "a policy that was trained")
        policy = AnsweringPolicy(loaded_on(device, folder))
        count = samples if always else candidates_of(policy, samples)
        rule = Rule(joining.named(method), rows)
        found[method] = draw_again(gate, policy, items, count=count, rule=rule)
        networks.append(method)
    hold_hashes(found, networks=networks)
