"""One invocation's sampler against diffusers on the same weights, and against its own arithmetic.

The diffusion policy of `params.yaml`, of the configured size and untrained, draws candidates of one
observation with 16 DDIM steps. The ways take turns, call by call, so that a machine that grows
slower slows all of them, for each number of threads that torch and ONNX Runtime are given:

- diffusers' `DDIMScheduler` around the eager network, with as many rows as candidates;
- the project's own loop around the eager network, with as many rows;
- the policy as it is deployed (`NetworkPolicy.sample_encoded`), noise by name and physical units
  included; it takes one thread, whatever its process has;
- its exported program (`genpolicy export onnx`) in ONNX Runtime, where that is installed: one run a
  candidate, as it is asked behind the wire, physical units included and noise given;
- the matrix products of the 16 evaluations alone, with nothing between them.

Printed are medians, of processor time with one thread and of wall time with more, and ratios to
diffusers and to the products. Then the first call of a process, each in an interpreter of its own
behind the imports and the loading of the policy, wall time, again in turns. Before all of that the
policy must draw what the plain loop makes of rows of 16, bit for bit, and diffusers what the plain
loop draws, to 1e-4, with 20 steps: with 16, which do not divide 100 levels, diffusers goes from a
level to one that it does not visit next; the exported program what the policy draws, to 1e-4. Who
is compared must do the same work.

    python -m benchmarks.sampling --threads 1 2
"""

import argparse
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from diffusers import DDIMScheduler
from torch import Tensor, nn

from genpolicy.candidates.exports.onnx_export import onnx_bytes
from genpolicy.candidates.exports.unrolled import apart
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.normalisation import MinMax, Normalisation
from genpolicy.integrity.documents import read_yaml
from genpolicy.policies.checkpoint import Provenance
from genpolicy.policies.diffusion_samplers import sample_diffusion
from genpolicy.policies.matched_training import PolicySettings
from genpolicy.policies.policy import NetworkPolicy, load_policy
from genpolicy.policies.schedules import squared_cosine
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.training import train
from genpolicy.policies.training_request import TrainingRequest
from genpolicy.policies.windows import Windows
from genpolicy.seeds import counter_noise

ROOT = Path(__file__).parents[1]
PARAMS = read_yaml(ROOT / "params.yaml")
HORIZONS = HorizonConfig(**PARAMS["horizons"])
SAMPLER = SamplerConfig(name="ddim", steps=16)
DIVIDING = SamplerConfig(name="ddim", steps=20)
CANDIDATES = (1, 8, 32)
REPEATS, DISCARDED, FIRST_CALLS = 60, 5, 5
LIBRARIES = ("onnx", "onnxruntime", "onnxscript")
AGREES = 1e-4
OBSERVATION, ACTION = 24, 10


NOTHING = "0" * 64
PROGRAM = "sampler.onnx"


def untrained(folder: Path, *, observation: str = NOTHING, action: str = NOTHING) -> NetworkPolicy:
    """A diffusion policy of the configured size after one update, of contracts by their hashes."""
    settings = PolicySettings(**PARAMS["policy"])
    rng = np.random.default_rng(0)
    windows = Windows(
        rng.normal(size=(64, HORIZONS.observation_horizon, OBSERVATION)),
        rng.normal(size=(64, HORIZONS.prediction_horizon, ACTION)),
        np.zeros((64, HORIZONS.prediction_horizon), dtype=bool),
    )
    bounds = {
        name: MinMax(rows.min(axis=(0, 1)), rows.max(axis=(0, 1)))
        for name, rows in (("observation", windows.observations), ("action", windows.actions))
    }
    request = TrainingRequest(
        method="diffusion", horizons=HORIZONS, normalisation=Normalisation(**bounds),
        network=settings.network, head=settings.head,
        training=settings.training.model_copy(update={"updates": 1}), sampler=SAMPLER,
        provenance=Provenance(
            dataset_manifest_sha256=NOTHING, action_contract_sha256=action,
            observation_contract_sha256=observation,
        ),
        seed=0,
    )  # fmt: skip
    train(folder, request, windows=windows)
    return load_policy(folder)


def exported(policy: NetworkPolicy) -> bytes | None:
    """The sampler of a policy as an ONNX file; None where the libraries are not installed."""
    if not all(find_spec(name) for name in LIBRARIES):
        return None
    return onnx_bytes(apart(policy)[1])


def session(program: bytes, threads: int) -> Any:
    """ONNX Runtime on the CPU with so many threads."""
    import onnxruntime  # noqa: PLC0415  only where it is installed

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    return onnxruntime.InferenceSession(program, options, providers=["CPUExecutionProvider"])


class Contenders:
    """The ways, for one number of candidates.

    Args:
        policy: Whose weights.
        candidates: Chunks of a call.
        program: ONNX Runtime with its exported sampler; None where it is not installed.
    """

    def __init__(self, policy: NetworkPolicy, candidates: int, program: Any = None) -> None:
        self.policy, self.count, self.program = policy, candidates, program
        head = policy.checkpoint.config.head
        self.network, self.levels = policy.checkpoint.network, head.diffusion_levels
        seen = np.random.default_rng(1).normal(size=(1, HORIZONS.observation_horizon, OBSERVATION))
        self.condition = policy.encode(policy.preprocess(seen))
        shape = (HORIZONS.prediction_horizon, ACTION)
        names = [(policy.checkpoint_hash, "a", row, 0) for row in range(candidates)]
        noise = np.stack([counter_noise(name, shape=shape) for name in names])
        self.noise = torch.from_numpy(noise.astype(np.float32))
        self.scheduler: Any = DDIMScheduler(
            num_train_timesteps=self.levels, beta_schedule="squaredcos_cap_v2", clip_sample=True,
            timestep_spacing="trailing", set_alpha_to_one=True,
        )  # fmt: skip
        self.layers = [
            (layer, torch.randn(candidates, layer.in_features))
            for part in (self.network.trunk, self.network.head)
            for layer in part.modules()
            if isinstance(layer, nn.Linear)
        ]

    def diffusers(self, steps: int = SAMPLER.steps) -> Tensor:
        """The usual way."""
        condition, x = self.condition.expand(self.count, -1), self.noise
        self.scheduler.set_timesteps(steps)
        for level in self.scheduler.timesteps:
            at = torch.full((self.count,), float(level)) / self.levels
            said = self.network.evaluate(condition, x, at)
            x = self.scheduler.step(said, level, x, use_clipped_model_output=True).prev_sample
        return x

    def plain(self, rows: int = 0, sampler: SamplerConfig = SAMPLER) -> Tensor:
        """Our loop without anything computed ahead; with copies of the last row up to `rows`."""
        more = max(rows - self.count, 0)
        noise = torch.cat([self.noise, self.noise[-1:].expand(more, -1, -1)])
        condition = self.condition.expand(len(noise), -1)
        return sample_diffusion(
            lambda x, at: self.network.evaluate(condition, x, at), lambda _: noise,
            schedule=squared_cosine(self.levels), sampler=sampler,
        )[: self.count]  # fmt: skip

    def deployed(self) -> np.ndarray:
        """What runs."""
        return self.policy.sample_encoded(
            self.condition, noise_names=[("a",)], candidates=self.count
        ).actions[0]

    def onnx(self) -> np.ndarray:
        """The exported program, once a candidate."""
        condition, noise = self.condition[0].numpy(), self.noise.numpy()
        drawn = [self.program.run(None, {"condition": condition, "noise": row})[0] for row in noise]
        return np.stack(drawn)

    def ways(self) -> dict[str, Callable[[], object]]:
        """Every way by name, in the order of the columns."""
        found: dict[str, Callable[[], object]] = {
            "diffusers": self.diffusers, "plain": self.plain, "deployed": self.deployed,
        }  # fmt: skip
        if self.program is not None:
            found["onnx"] = self.onnx
        return found | {"products": self.products}

    def products(self) -> None:
        """The products of trunk and head, as often as the sampler evaluates them."""
        for _ in range(SAMPLER.steps):
            for layer, rows in self.layers:
                layer(rows)

    def check(self) -> None:
        """All draw the same."""
        denormalise = self.policy.checkpoint.normalisation.action.denormalise
        parts = range(0, self.count, 16)
        whole, noise = self.deployed(), self.noise
        found = []
        for first in parts:
            self.noise = noise[first : first + 16]
            self.count = len(self.noise)
            found.append(self.plain(16))
        self.noise, self.count = noise, len(noise)
        plain = denormalise(torch.cat(found).numpy().astype(np.float64))
        if not np.array_equal(plain, whole):
            sys.exit(f"{self.count} candidates: deployed and plain differ by "
                     f"{np.abs(plain - whole).max()}, expected equal bits.")  # fmt: skip
        distance = self.diffusers(DIVIDING.steps) - self.plain(sampler=DIVIDING)
        if not float(distance.abs().max()) <= AGREES:
            sys.exit(f"{self.count} candidates: diffusers and plain differ by "
                     f"{float(distance.abs().max())}, expected at most {AGREES}.")  # fmt: skip
        if self.program is None:
            return
        off = float(np.abs(self.onnx() - whole).max())
        if not off <= AGREES:
            sys.exit(f"{self.count} candidates: the exported program and the policy differ by "
                     f"{off}, expected at most {AGREES}.")  # fmt: skip


def medians(
    ways: dict[str, Callable[[], object]], *, repeats: int, threads: int
) -> dict[str, float]:
    """Median time of a call of each, ms, of the processor or on the wall; they take turns."""
    clock = time.process_time if threads == 1 else time.perf_counter
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(DISCARDED + repeats):
        for name, way in ways.items():
            begin = clock()
            way()
            spent[name].append(1e3 * (clock() - begin))
    return {name: float(np.median(own[DISCARDED:])) for name, own in spent.items()}


def first_call(folder: Path, way: str, *, count: int, threads: int) -> float:
    """Wall time of the first call of a way in this process, its observation encoded, ms.

    Imports, the checkpoint and the session of ONNX Runtime are loaded before.
    """
    torch.set_num_threads(threads)
    policy = load_policy(folder)
    program = session((folder / PROGRAM).read_bytes(), threads) if way == "onnx" else None
    with torch.inference_mode():
        begin = time.perf_counter()
        own = Contenders(policy, count, program)
        own.ways()[way]()
        return 1e3 * (time.perf_counter() - begin)


def first_calls(
    folder: Path, ways: Sequence[str], *, count: int, threads: int, repeats: int
) -> dict[str, float]:
    """Median over processes, each a new interpreter; the ways take turns."""
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(repeats):
        for way in ways:
            asked = ["--first", way, str(folder), "--threads", str(threads)]
            asked += ["--candidates", str(count)]
            told = subprocess.run(
                [sys.executable, "-m", "benchmarks.sampling", *asked],
                cwd=ROOT, capture_output=True, text=True, check=True,
            )  # fmt: skip
            spent[way].append(float(told.stdout))
    return {name: float(np.median(own)) for name, own in spent.items()}


def print_row(head: str, found: dict[str, float]) -> None:
    """Times and ratios of one number of candidates; a head of the columns where it has none."""
    times = "".join(f"{value:>11.2f}" for value in found.values())
    deployed = found["deployed"]
    ratios = f"{found['diffusers'] / deployed:>20.2f}"
    if "products" in found:
        ratios += f"{deployed / found['products']:>19.2f}"
    print(f"{head:<12}{times}{ratios}")


def print_heads(said: str, names: Sequence[str]) -> None:
    """What is timed, and the columns."""
    print(said)
    columns = "".join(f"{name:>11}" for name in names) + f"{'diffusers/deployed':>20}"
    print(f"{'candidates':<12}{columns}" + f"{'deployed/products':>19}" * ("products" in names))


def measure(args: argparse.Namespace, folder: Path) -> None:
    """Draw, compare, time, print."""
    policy = untrained(folder)
    program = exported(policy)
    if program is None:
        print("onnx, onnxruntime or onnxscript is not installed: without its way")
    else:
        (folder / PROGRAM).write_bytes(program)
    for threads in args.threads:
        torch.set_num_threads(threads)
        run = session(program, threads) if program is not None else None
        clock = "processor" if threads == 1 else "wall"
        said = f"{SAMPLER.steps} DDIM steps, {threads} thread{'s' * (threads > 1)}, {clock} ms"
        with torch.inference_mode():
            for place, count in enumerate(args.candidates):
                own = Contenders(policy, count, run)
                own.check()
                ways = own.ways()
                if place == 0:
                    print_heads(f"{said} (median of {args.repeats})", list(ways))
                print_row(str(count), medians(ways, repeats=args.repeats, threads=threads))
        if not args.first_calls:
            continue
        timed = [name for name in ways if name != "products"]
        print_heads(f"first call of a process, wall ms (median of {args.first_calls})", timed)
        for count in args.candidates:
            found = first_calls(
                folder, timed, count=count, threads=threads, repeats=args.first_calls
            )
            print_row(str(count), found)


def main(argv: Sequence[str] | None = None) -> None:
    """Time all ways; or, with `--first`, one of them in this process."""
    parser = argparse.ArgumentParser(prog="benchmarks.sampling")
    parser.add_argument("--threads", type=int, nargs="+", default=[1])
    parser.add_argument("--candidates", type=int, nargs="+", default=list(CANDIDATES))
    parser.add_argument("--repeats", type=int, default=REPEATS)
    parser.add_argument("--first-calls", type=int, default=FIRST_CALLS)
    parser.add_argument("--first", nargs=2, metavar=("WAY", "FOLDER"), help=argparse.SUPPRESS)
    args = parser.parse_args(argv)
    if args.first:
        way, folder = args.first
        (count,), (threads,) = args.candidates, args.threads
        print(first_call(Path(folder), way, count=count, threads=threads))
        return
    with TemporaryDirectory() as folder:
        measure(args, Path(folder) / "checkpoint")


if __name__ == "__main__":
    main()
