"""Samples and trainings on other processors than this one, as far as one machine can show it.

Every way is a process of its own that keeps its libraries to an instruction set: torch's kernels
(`ATEN_CPU_CAPABILITY`), the matrix library (`MKL_ENABLE_INSTRUCTIONS`, `MKL_CBWR`), and the
compiled kernels (`NUMBA_CPU_NAME`). Each draws the same names of noise from the same checkpoints;
printed is how far its samples lie from those of the way in which stages run, and whether that is
within what is promised, 1e-5.

With a dataset each way also trains the method of each checkpoint, for a few updates, with several
seeds. Printed is by how much the held-out loss of a way differs from that of the stages, over the
standard deviation of the seeds: training gives other weights there, and no other evidence than
another seed gives.

    python -m benchmarks.processors CHECKPOINT... [--dataset artifacts/ingest --updates 400]
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STAGES = "avx2"
"""The way in which stages run."""
WAYS: dict[str, dict[str, str]] = {
    STAGES: {"ATEN_CPU_CAPABILITY": "avx2"},
    "default": {"ATEN_CPU_CAPABILITY": "default"},
    "avx512": {"ATEN_CPU_CAPABILITY": "avx512"},
    "libraries avx2": {
        "ATEN_CPU_CAPABILITY": "avx2", "MKL_ENABLE_INSTRUCTIONS": "AVX2",
        "NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "+avx,+avx2,+fma",
    },
    "libraries before avx": {
        "ATEN_CPU_CAPABILITY": "default", "MKL_CBWR": "COMPATIBLE",
        "NUMBA_CPU_NAME": "nehalem", "NUMBA_CPU_FEATURES": "+sse4.2,-avx,-avx2,-fma",
    },
}  # fmt: skip
PROMISED = 1e-5
OBSERVATIONS, CANDIDATES = 64, 2
GROUPS = {"position, m": slice(0, 3), "rotation": slice(3, 9), "gripper, m": slice(9, 10)}


def sampled(folder: Path) -> tuple[Array, str]:
    """Chunks of a checkpoint at drawn observations, and what torch says that it runs on."""
    import torch  # noqa: PLC0415  (reads its environment when it first computes)

    from genpolicy.policies.policy import load_policy  # noqa: PLC0415

    policy = load_policy(folder)
    sizes = policy.checkpoint.config.dimensions
    drawn = np.random.default_rng(0).uniform(
        -1.0, 1.0, size=(OBSERVATIONS, sizes.observation_horizon, sizes.observation_dim)
    )
    observations = policy.checkpoint.normalisation.observation.denormalise(drawn)
    names = [("processors", row) for row in range(OBSERVATIONS)]
    chunks = policy.sample(observations, noise_names=names, candidates=CANDIDATES).actions
    return chunks, str(torch.backends.cpu.get_cpu_capability())


def trained(folder: Path, dataset: Path, *, updates: int, seed: int) -> tuple[str, float]:
    """Weights by hash, and held-out loss, of a short training as that of a checkpoint."""
    from genpolicy.data.dataset import load_dataset  # noqa: PLC0415
    from genpolicy.policies.checkpoint import load_checkpoint  # noqa: PLC0415
    from genpolicy.policies.matched_training import training_windows  # noqa: PLC0415
    from genpolicy.policies.settings import TrainingConfig  # noqa: PLC0415
    from genpolicy.policies.training import train  # noqa: PLC0415
    from genpolicy.policies.training_request import TrainingRequest  # noqa: PLC0415

    checkpoint, data = load_checkpoint(folder), load_dataset(dataset)
    own = checkpoint.config
    request = TrainingRequest(
        method=own.method, horizons=own.horizons, normalisation=checkpoint.normalisation,
        network=own.network, head=own.head,
        training=TrainingConfig(**{**own.training.model_dump(), "updates": updates}),
        sampler=own.sampler, provenance=own.provenance, seed=seed,
    )  # fmt: skip
    windows, held_out = (
        training_windows(data, split, own.horizons) for split in ("train", "validation")
    )
    with TemporaryDirectory() as place:
        train(Path(place) / "checkpoint", request, windows=windows, validation=held_out)
        said = json.loads((Path(place) / "checkpoint" / "training.json").read_text())
        weights = json.loads((Path(place) / "checkpoint" / "config.json").read_text())
    return str(weights["weights_sha256"]), float(said["final"]["validation_loss"])


def child(arguments: argparse.Namespace) -> None:
    """What one process does: everything of one way, into a file."""
    found: dict[str, object] = {}
    for number, folder in enumerate(arguments.checkpoints):
        chunks, capability = sampled(folder)
        np.save(arguments.child / f"{number}.npy", chunks)
        found["capability"] = capability
        if arguments.dataset:
            found[str(number)] = [
                trained(folder, arguments.dataset, updates=arguments.updates, seed=seed)
                for seed in range(arguments.seeds)
            ]
    (arguments.child / "found.json").write_text(json.dumps(found))


def run(way: str, arguments: list[str], place: Path) -> dict[str, object]:
    """One way, in a process of its own; what it found."""
    place.mkdir()
    known = {name for settings in WAYS.values() for name in settings}
    fixed = {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NUMBA_CACHE_DIR": str(place)}
    kept = {name: value for name, value in os.environ.items() if name not in known}
    command = [sys.executable, "-m", "benchmarks.processors", *arguments, "--child", str(place)]
    subprocess.run(command, env={**kept, **fixed, **WAYS[way]}, check=True)
    found: dict[str, object] = json.loads((place / "found.json").read_text())
    return found


def samples_line(way: str, capability: str, chunks: Array, expected: Array) -> str:
    """How far the samples of a way lie from those of the stages."""
    apart = np.abs(chunks - expected)
    equal = int((chunks == expected).all(axis=(2, 3)).sum())
    groups = [f"{apart[..., part].max():.1e}" for part in GROUPS.values()]
    held = "yes" if float(apart.max()) <= PROMISED else "NO"
    total = chunks.shape[0] * chunks.shape[1]
    return f"| {way} | {capability} | {equal} of {total} | {' | '.join(groups)} | {held} |"


def training_line(way: str, own: list[tuple[str, float]], stages: list[tuple[str, float]]) -> str:
    """How far the held-out loss of a way lies from that of the stages, seed by seed."""
    losses, expected = (np.array([loss for _, loss in part]) for part in (own, stages))
    same = sum(a == b for (a, _), (b, _) in zip(own, stages, strict=True))
    spread = float(expected.std(ddof=1)) if len(expected) > 1 else np.nan
    most = float(np.abs(losses - expected).max())
    return (
        f"| {way} | {same} of {len(own)} | {most:.2e} | {expected.mean():.4g} | {spread:.2e} | "
        f"{most / spread:.2g} |"
    )


def main() -> None:
    """Every way, compared with that of the stages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("checkpoints", nargs="+", type=Path)
    parser.add_argument("--dataset", type=Path)
    parser.add_argument("--updates", type=int, default=400)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        child(arguments)
        return
    with TemporaryDirectory() as folder:
        places = {way: Path(folder) / str(number) for number, way in enumerate(WAYS)}
        found = {way: run(way, sys.argv[1:], place) for way, place in places.items()}
        for number, checkpoint in enumerate(arguments.checkpoints):
            print(f"\n{checkpoint.parent.name}, samples\n")
            print(f"| way | torch says | bits equal | {' | '.join(GROUPS)} | within {PROMISED:g} |")
            print(f"|{'---|' * (4 + len(GROUPS))}")
            drawn = {way: np.load(place / f"{number}.npy") for way, place in places.items()}
            for way, chunks in drawn.items():
                print(samples_line(way, str(found[way]["capability"]), chunks, drawn[STAGES]))
            if arguments.dataset:
                print(f"\n{checkpoint.parent.name}, {arguments.updates} updates\n")
                print("| way | same weights | held-out loss differs by | loss | its standard "
                      "deviation over seeds | difference over it |")  # fmt: skip
                print(f"|{'---|' * 6}")
                of_stages = found[STAGES][str(number)]
                for way in WAYS:
                    print(training_line(way, found[way][str(number)], of_stages))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
