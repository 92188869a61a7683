"""The two sets of `shared/data`, recorded by others: what a specialist would say of them.

*PushT*: 206 human episodes, no start repeated, no outcome, no operator. Over whole episodes the
hand goes round the block clockwise in 71 and counter-clockwise in 81 of 152: there are several
ways, but hardly two episodes stand at one place. So `insufficient_support`, whatever its reason,
is right; modes that are found stay without validity. To say `valid_modes`, `unimodal`,
`pointwise_noise`, a defect or a hidden variable is wrong: none was recorded or can be seen.

*G1*: 100 episodes of one humanoid, the bottle only in the video. What looks like modes could be the
bottle, and no start is repeated: `insufficient_support`, or `hidden_state(unrecorded)`.

What is true of a change is known as for any other recording: it was made here.
"""

import json
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import zarr

from benchmarks.audit.catalogue import Answer
from benchmarks.audit_real.plan import Plan
from benchmarks.audit_real.recording import Episode, Recording
from benchmarks.audit_real.truth import UNRECORDED, Facts

PUSHT = "pusht_v7/pusht_cchi_v7_replay.zarr"
G1 = "g1_bottle_lerobot_v21"
NO_REPEATS = "no start is repeated; whether a model of the whole can tell is its own affair"


def pusht(plan: Plan) -> Recording:
    """PushT as published, 206 people's episodes."""
    recording = _pusht(_folder(PUSHT))
    return _part(recording, plan)


def g1(plan: Plan) -> Recording:
    """Unitree G1 with a bottle, as published."""
    return _part(_g1(_folder(G1)), plan)


def here() -> bool:
    """Whether the sets lie beside this repository."""
    return _folder(PUSHT).exists() and _folder(G1).exists()


def _folder(name: str) -> Path:
    """Beside the checkout, or further up."""
    above = [place / "shared/data" / name for place in Path(__file__).resolve().parents]
    return next((path for path in above if path.exists()), above[3])


def _part(recording: Recording, plan: Plan) -> Recording:
    """Some of the episodes, in their order; all where the plan asks for no number."""
    if plan.episodes is None or plan.episodes >= len(recording.episodes):
        return recording
    chosen = np.sort(plan.drawn("part").permutation(len(recording.episodes))[: plan.episodes])

    return replace(recording, episodes=tuple(recording.episodes[int(k)] for k in chosen))


@lru_cache
def _pusht(path: Path) -> Recording:
    root = zarr.open_group(str(path), mode="r")
    state, action = np.asarray(root["data/state"][:]), np.asarray(root["data/action"][:])
    contacts = np.asarray(root["data/n_contacts"][:])
    ends = np.asarray(root["meta/episode_ends"][:])
    episodes = []
    for k, end in enumerate(ends.tolist()):
        rows = slice(int(ends[k - 1]) if k else 0, end)
        seen, told = state[rows].astype(np.float64), action[rows].astype(np.float64)
        episodes.append(
            Episode(
                seen={"state": seen}, action=told, command=told, number=k,
                mode=np.full(len(seen), _round_the_block(seen)),
                rows={"n_contacts": contacts[rows]},
            )
        )  # fmt: skip
    return Recording(
        name="pusht_cchi_v7_replay", layout="zarr", rate_hz=10.0, episodes=tuple(episodes),
        names={"state": ()}, action_names=(), follows=(("state", 0), ("state", 1)),
        form="absolute", scale=150.0, real=True,
        truth=Facts(modes=2, undecided=NO_REPEATS),
    )  # fmt: skip


def _round_the_block(state: np.ndarray) -> int:
    """Clockwise 1, else 0: the turn of the hand about the block over the episode."""
    away = state[:, :2] - state[:, 2:4]
    turn = np.unwrap(np.arctan2(away[:, 1], away[:, 0]))
    return int(turn[-1] - turn[0] < 0)


@lru_cache
def _g1(path: Path) -> Recording:
    info = json.loads((path / "meta/info.json").read_text())
    names = tuple(np.array(info["features"]["observation.state"]["names"]).reshape(-1).tolist())
    files = sorted(path.glob("data/chunk-*/episode_*.parquet"))
    episodes = []
    for k, file in enumerate(files):
        table = pq.read_table(file, columns=["observation.state", "action", "timestamp"])
        seen = np.array(table["observation.state"].to_pylist(), dtype=np.float64)
        told = np.array(table["action"].to_pylist(), dtype=np.float64)
        episodes.append(
            Episode(
                seen={"observation.state": seen}, action=told, command=told, number=k,
                mode=np.zeros(len(seen), dtype=np.int64),
                time_s=table["timestamp"].to_numpy().astype(np.float64),
            )
        )  # fmt: skip
    hidden = Answer("hidden_state", UNRECORDED)
    return Recording(
        name="g1_bottle", layout="lerobot2", rate_hz=float(info["fps"]), episodes=tuple(episodes),
        names={"observation.state": names}, action_names=names,
        follows=tuple(("observation.state", j) for j in range(len(names))), form="absolute",
        scale=0.5, real=True,
        truth=Facts(modes=0, also=((hidden, "the bottle was only in the video"),),
                    undecided="the bottle's pose was only in the video; no start is repeated"),
    )  # fmt: skip
