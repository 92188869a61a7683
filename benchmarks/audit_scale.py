"""How does the audit grow? Time and memory from thirty thousand to a million frames.

Each size runs in a process of its own, from the dataset folder to the verdict, both kinds of
evidence included. Seconds of the processor are shown beside those of the clock: on a machine that
does other work only they say what the audit takes. Three references are of the same run: what
reading and verifying the dataset takes, what the k-d tree of SciPy takes to find the 20 nearest
rows of every row in the same observations (the audit's time as a multiple of each), and n log n
from the smallest size (1 grows just so, below 1 slower).

    python -m benchmarks.audit_scale [--episodes 300 1000 3000 10000]
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.audit.runner import judged
from genpolicy.audit import audit, propose_settings
from genpolicy.contract.observation import Channel, ObservationContract
from genpolicy.data.assemble import FLAGS, AcceptedEpisode, Description, write_dataset
from genpolicy.data.contract import ActionContract, SplitRule
from genpolicy.data.dataset import load_dataset
from genpolicy.data.resample import Rows
from genpolicy.seeds import stream

STEPS = 100
PERIOD_S = 0.1
OBSERVATION = ObservationContract((
    Channel("tcp_position_m", ("x", "y"), "m", "robot", 0.5),
    Channel("goal_position_m", ("x", "y"), "m", "camera", 0.5),
))  # fmt: skip
ACTION = ActionContract("base", ("x_m", "y_m"), ("m", "m"))
PAIRS = {
    "position_components": ["tcp_position_m.x", "tcp_position_m.y"],
    "action_components": ["x_m", "y_m"],
}


def episode(number: int) -> AcceptedEpisode:
    """Past a post on the left or on the right, 10 s at 10 Hz."""
    rng = stream(7, "scale", number)
    along = np.linspace(0.0, 1.0, STEPS)[:, None]
    start, goal = rng.uniform(-0.02, 0.02, 2), np.array([0.3, 0.0]) + rng.uniform(-0.03, 0.03, 2)
    side = 1.0 if rng.random() < 0.5 else -1.0
    path = start + (goal - start) * along
    path[:, 1:] += side * 0.09 * np.sin(np.pi * np.clip((along - 0.1) / 0.9, 0.0, 1.0))
    path += 0.0005 * rng.normal(size=path.shape)
    tick = (number * 3600 * 10**9) + (np.arange(STEPS) * round(PERIOD_S * 1e9)) + 1
    streams = {"robot": tick, "camera": tick}
    return AcceptedEpisode(
        episode_uuid=f"00000000-0000-4000-8000-{number:012d}",
        rows=Rows(
            tick_ns=tick, stream_event_ns=streams, stream_receive_ns=streams,
            observation=np.hstack([path, np.tile(goal, (STEPS, 1))]),
            action=np.vstack([path[1:], path[-1:]]),
            phase=np.full(STEPS, "all"), lead_action=np.zeros((0, 2)),
        ),
        strata={
            "task": "scale", "object": "peg", "operator": str(rng.integers(0, 3)),
            "calibration_epoch": "ab"[number % 2], "outcome": "success",
        },
        flags=dict.fromkeys(FLAGS, False), scene_start="", source_file=f"{number:06d}",
        source_sha256="0" * 64, content_sha256=f"{number:064d}", recorded_at_ns=int(tick[0]),
        clock_offsets_ns={},
    )  # fmt: skip


def measure(episodes: int) -> None:
    """Write a dataset, then load and audit it; prints one JSON line."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "dataset"
        write_dataset(
            out, accepted=[episode(n) for n in range(episodes)], refused=[], found=episodes,
            description=Description(
                "scale", OBSERVATION, ACTION, ("all",), PERIOD_S, SplitRule(), "made"
            ),
        )  # fmt: skip
        begin, idle = time.perf_counter(), time.process_time()
        dataset = load_dataset(out)
        loaded, spent = time.perf_counter(), time.process_time()
        report = audit(dataset, propose_settings(dataset, PAIRS))
        done, cpu_s = time.perf_counter(), time.process_time() - spent
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        json.dumps({
            "frames": episodes * STEPS, "load_s": loaded - begin, "audit_s": done - loaded,
            "cpu_s": cpu_s, "read_s": spent - idle,
            "reference_s": reference_s(dataset.frames.observation),
            "peak_mib": peak, "verdict": judged(report.result, report.settings).name.value,
        })
    )  # fmt: skip


def reference_s(observation: np.ndarray) -> float:
    """Processor seconds in which SciPy finds the 20 nearest rows of every row."""
    spent = time.process_time()
    cKDTree(observation).query(observation, k=20)
    return time.process_time() - spent


def main() -> None:
    """Every size in a process of its own, then the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.audit_scale")
    parser.add_argument("--episodes", type=int, nargs="+", default=[300, 1000, 3000, 10000])
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        measure(options.one)
        return
    print(
        "frames | load, s | audit, s | of the processor, s | x reading | x the k-d tree | "
        "against n log n | "
        "peak, MiB | verdict"
    )
    first = None
    for episodes in options.episodes:
        command = [sys.executable, "-m", "benchmarks.audit_scale", "--one", str(episodes)]
        result = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
        n, seconds = result["frames"], result["cpu_s"]
        first = first or (n, seconds)
        expected = first[1] * n * np.log(n) / (first[0] * np.log(first[0]))
        print(
            f"{n:9,d} | {result['load_s']:6.1f} | {result['audit_s']:7.1f} | {seconds:7.1f} | "
            f"{seconds / result['read_s']:6.1f} | {seconds / result['reference_s']:6.1f} | "
            f"{seconds / expected:5.2f} | "
            f"{result['peak_mib']:7.0f} | {result['verdict']}",
            flush=True,
        )


if __name__ == "__main__":
    main()
