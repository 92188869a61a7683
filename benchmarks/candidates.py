"""What each kind of candidate costs an invocation beside its network, on the same weights.

A diffusion policy of the configured size, untrained, with 16 DDIM steps: its checkpoint, its
exports to torch and ONNX with the encoder apart, and a function that computes nothing. Each is
started in its child as `check-candidate` starts it, and asked over the wire. Beside them stand the
checkpoint in this process and, as the unit, the bare network: one encoding and 16 evaluations of as
many rows as candidates, and nothing else. All take turns, call by call, one thread each, so that a
machine that grows slower slows all of them.

Printed are medians of wall time and their ratio to the bare network; before that, how far apart
the chunks are. Who is compared must do the same work.

    python -m benchmarks.candidates
"""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
import yaml
from numpy.typing import NDArray

from benchmarks.kinds import of_each_kind
from benchmarks.ladder_truth.bringing import ACTION
from benchmarks.sampling import HORIZONS, SAMPLER, untrained
from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.hosts.translation import as_server
from genpolicy.candidates.wire.launched import Launched
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.contract.action import action_contract_hash
from genpolicy.integrity.hashing import sha256_file
from genpolicy.policies.policy import NetworkPolicy, load_policy
from genpolicy.tasks.api import load_task

CANDIDATES = (1, 8)
REPEATS, DISCARDED = 40, 5
TOLERANCE = 1e-4
"""m, or of a number of a rotation; 6e-6 (torch) and 5e-5 (ONNX) were seen."""
CHECKPOINT = "policy"
SCRIPT = "import numpy as np\ndef nothing(given):\n    return np.zeros((16, 10))\n"

Array = NDArray[np.float64]
Way = Callable[[Array, int, int], Array]


def entries(folder: Path, horizons: dict[str, object], channels: list[str]) -> Iterator[Path]:
    """An entry of each kind on the weights in `folder`."""
    (folder / "script.py").write_text(SCRIPT)
    script = {"script.py": sha256_file(folder / "script.py")}
    kinds: dict[str, dict[str, object]] = {
        **of_each_kind(folder, CHECKPOINT),
        "scripted": {"function": "script:nothing", "stochastic": False, "files": script},
    }
    common = {
        "author": "author@example.org",
        "horizons": horizons,
        "observation": {"observation": {"channels": channels, "history": 2, "dtype": "float64"}},
        "action": ACTION,
        "timeout_s": 30.0,
        "start_timeout_s": 300.0,
    }
    for kind, fields in kinds.items():
        path = folder / f"{kind}.yaml"
        path.write_text(yaml.safe_dump({"name": kind, "kind": kind, **common, **fields}))
        yield path


@contextmanager
def asked(path: Path) -> Iterator[Way]:
    """A candidate in its child, as a function of observation, name and number of candidates."""
    entry, contract = read_entry(path), load_task("tabletop_insertion").observation
    server = as_server(entry, path, contract)
    with Launched(server, path.parent) as running:
        remote = RemotePolicy(server, running.address, contract, ended=running.died)

        def ask(seen: Array, name: int, candidates: int) -> Array:
            return remote.invoke(seen, noise=("benchmark", name), candidates=candidates).actions

        yield ask
        remote.close()


def here(policy: NetworkPolicy) -> Way:
    """The checkpoint in this process."""

    def ask(seen: Array, name: int, candidates: int) -> Array:
        names = [("benchmark", name)]
        found: Array = policy.sample(seen[None], noise_names=names, candidates=candidates).actions[
            0
        ]
        return found

    return ask


def bare(policy: NetworkPolicy) -> Way:
    """The network alone."""
    network, sizes = policy.checkpoint.network, policy.checkpoint.config.dimensions

    def ask(seen: Array, name: int, candidates: int) -> Array:
        del name
        with torch.inference_mode():
            condition = network.encode(torch.from_numpy(seen.astype(np.float32))[None])
            rows = condition.expand(candidates, -1)
            x = torch.zeros(candidates, sizes.prediction_horizon, sizes.action_dim)
            time_ = torch.zeros(candidates)
            for _ in range(SAMPLER.steps):
                x = network.evaluate(rows, x, time_)
        found: Array = x.numpy().astype(np.float64)
        return found

    return ask


def compare(ways: dict[str, Way], seen: Array, candidates: int) -> None:
    """Print medians and ratios of one number of candidates."""
    drawn = {name: ask(seen, 0, candidates) for name, ask in ways.items()}
    apart = {name: float(np.abs(drawn[name] - drawn["in this process"]).max()) for name in ways}
    for name in ("server", "trained", "torch", "onnx"):
        assert apart[name] <= TOLERANCE, (name, apart[name])
    taken: dict[str, list[float]] = {name: [] for name in ways}
    for repeat in range(REPEATS + DISCARDED):
        for name, ask in ways.items():
            begun = time.perf_counter()
            ask(seen, repeat, candidates)
            taken[name].append(time.perf_counter() - begun)
    medians = {name: float(np.median(times[DISCARDED:])) for name, times in taken.items()}
    unit = medians["bare network"]
    print(f"\n{candidates} candidates   median ms   of the bare network   beside it ms   apart")
    for name, median in medians.items():
        far = f"{apart[name]:.1e}" if name not in ("bare network", "scripted") else "-"
        print(
            f"{name:16} {1e3 * median:9.2f} {median / unit:20.2f} {1e3 * (median - unit):14.2f}"
            f"   {far}"
        )


def main() -> None:
    torch.set_num_threads(1)
    task = load_task("tabletop_insertion")
    with TemporaryDirectory() as place, ExitStack() as stack:
        folder = Path(place)
        untrained(
            folder / CHECKPOINT, observation=task.observation.hash(), action=action_contract_hash()
        )
        policy = load_policy(folder / CHECKPOINT)
        ways: dict[str, Way] = {"bare network": bare(policy), "in this process": here(policy)}
        channels = [channel.name for channel in task.observation.channels]
        for path in entries(folder, HORIZONS.model_dump(), channels):
            ways[path.stem] = stack.enter_context(asked(path))
        seen = np.random.default_rng(1).normal(size=(2, task.observation.dim))
        for candidates in CANDIDATES:
            compare(ways, seen, candidates)


if __name__ == "__main__":
    main()
