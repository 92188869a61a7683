"""What one update of a training costs, and what three seeds cost together, against arithmetic.

Of the network, batch and optimisation of `params.yaml`, on drawn windows. All ways take turns in
one run, so that a machine that grows slower slows all of them:

- `ours`: the update of a stage, the loop of `training.train` itself in its regime;
- `peer`: a plain loop with the same network, optimiser, batches and noise, in torch alone, with
  diffusers' `DDPMScheduler` and `EMAModel`;
- `products`: the matrix products of the update with nothing between them;
- `in turn`: three seeds one after the other in one process;
- `2 processes`: three seeds in two, two of them in the one, as a stage with two workers trains a
  method that nothing else waits beside;
- `vmap`, `bmm`: three seeds stacked, by `torch.func` and by a forward pass of batched products;
- `3 products`, `batched products`: the products of three seeds, apart and stacked: whatever is
  saved beside them, three seeds take no less.

Printed are medians over the rounds with their intervals, of processor time and of wall time, and
how often `ours` with one thread goes into each. Then the same, of one method and thread, for
smaller networks and batches, where three seeds may be had at the price that was asked for (`least`
is the smaller of the products of three). Last, by how much weights that were trained stacked differ
from those that were trained alone. Before anything is timed, the peer and both stacks must have
trained the same weights as ours, to 1e-6 (they move by 1e-5).

    python -m benchmarks.training
"""

import argparse
import io
import itertools
import os
import platform
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, redirect_stderr
from pathlib import Path

import diffusers
import numpy as np
import torch
from torch import Tensor

from benchmarks.training.processes import TwoProcesses
from benchmarks.training.stacked import Stacked
from benchmarks.training.steps import METHODS, Ours, Peer, Products, Size, Start, layers_of, windows
from benchmarks.training.turns import Array, InTurn, Way, median, take_turns, with_threads
from genpolicy.policies.windows import Windows

SEEDS = (0, 1, 2)
ASKED = 1.6
"""Times of one that three seeds may take."""
AGREES, CHECKED, COMPARED = 1e-6, 3, 50
WIDTHS, BATCHES = (384, 192, 96, 48), (256, 32)
ROUNDS, SWEPT, UPDATES = 9, 7, 2
"""Rounds at the configured size and of each smaller one; updates of a turn that are timed."""
Times = Mapping[str, Mapping[str, Array]]


def machine() -> str:
    """What it runs on, and what else does."""
    info = Path("/proc/cpuinfo")
    models = [line for line in info.read_text().splitlines() if line.startswith("model name")]
    model = models[0].split(":")[1].strip() if models else platform.processor()
    return (
        f"{model}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; torch "
        f"{torch.__version__}, {torch.backends.cpu.get_cpu_capability()}, diffusers "
        f"{diffusers.__version__}"
    )


class Contenders:
    """Makes the ways, each with a training of its own.

    Args:
        method: Whose.
        data: Windows.
        size: Of network and batch.
    """

    def __init__(self, method: str, data: Windows, size: Size) -> None:
        self.method, self.data, self.size = method, data, size
        self.layers = layers_of(self.start())

    def start(self, seed: int = 0) -> Start:
        """A training before its first update."""
        return Start(self.method, self.data, seed=seed, size=self.size)

    def stacked(self, way: str) -> Stacked:
        """All seeds in one."""
        return Stacked([self.start(seed) for seed in SEEDS], way)

    def one(self, threads: int) -> dict[str, Way]:
        """Ways of one training."""
        return {
            "ours": InTurn([Ours(self.start())], threads),
            "peer": InTurn([Peer(self.start())], threads, fixed=False),
            "products": InTurn([Products(self.layers)], threads, fixed=False),
        }

    def three(self, threads: int) -> dict[str, Way]:
        """Ways of three, in one process."""
        batched = Products(self.layers, len(SEEDS))
        return {
            "in turn": InTurn([Ours(self.start(seed)) for seed in SEEDS], threads),
            "vmap": InTurn([self.stacked("vmap")], threads),
            "bmm": InTurn([self.stacked("bmm")], threads),
            "3 products": InTurn([Products(self.layers) for _ in SEEDS], threads, fixed=False),
            "batched products": InTurn([batched], threads, fixed=False),
        }

    def check(self) -> None:
        """All train the same."""
        with with_threads(1, fixed=True):
            alone = [Ours(self.start(seed)) for seed in SEEDS]
            peer = Peer(self.start())
            stacks = {way: self.stacked(way) for way in ("vmap", "bmm")}
            run_each([*alone, peer, *stacks.values()], CHECKED)
        self._held("peer", [peer.average.shadow_params], alone[:1])
        for way, stack in stacks.items():
            self._held(way, [stack.of_seed(place) for place in range(len(SEEDS))], alone)

    def _held(self, name: str, found: Sequence[Sequence[Tensor]], alone: Sequence[Ours]) -> None:
        off = max(itertools.starmap(apart, zip(found, map(averaged, alone), strict=True)))
        if not off <= AGREES:
            sys.exit(f"{self.method}: {name} and ours differ by {off} after {CHECKED} updates, "
                     f"expected at most {AGREES}.")  # fmt: skip


def run_each(trainings: Sequence[Callable[[], None]], updates: int) -> None:
    """Some updates of each."""
    for training in trainings:
        for _ in range(updates):
            training()


def averaged(own: Ours) -> list[Tensor]:
    """Weights that a stage would keep."""
    return list(own.averaged.parameters())


def apart(one: Sequence[Tensor], other: Sequence[Tensor]) -> float:
    """Largest difference of two lists of tensors."""
    pairs = zip(one, other, strict=True)
    with torch.no_grad():
        return max(float((left - right).abs().max()) for left, right in pairs)


def same(one: Sequence[Tensor], other: Sequence[Tensor]) -> float:
    """Share of the numbers of two lists of tensors that are equal to the bit."""
    pairs = zip(one, other, strict=True)
    return float(torch.cat([(left == right).flatten() for left, right in pairs]).float().mean())


def row(*cells: object) -> str:
    """A line of a table."""
    return f"| {' | '.join(str(cell) for cell in cells)} |"


def head(*names: str) -> str:
    """The first two lines of one."""
    return f"{row(*names)}\n|{'---|' * len(names)}"


def rows(method: str, found: Times) -> Iterator[str]:
    """Rows of all ways; ratios are medians of those of each round."""
    base = found["ours, 1"]
    for name, own in found.items():
        way, threads = name.rsplit(", ", 1)
        ratios = [median(own[clock] / base[clock]) for clock in ("processor", "wall")]
        yield row(method, way, threads, median(own["processor"]), median(own["wall"]), *ratios)


def reachable(found: Times, threads: int) -> str:
    """Whether three seeds could be had at the price that was asked for."""
    clock = "processor" if threads == 1 else "wall"
    base = found[f"ours, {threads}"][clock]
    named = ("3 products", "batched products")
    bound = min(
        (median(found[f"{name}, {threads}"][clock] / base) for name in named),
        key=lambda own: own.value,
    )
    said = "below" if bound.high <= ASKED else "above" if bound.low > ASKED else "not decided at"
    return (
        f"{threads} thread{'s' * (threads > 1)}, {clock}: three seeds take at least {bound} of one "
        f"by their products, {said} the {ASKED} that was asked for"
    )


def arithmetic(contenders: Contenders, found: Times) -> str:
    """What the products of one update are, and how fast they go."""
    done = sum(layer.operations for layer in contenders.layers)
    rate = done / 1e6 / float(np.median(found["products, 1"]["processor"]))
    return f"its products are {done / 1e9:.2f} GFLOP an update, {rate:.0f} GFLOP/s on one core"


def measure(contenders: Contenders, args: argparse.Namespace, *, seeds: bool) -> Times:
    """All ways of a method."""
    contenders.check()
    ways: dict[str, Way] = {}
    with ExitStack() as stack:
        for threads in args.threads:
            own = contenders.one(threads) | (contenders.three(threads) if seeds else {})
            ways |= {f"{name}, {threads}": way for name, way in own.items()}
        if seeds:
            ways["2 processes, 1"] = stack.enter_context(
                TwoProcesses(contenders.method, contenders.size)
            )
        return take_turns(ways, rounds=args.rounds, updates=args.updates)


def sweep(method: str, data: Windows, args: argparse.Namespace) -> Iterator[str]:
    """Rows of smaller networks and batches, one thread, processor time."""
    for width, batch in itertools.product(args.widths, args.batches):
        contenders = Contenders(method, data, Size(width, batch))
        ways = contenders.one(1) | contenders.three(1)
        del ways["peer"], ways["products"]
        timed = take_turns(ways, rounds=min(args.rounds, SWEPT), updates=args.updates)
        found = {name: own["processor"] for name, own in timed.items()}
        base = found["ours"]
        count = sum(weight.numel() for weight in contenders.start().network.parameters())
        bound = np.minimum(found["3 products"], found["batched products"])
        ratios = [median(own / base) for own in (bound, found["vmap"], found["bmm"])]
        yield row(width, batch, f"{count:,}", median(base), *ratios)


def differences(contenders: Contenders, updates: int) -> Iterator[str]:
    """Rows of how far stacked weights lie from those that were trained alone."""
    with with_threads(1, fixed=True):
        alone = [Ours(contenders.start(seed)) for seed in SEEDS]
        stacks = {way: contenders.stacked(way) for way in ("vmap", "bmm")}
        before = [weight.detach().clone() for weight in averaged(alone[0])]
        run_each([*alone, *stacks.values()], updates)
    moved = apart(averaged(alone[0]), before)
    for way, stack in stacks.items():
        pairs = [(stack.of_seed(place), averaged(own)) for place, own in enumerate(alone)]
        equal = [same(*pair) for pair in pairs]
        off = max(apart(*pair) for pair in pairs)
        yield row(contenders.method, way, f"{min(equal):.1%}", f"{off:.1e}", f"{moved:.1e}")


def print_all(lines: Iterator[str]) -> None:
    """As they come."""
    for line in lines:
        print(line, flush=True)


def main(argv: Sequence[str] | None = None) -> None:
    """Check, time, print."""
    parser = argparse.ArgumentParser(prog="benchmarks.training")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--seeds-of", nargs="*", choices=METHODS, default=["diffusion"])
    parser.add_argument("--sweep-of", nargs="*", choices=METHODS, default=["diffusion"])
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--updates", type=int, default=UPDATES, help="timed in each turn")
    parser.add_argument("--width", type=int, default=Size().width, help="of the trunk")
    parser.add_argument("--batch", type=int, default=Size().batch)
    parser.add_argument("--widths", type=int, nargs="+", default=list(WIDTHS))
    parser.add_argument("--batches", type=int, nargs="+", default=list(BATCHES))
    parser.add_argument("--compared", type=int, default=COMPARED, help="updates")
    args = parser.parse_args(argv)
    with redirect_stderr(io.StringIO()):  # trainings tell how far they are
        report(args)


def report(args: argparse.Namespace) -> None:
    """All tables."""
    data = windows()
    print(f"{machine()}\n{args.rounds} rounds of {args.updates} updates, ms an update, median "
          f"[95 % interval]; ratios to ours with 1 thread")  # fmt: skip
    print(head("method", "way", "threads", "processor", "wall", "processor / ours", "wall / ours"))
    size, told = Size(args.width, args.batch), []
    all_ways = {method: Contenders(method, data, size) for method in args.methods}
    seeds_of = [method for method in args.methods if method in args.seeds_of]
    for method, contenders in all_ways.items():
        seeds = method in seeds_of
        found = measure(contenders, args, seeds=seeds)
        print_all(rows(method, found))
        told.append(f"{method}: {arithmetic(contenders, found)}")
        told += [f"{method}, {reachable(found, own)}" for own in args.threads if seeds]
    print("\n".join(told))
    for method in args.sweep_of:
        print(f"{method} of other sizes, 1 thread, processor ms; ratios to one seed of that size")
        print(head("trunk width", "batch", "parameters", "ours", "least", "vmap", "bmm"))
        print_all(sweep(method, data, args))
    if seeds_of:
        print(f"weights after {args.compared} updates, stacked against alone")
        print(head("method", "way", "equal bits, least seed", "largest difference", "moved by"))
    for method in seeds_of:
        print_all(differences(all_ways[method], args.compared))
    print(f"load at the end {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
