"""What an invocation and a training cost on a device, beside the CPU of the same machine.

Policies of the configured size, `flow` with 4 Euler steps and `diffusion` with 16 DDIM steps,
trained for a moment on the CPU, are asked for candidates of one observation on either device. The
two take turns, call by call. Printed are medians of wall-clock time from the observation in memory
to the chunks in memory, which no device can give before it has finished; how far apart the two
devices' samples are, normalised; and the time of an update of a training on either.

    python -m benchmarks.devices --device cuda
"""

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.normalisation import MinMax, Normalisation
from genpolicy.errors import GenpolicyError
from genpolicy.integrity.documents import read_yaml
from genpolicy.policies.checkpoint import Provenance
from genpolicy.policies.determinism import require_device
from genpolicy.policies.policy import NetworkPolicy, load_policy
from genpolicy.policies.settings import HeadConfig, NetworkConfig, SamplerConfig, TrainingConfig
from genpolicy.policies.training import train
from genpolicy.policies.training_request import TrainingRequest
from genpolicy.policies.windows import Windows

PARAMS = read_yaml(Path(__file__).parents[1] / "params.yaml")
HORIZONS = HorizonConfig(**PARAMS["horizons"])
SAMPLERS = {
    "flow": SamplerConfig(name="euler", steps=4),
    "diffusion": SamplerConfig(name="ddim", steps=16),
}
CANDIDATES = (1, 8, 32)
REPEATS, DISCARDED = 100, 10
OBSERVATION, ACTION, WINDOWS = 24, 10, 4096
# Of a training the first updates load kernels and are not counted.
BEFORE, UPDATES = 20, 220
CPU = "cpu"


def windows() -> Windows:
    """Windows of the usual sizes that mean nothing."""
    rng = np.random.default_rng(0)
    return Windows(
        rng.normal(size=(WINDOWS, HORIZONS.observation_horizon, OBSERVATION)),
        rng.normal(size=(WINDOWS, HORIZONS.prediction_horizon, ACTION)),
        np.zeros((WINDOWS, HORIZONS.prediction_horizon), dtype=bool),
    )


def request(method: str, data: Windows, *, updates: int) -> TrainingRequest:
    """A training of the configured network."""
    bounds = {
        name: MinMax(rows.min(axis=(0, 1)), rows.max(axis=(0, 1)))
        for name, rows in (("observation", data.observations), ("action", data.actions))
    }
    policy = PARAMS["policy"]
    training = TrainingConfig(**{**policy["training"], "warmup_updates": 1})
    return TrainingRequest(
        method=method, horizons=HORIZONS, normalisation=Normalisation(**bounds),
        network=NetworkConfig(**policy["network"]), head=HeadConfig(),
        training=training.model_copy(update={"updates": updates}), sampler=SAMPLERS[method],
        provenance=Provenance(
            dataset_manifest_sha256="0" * 64, action_contract_sha256="0" * 64,
            observation_contract_sha256="0" * 64,
        ),
        seed=0,
    )  # fmt: skip


def invocation(policy: NetworkPolicy, candidates: int) -> Callable[[], np.ndarray]:
    """One observation's candidates, from memory to memory."""
    seen = np.random.default_rng(1).normal(size=(1, HORIZONS.observation_horizon, OBSERVATION))

    def call() -> np.ndarray:
        return policy.sample(seen, noise_names=[("a",)], candidates=candidates).actions

    return call


def medians(ways: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Median wall-clock time of a call of each, ms; they take turns."""
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(DISCARDED + REPEATS):
        for name, way in ways.items():
            begin = time.perf_counter()
            way()
            spent[name].append(1e3 * (time.perf_counter() - begin))
    return {name: float(np.median(own[DISCARDED:])) for name, own in spent.items()}


def update_ms(folder: Path, method: str, data: Windows, device: str) -> float:
    """Time of an update, ms: of a longer training what it takes beyond a short one, each update."""
    taken = []
    for updates in (BEFORE, UPDATES):
        asked = request(method, data, updates=updates)
        begin = time.perf_counter()
        train(folder / f"{device}_{updates}".replace(":", "_"), asked, windows=data, device=device)
        taken.append(time.perf_counter() - begin)
    return 1e3 * (taken[1] - taken[0]) / (UPDATES - BEFORE)


def machine(device: str) -> str:
    """What was measured on."""
    card = torch.cuda.get_device_name(device) if torch.device(device).type == "cuda" else device
    return f"{card} beside {os.cpu_count()} cores; torch {torch.__version__}, one thread"


def sampled(root: Path, method: str, data: Windows, device: str) -> None:
    """Print a row for each number of candidates."""
    train(root / method, request(method, data, updates=BEFORE), windows=data)
    here, there = (load_policy(root / method, device=where) for where in (CPU, device))
    evaluated = "compiled products" if here._compiled else "torch alone"
    for count in CANDIDATES:
        own, other = invocation(here, count), invocation(there, count)
        normalise = here.checkpoint.normalisation.action.normalise
        apart = float(np.abs(normalise(own()) - normalise(other())).max())
        found = medians({CPU: own, device: other})
        sampler = SAMPLERS[method]
        print(f"{f'{method}, {sampler.name} {sampler.steps}':<22}{count:>10}{found[CPU]:>10.2f}"
              f"{found[device]:>10.2f}{found[CPU] / found[device]:>10.2f}{apart:>12.1e}"
              f"  {evaluated}", flush=True)  # fmt: skip


def main(argv: Sequence[str] | None = None) -> int:
    """Ask, time, print; 2 where the device is not there."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.devices", description=__doc__)
    parser.add_argument("--device", default="cuda", help="torch device beside the CPU")
    device = parser.parse_args(argv).device
    torch.set_num_threads(1)
    try:
        require_device(device, where="--device")
    except GenpolicyError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    print(machine(device))
    print(f"an invocation, ms (median of {REPEATS})")
    print(
        f"{'sampler':<22}{'candidates':>10}{CPU:>10}{device:>10}{'ratio':>10}{'apart':>12}"
        "  the CPU evaluates by"
    )
    data = windows()
    with TemporaryDirectory() as folder:
        for method in SAMPLERS:
            sampled(Path(folder), method, data, device)
        print(f"an update of {PARAMS['policy']['training']['batch_size']} windows, ms")
        for method in SAMPLERS:
            own, other = (update_ms(Path(folder), method, data, where) for where in (CPU, device))
            print(f"{method:<32}{own:>10.2f}{other:>10.2f}{own / other:>10.2f}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
