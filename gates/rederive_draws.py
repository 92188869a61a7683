"""What the policies of gates C and D answered, drawn again: are these chunks theirs?

Everything else about a journal holds for the chunks of any policy. Here a sample of invocations is
given to the checkpoint of that name again: the same observations, the same names of the noise. The
sample is drawn by a hash of all journals and tables of the folder (`gates.sampled`). What a sampler
gives up at its cap is NaN there and has to be here, whatever a processor rounds.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gates.rederive_brought import brought_policy
from gates.rederive_joined import Rule, hold_joined, prefixes_of
from gates.rederive_planner import planner_of_ladder
from gates.rederive_sessions import REPLACING, checkpoint_of
from gates.rederive_shadow import TaskSection
from gates.report import Gate
from gates.sampled import ROLLOUTS, salt_of, some
from gates.stated import device_of, refuse, section, training_seed
from genpolicy.candidates.answering import AnsweringPolicy
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.judged import candidates_of, loaded_on
from genpolicy.candidates.wire.policy import WirePolicy, running
from genpolicy.contract.action import ACTION_DIM
from genpolicy.contract.chunk import actions_sha256
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.planner import PLANNER
from genpolicy.data.dataset import Dataset, load_dataset
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.shadow.settings import ShadowSection
from genpolicy.evidence.shadow.shadow import HELD_OUT, TWO_MODES
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.execution.journal import encode_poses
from genpolicy.integrity.rows import read_rows
from genpolicy.policies.protocol import NoiseName, Policy
from genpolicy.tasks.api import Task, load_task
from genpolicy.verification.drawn import Drawn, Source, drawn_chunks
from genpolicy.verification.journal_source import readable
from genpolicy.verification.rejoined import Made

Array = NDArray[np.float64]
Invocation = tuple[NoiseName, bytes, bytes]
"""Names of the noise, what was seen, and what was gone on from."""

TOLERANCE = 1e-5
"""Of a number of a chunk, m or without unit: what another processor may make of the same sample."""
GIVEN_UP = "NaN throughout, as of a sampler that gave up, and it answers"
ANSWERED = "numbers, and it gives up"
OF_A_JOURNAL = 12
"""Candidates of a journal of Gate D that are drawn again."""
OF_A_METHOD = 48
"""Observations of a method at Gate C whose candidates are drawn again."""
SHADOW = "artifacts/shadow"
DATASET = "artifacts/ingest"


@dataclass(frozen=True)
class Asked:
    """One candidate that is drawn again.

    Attributes:
        place: Where it stands, in words.
        source: Names of the noise, and what the policy saw.
        index: Number of the candidate.
        actions: What was drawn, where the numbers are there. Shape (K, 10).
        sha256: Its hash, where only that is.
        joined: The same as its journal states it, with what it was made of; None at Gate C.
    """

    place: str
    source: Source
    index: int
    actions: Array | None
    sha256: str = ""
    joined: Drawn | None = None

    @property
    def invocation(self) -> Invocation:
        """What is drawn together with it: the same noise, seen and gone on from."""
        return _named(self.source, self.goes_on)

    @property
    def goes_on(self) -> Made | None:
        """What it was made of, where it was drawn to go on from an earlier plan."""
        made = self.joined.made if self.joined else None
        return made if made is not None and made.guided else None

    @property
    def blended_from(self) -> Mapping[str, Source]:
        """Earlier invocations that were mixed into its numbers."""
        mixed = self.joined is not None and self.joined.blended is not None
        return self.joined.earlier if self.joined is not None and mixed else {}


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
    for method, items in sorted(asked.items()):
        if method == PLANNER:
            rule = Rule(joining.named(method), rows)
            _compare(gate, planner_of_ladder(params).load(), items, count=1, rule=rule)
            continue
        other = brought_policy(root, params, method)
        if other is not None:
            with running(other, task.observation, scene=task.scene_path) as wire:
                count = samples if always else candidates_of(wire, samples)
                _compare(gate, wire, items, count=count, rule=Rule(joining.named(method), rows))
            continue
        folder = checkpoint_of(root, method, training_seed(params))
        if folder is None:
            refuse(gate, items[0].place, f"drawn by {method}", "a policy that was trained")
        policy = AnsweringPolicy(loaded_on(device, folder))
        count = samples if always else candidates_of(policy, samples)
        _compare(gate, policy, items, count=count, rule=Rule(joining.named(method), rows))


def _compare(gate: Gate, policy: Policy, items: Sequence[Asked], *, count: int, rule: Rule) -> None:
    by_invocation = _drawn_again(policy, items, count, rule)
    drawn = [by_invocation[item.invocation] for item in items]
    limit = f"what {policy.checkpoint_hash[:16]}… draws there, within {TOLERANCE:g}"
    to_the_bit = True
    for item, chunks in zip(items, drawn, strict=True):
        if not 0 <= item.index < len(chunks):
            refuse(gate, item.place, "drawn", f"one of {len(chunks)} candidates")
        again = chunks[item.index]
        if item.actions is None:
            unlike = _one_is_none(item.sha256, again)
        else:
            unlike = "" if _alike(again, item.actions) else _apart(again, item.actions)
            to_the_bit = to_the_bit and np.array_equal(again, item.actions, equal_nan=True)
        if unlike:
            refuse(gate, item.place, _failed(policy) or unlike, limit)
    for item, chunks in zip(items, drawn, strict=True):
        # Of what was refused only the hash is there. It says something where this machine rounds
        # as that one did.
        if (
            to_the_bit
            and item.actions is None
            and actions_sha256(chunks[item.index]) != item.sha256
        ):
            said = _failed(policy) or f"drawn as {item.sha256[:16]}…"
            refuse(gate, item.place, said, limit)
    for item, chunks in zip(items, drawn, strict=True):
        told = item.joined
        if told is not None:
            earlier = {
                name: by_invocation[_named(source)] for name, source in item.blended_from.items()
            }
            hold_joined(
                gate, item.place, told, own=chunks, earlier=earlier, joining=rule.joining
            )  # fmt: skip


def _drawn_again(
    policy: Policy, items: Sequence[Asked], count: int, rule: Rule
) -> dict[Invocation, Array]:
    """What each invocation draws, and each that a blend rests on. Shapes (N, K, 10)."""
    asked: dict[Invocation, tuple[Source, Made | None]] = {}
    for item in items:
        # Candidates of one invocation are drawn together, and once.
        asked[item.invocation] = item.source, item.goes_on
        for source in item.blended_from.values():
            asked.setdefault(_named(source), (source, None))
    with readable(items[0].place):
        answers = policy.sample(
            np.stack([source.history for source, _ in asked.values()]),
            noise_names=[source.key for source, _ in asked.values()],
            candidates=count,
            prefix=prefixes_of([made for _, made in asked.values()], rule),
        ).actions
    return dict(zip(asked, answers, strict=True))


def _named(source: Source, goes_on: Made | None = None) -> Invocation:
    before = b"".join(one.commanded.tobytes() for one in (goes_on.said if goes_on else ()))
    return source.key, source.history.tobytes(), before


def _alike(one: Array, other: Array) -> bool:
    return one.shape == other.shape and np.allclose(
        one, other, rtol=0.0, atol=TOLERANCE, equal_nan=True
    )


def _failed(policy: Policy) -> str:
    """That a process was asked again and failed, with its last words; empty where none did."""
    if not isinstance(policy, WirePolicy) or not policy.faults:
        return ""
    return f"asked again without an answer ({policy.last_words})"


def _one_is_none(sha256: str, again: Array) -> str:
    """That one of two answers is NaN throughout and the other is not; empty where both are alike.

    It needs no numbers beside the hash: of all that is NaN there is one hash.
    """
    given_up = sha256 == actions_sha256(np.full(again.shape, np.nan))
    if given_up == bool(np.isnan(again).all()):
        return ""
    return GIVEN_UP if given_up else ANSWERED


def _apart(one: Array, other: Array) -> str:
    if one.shape != other.shape:
        return f"of shape {other.shape}"
    none, due = np.isnan(other), np.isnan(one)
    if (none & ~due).any():
        return (
            GIVEN_UP
            if none.all()
            else f"NaN in {none.sum()} numbers, of which {(none & ~due).sum()} are drawn"
        )
    if (due & ~none).any():
        return ANSWERED if due.all() else f"numbers where {(due & ~none).sum()} are NaN"
    return f"up to {np.nanmax(np.abs(one - other)):.3g} beside it"
