"""`python planted_server.py CHECKPOINT WRONG --port N`: a checkpoint, and one thing wrong with it.

Copied into a workspace and pinned there by its hash, so that nothing of it changes while it runs.
It serves what the ladder trained, under the metadata of that, whatever it answers.
"""

import argparse
import json
import random
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation as Turn

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from genpolicy.candidates.wire.connection import Listening  # noqa: E402
from genpolicy.candidates.wire.served import ACTIONS, OBSERVATION, ServedPolicy  # noqa: E402
from genpolicy.contract.rotation import rotation_from_6d  # noqa: E402
from genpolicy.data.dataset import Dataset, load_dataset  # noqa: E402
from genpolicy.policies.policy import load_policy  # noqa: E402

Array = NDArray[np.float64]
Message = dict[str, Any]
Answer = Callable[[Message], Message]

LATE_S = 0.4
"""Beyond the deadline of 0.15 s, and within the time after which no answer is waited for."""
SPREAD = 10.0
MM = 1000.0


def served(folder: str) -> ServedPolicy:
    """The checkpoint of a folder, from where the entry lies."""
    return ServedPolicy(load_policy(Path(folder)))


def changed(inner: ServedPolicy, change: Callable[[Array], Array]) -> Answer:
    """Another chunk (N, K, columns) in place of each."""

    def answer(message: Message) -> Message:
        found = inner.answer(message)
        return {**found, ACTIONS: change(found[ACTIONS])}

    return answer


def dataset() -> Dataset:
    """What the ladder recorded: a maker who cheats has it."""
    return load_dataset(ROOT / "artifacts" / "ingest")


def plain(inner: ServedPolicy) -> Answer:
    """Nothing is wrong."""
    return inner.answer


def millimetres(inner: ServedPolicy) -> Answer:
    """Places and opening in mm; whether that is wrong, the entry says."""

    def change(chunks: Array) -> Array:
        scaled = chunks.copy()
        scaled[..., [0, 1, 2, 9]] *= MM
        return scaled

    return changed(inner, change)


def quaternion(inner: ServedPolicy) -> Answer:
    """Place, quaternion xyzw, opening: eight columns."""

    def change(chunks: Array) -> Array:
        turned = rotation_from_6d(chunks[..., 3:9])
        four = Turn.from_matrix(turned.reshape(-1, 3, 3)).as_quat().reshape(*chunks.shape[:-1], 4)
        return np.concatenate([chunks[..., :3], four, chunks[..., 9:]], axis=-1)

    return changed(inner, change)


def late(inner: ServedPolicy) -> Answer:
    """Every answer comes behind the deadline."""

    def answer(message: Message) -> Message:
        time.sleep(LATE_S)
        return inner.answer(message)

    return answer


def global_seed(inner: ServedPolicy) -> Answer:
    """Noise from a global generator, seeded once, in place of the name that was asked for."""
    random.seed(0)

    def answer(message: Message) -> Message:
        word = {**message["genpolicy"], "noise": ["global", random.getrandbits(30)]}
        return inner.answer({**message, "genpolicy": word})

    return answer


def other_weights(inner: ServedPolicy, gate: str) -> Answer:
    """Other weights under the same hash, once the report of a gate names this candidate."""
    other = served("../artifacts/train_generators/diffusion/seed_0")
    report = ROOT / "reports" / f"gate_{gate}.json"
    name = sys.argv[sys.argv.index("--name") + 1]

    def answer(message: Message) -> Message:
        found = inner.answer(message)
        try:
            judged = name in json.loads(report.read_text())["candidates"]
        except (OSError, ValueError):
            judged = False
        return {**found, ACTIONS: other.answer(message)[ACTIONS]} if judged else found

    return answer


def recorded_future(inner: ServedPolicy) -> Answer:
    """What was done next where the recordings were most like this."""
    data, seen, done = dataset(), [], []
    for split in ("train", "validation", "test"):
        cut = data.windows(split, 2, 16, only_success=False)
        seen.append(cut.observations.reshape(len(cut.observations), -1))
        done.append(cut.actions)
    observations, actions = np.concatenate(seen), np.concatenate(done)
    spread = observations.std(axis=0) + 1e-6

    def answer(message: Message) -> Message:
        found = inner.answer(message)
        now = np.asarray(message[OBSERVATION], dtype=np.float64).reshape(-1)
        nearest = int(np.argmin((((observations - now) / spread) ** 2).sum(axis=1)))
        return {**found, ACTIONS: np.repeat(actions[nearest][None], len(found[ACTIONS]), axis=0)}

    return answer


def blind(inner: ServedPolicy) -> Answer:
    """It is always shown the same observation."""
    always = dataset().windows("train", 2, 16, only_success=False).observations[0]
    return lambda message: inner.answer({**message, OBSERVATION: always})


def wrong_spread(inner: ServedPolicy) -> Answer:
    """Actions are brought back to units by a standard deviation that is ten times too large."""
    mean = dataset().windows("train", 2, 16, only_success=False).actions.mean(axis=(0, 1))
    return changed(inner, lambda chunks: mean + SPREAD * (chunks - mean))


def swapped(inner: ServedPolicy) -> Answer:
    """Left is right: the sideways axis has the other sign."""

    def change(chunks: Array) -> Array:
        mirrored = chunks.copy()
        mirrored[..., 1] *= -1.0
        return mirrored

    return changed(inner, change)


WRONGS: dict[str, Callable[[ServedPolicy], Answer]] = {
    "plain": plain,
    "millimetres": millimetres,
    "quaternion": quaternion,
    "late": late,
    "global_seed": global_seed,
    "other_weights_behind_b": lambda inner: other_weights(inner, "b"),
    "other_weights_behind_c": lambda inner: other_weights(inner, "c"),
    "recorded_future": recorded_future,
    "blind": blind,
    "wrong_spread": wrong_spread,
    "swapped": swapped,
}


def main() -> None:
    """Serve until it is ended."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkpoint")
    parser.add_argument("wrong", choices=WRONGS)
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--name", required=True, help="of the candidate")
    args = parser.parse_args()
    inner = served(args.checkpoint)
    answer = WRONGS[args.wrong](inner)
    with Listening(answer, inner.metadata, port=args.port) as listening:
        listening.serve_forever()


if __name__ == "__main__":
    main()
