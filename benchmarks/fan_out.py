"""What fan-out costs a shard, and what a second worker brings, against a loop over the shards.

Three kinds of shard: one that does nothing, one that computes for a stated time and hands back one
number, and a real one, an episode that is demonstrated and written. The ways take turns within a
round, in the order loop, one worker, two workers, so that a machine that grows slower slows all of
them; printed are medians of wall time over the rounds, with the least and the most.

The overhead of a shard is the slope over shards that do nothing: what a thousand take longer than
a few, divided by how many more they are. Beginning the processes is told apart. Every way must hand
back the same, and write the same files.

    python -m benchmarks.fan_out [--rounds 5] [--shards 40] [--seconds 0.25]
"""

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from genpolicy.compute import LOCAL, map_shards
from genpolicy.integrity.documents import read_yaml
from genpolicy.integrity.hashing import sha256_tree
from genpolicy.tasks.api import load_task
from genpolicy.tasks.demonstrations import SessionShard, record_shard

PARAMS = read_yaml(Path(__file__).parents[1] / "params.yaml")
FEW, MANY = 2, 1000
"""Shards that do nothing: too few to cost anything, and enough to."""
EPISODES = 8
Ways = dict[str, Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]]


def looped(function: Callable[[Any], Any], shards: Sequence[Any]) -> list[Any]:
    """What fan-out is held against."""
    return [function(shard) for shard in shards]


def of_workers(workers: int) -> Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]:
    """The product's own way, with so many local processes."""
    return lambda function, shards: map_shards(function, shards, workers=workers, scheduler=LOCAL)


WAYS: Ways = {"loop": looped, "1 worker": of_workers(1), "2 workers": of_workers(2)}


def nothing(shard: int) -> int:
    """A shard that hands back its number."""
    return shard


@dataclass(frozen=True)
class Computing:
    """A shard that computes.

    Attributes:
        number: Which one.
        turns: Turns of its loop: the same work wherever it runs.
    """

    number: int
    turns: int


def computed(shard: Computing) -> int:
    """A number that only so much work gives."""
    state = shard.number
    for _ in range(shard.turns):
        state = (6364136223846793005 * state + 1442695040888963407) % 2**64
    return state


def turns_of(seconds: float) -> int:
    """Turns that take so long here, s of processor time."""
    began, turns = time.process_time(), 200_000
    computed(Computing(0, turns))
    return max(1, int(turns * seconds / (time.process_time() - began)))


def timed(way: str, function: Callable[[Any], Any], shards: Sequence[Any]) -> tuple[float, Any]:
    """Wall time of one way, s, and what it handed back."""
    began = time.perf_counter()
    found = WAYS[way](function, shards)
    return time.perf_counter() - began, found


def in_turns(
    function: Callable[[Any], Any], shards_of: Callable[[str, int], Sequence[Any]], rounds: int
) -> dict[str, list[float]]:
    """Wall times of each way in each round, s.

    Raises:
        RuntimeError: A way hands back something else than the loop.
    """
    times: dict[str, list[float]] = {way: [] for way in WAYS}
    for number in range(rounds):
        answers = {}
        for way in WAYS:
            seconds, answers[way] = timed(way, function, shards_of(way, number))
            times[way].append(seconds)
        if any(found != answers["loop"] for found in answers.values()):
            raise RuntimeError("fan-out hands back something else than a loop")
    return times


def recorded(rounds: int) -> dict[str, list[float]]:
    """Wall times of episodes that are demonstrated and written, s.

    Raises:
        RuntimeError: A way writes other bytes than the loop.
    """
    name = PARAMS["task"]["name"]
    specs = load_task(name).episode_specs(PARAMS["seed"], EPISODES, shares=None)
    with TemporaryDirectory() as folder:

        def shards_of(way: str, number: int) -> list[SessionShard]:
            place = Path(folder) / f"{number}_{way}"
            place.mkdir()
            return [SessionShard(name, (spec,), place) for spec in specs]

        times = in_turns(record_shard, shards_of, rounds)
        written = [sha256_tree(place) for place in sorted(Path(folder).iterdir())]
    if any(files != written[0] for files in written):
        raise RuntimeError("fan-out writes other bytes than a loop")
    return times


def told(times: dict[str, list[float]], shards: int) -> None:
    """Print medians with their least and most, and what they are of the loop."""
    loop = float(np.median(times["loop"]))
    for way, seconds in times.items():
        middle = float(np.median(seconds))
        print(
            f"  {way:<10} {middle:8.3f} s ({min(seconds):.3f} to {max(seconds):.3f}), "
            f"{1e3 * middle / shards:8.2f} ms a shard, {loop / middle:.2f} of the speed of the loop"
        )


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and print; 1 where a way hands back or writes something else."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fan_out", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--shards", type=int, default=40, help="that compute")
    parser.add_argument("--seconds", type=float, default=0.25, help="for which each computes")
    args = parser.parse_args(argv)
    print(f"load of the machine before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    try:
        few = in_turns(nothing, lambda way, number: range(FEW), args.rounds)
        many = in_turns(nothing, lambda way, number: range(MANY), args.rounds)
        turns = turns_of(args.seconds)
        work = [Computing(number, turns) for number in range(args.shards)]
        busy = in_turns(computed, lambda way, number: work, args.rounds)
        real = recorded(args.rounds)
    except RuntimeError as error:
        print(f"{error}", file=sys.stderr)
        return 1
    for way in WAYS:
        slopes = (np.array(many[way]) - np.array(few[way])) / (MANY - FEW)
        print(
            f"{way}: {1e3 * np.median(slopes):.3f} ms a shard that does nothing; "
            f"{np.median(few[way]):.2f} s to begin and end {FEW}"
        )
    print(f"{args.shards} shards that compute, {args.seconds:g} s each by the processor's clock:")
    told(busy, args.shards)
    print(f"{EPISODES} episodes, a shard each, demonstrated and written:")
    told(real, EPISODES)
    return 0


if __name__ == "__main__":
    sys.exit(main())
