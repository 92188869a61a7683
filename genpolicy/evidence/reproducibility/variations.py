"""Fixtures asked for in another way: other threads, another batch, another order.

A sample shall depend on its name and on nothing else. So each way changes one thing: how many
threads the process has; how many observations and candidates are asked for at once; in which order.
What was asked plainly, in the same process, is what the answers are held against, and for other
threads what was asked with one.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from genpolicy.candidates.answering import AnsweringPolicy
from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.hosts.kinds import HostedEntry, ProgramEntry
from genpolicy.candidates.judged import JudgedPolicy
from genpolicy.candidates.wire.entry import Entry
from genpolicy.candidates.wire.policy import running
from genpolicy.contract.action import ACTION_COMPONENTS
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.observation import ObservationContract
from genpolicy.data.dataset import load_dataset
from genpolicy.evidence.fixtures_again import fixture_name
from genpolicy.evidence.rows.reproducibility import (
    ALONE,
    ORDER,
    THREADS,
    TOGETHER,
    VARIATIONS,
    VariationRow,
)
from genpolicy.policies.fixtures import CANDIDATES, fixture_observations
from genpolicy.policies.protocol import Policy
from genpolicy.seeds import stream

Array = NDArray[np.float64]

OTHER_THREADS = 2
"""Threads of a process in which fixtures are asked for again; one, where it declares as many."""
COMPANY = 2 * CANDIDATES
"""Candidates that are drawn at once where a sample stands beside others than usually."""
ORDER_SEED = 0


@dataclass(frozen=True)
class Varied:
    """Fixtures of one policy, asked plainly and in other ways.

    Attributes:
        pairs: By way: what was drawn so, and plainly. Shapes (F, N, K, D_a).
        unknown: By way that could not be tried: why.
    """

    pairs: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    unknown: dict[str, str] = field(default_factory=dict)

    def without(self, *ways: str, why: str) -> "Varied":
        """The same, of which some ways changed nothing."""
        pairs = {way: pair for way, pair in self.pairs.items() if way not in ways}
        return Varied(pairs, {**self.unknown, **dict.fromkeys(ways, why)})

    def rows(self, method: str, *, seed: int, device: str) -> list[VariationRow]:
        """A row of each way and component of the action."""
        found = []
        for way, (drawn, plain) in self.pairs.items():
            with np.errstate(invalid="ignore"):
                apart = np.abs(drawn - plain)
            chunks = drawn.shape[0] * drawn.shape[1]
            other = ~(apart == 0.0)  # a number that is none differs from every other one
            for place, component in enumerate(ACTION_COMPONENTS):
                unequal = int(other[..., place].any(axis=2).sum())
                largest = float(apart[..., place].max())
                found.append(
                    VariationRow(method, seed, device, way, component, chunks, unequal, largest, "")
                )
        for way, why in self.unknown.items():
            found += [
                VariationRow(method, seed, device, way, component, 0, 0, None, why)
                for component in ACTION_COMPONENTS
            ]
        return found


def plainly(policy: Policy, observations: Array) -> Array:
    """Fixtures as they are always asked for. Shape (F, CANDIDATES, K, D_a)."""
    return _drawn(policy, observations, range(len(observations)), CANDIDATES)


def asked_otherwise(policy: Policy, observations: Array, *, plain: Array) -> Varied:
    """Fixtures alone, beside others, and in another order, by one policy in one process.

    Args:
        policy: Who is asked.
        observations: Fixtures. Shape (F, H_o, D_o).
        plain: What it drew plainly. Shape (F, CANDIDATES, K, D_a).
    """
    rows = range(len(observations))
    order = stream(ORDER_SEED, "order of the fixtures").permutation(len(observations))
    alone = np.concatenate([_drawn(policy, observations, [row], 1) for row in rows])
    together = _drawn(policy, observations, rows, COMPANY)[:, :CANDIDATES]
    mixed = np.empty_like(plain)
    mixed[order] = _drawn(policy, observations, order.tolist(), CANDIDATES)
    return Varied(
        {ALONE: (alone, plain[:, :1]), TOGETHER: (together, plain), ORDER: (mixed, plain)}
    )


def with_threads(varied: Varied, drawn: Array, *, plain: Array) -> Varied:
    """The same, and what was drawn with other threads beside what was drawn plainly."""
    return Varied({THREADS: (drawn, plain), **varied.pairs}, varied.unknown)


def trained_otherwise(
    candidates: Sequence[JudgedPolicy],
    dataset: Path,
    *,
    horizons: HorizonConfig,
    counts: Mapping[tuple[str, int], int],
) -> list[VariationRow]:
    """Every checkpoint, asked in all ways; to be called in a fresh process.

    Args:
        candidates: Checkpoints.
        dataset: Folder of the dataset.
        horizons: Common horizons.
        counts: How many fixtures, by method and training seed.
    """
    data, found = load_dataset(dataset), []
    for candidate in candidates:
        policy, count = AnsweringPolicy(candidate.load()), counts[candidate.name, candidate.seed]
        observations = fixture_observations(data, horizons=horizons, count=count)
        varied = of_threads(policy, observations)
        found += varied.rows(candidate.name, seed=candidate.seed, device=candidate.device)
    return found


def of_threads(policy: Policy, observations: Array) -> Varied:
    """All ways of a policy that runs in this process, with one thread and with others."""
    with _threads(1):
        plain = plainly(policy, observations)
        varied = asked_otherwise(policy, observations, plain=plain)
    with _threads(OTHER_THREADS):
        return with_threads(varied, plainly(policy, observations), plain=plain)


def wire_otherwise(
    brought: BroughtPolicy,
    contract: ObservationContract,
    observations: Array,
    first: Array,
    *,
    scene: Path | None,
) -> Varied:
    """All ways of a policy that was brought, on a start of its own with other threads.

    Args:
        brought: Who it is.
        contract: The observation in force.
        observations: Fixtures. Shape (F, H_o, D_o).
        first: What it drew plainly, on a start with its own threads.
        scene: The MJCF that describes the robot.
    """
    if np.isnan(first).all():
        return Varied().without(*VARIATIONS, why="it answered no question")
    started = brought.entry.started_here
    threads = _others(brought.entry) if started else None
    with running(brought, contract, scene=scene, threads=threads) as policy:
        plain = plainly(policy, observations)
        varied = asked_otherwise(policy, observations, plain=plain)
        told = policy.told
    if not started:
        varied = varied.without(THREADS, why="it runs already: who started it says how many")
    elif isinstance(brought.entry, ProgramEntry) or not np.array_equal(plain, first):
        varied = with_threads(varied, plain, plain=first)
    else:  # what differs has been seen; what does not may not have obeyed
        varied = varied.without(THREADS, why="told, and may not obey; nothing differed")
    if not policy.stochastic:
        return varied.without(ALONE, TOGETHER, why="it draws one chunk a message, always the same")
    at_most = f"its server draws {told.candidates} of the chunks in a message at most"
    if told.candidates < CANDIDATES:
        return varied.without(ALONE, TOGETHER, why=at_most)
    return varied if told.candidates >= COMPANY else varied.without(TOGETHER, why=at_most)


def _others(entry: Entry) -> int:
    """Another number of threads than an entry says that it has."""
    said = entry if isinstance(entry, HostedEntry) else entry.declared
    own = 1 if said is None else said.threads
    return 1 if own == OTHER_THREADS else OTHER_THREADS


@contextmanager
def _threads(number: int) -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(number)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _drawn(policy: Policy, observations: Array, rows: Sequence[int], candidates: int) -> Array:
    names = [fixture_name(row) for row in rows]
    return policy.sample(observations[list(rows)], noise_names=names, candidates=candidates).actions
