"""Servers of planted policies, on threads of the test's own process."""

import threading
from contextlib import contextmanager

import numpy as np
import pytest

from genpolicy.candidates.conformance.recorded_starts import RecordedStarts, measured
from genpolicy.candidates.wire.connection import Listening
from genpolicy.candidates.wire.entry import ServerEntry

CHANNELS = [
    "tcp_position_m", "tcp_rotation", "gripper_opening_m", "wrench_n", "hole_pose",
    "post_position_m", "phase",
]  # fmt: skip
ENTRY = {
    "name": "planted",
    "kind": "server",
    "author": "author@example.org",
    "address": "ws://127.0.0.1:1",
    "horizons": {
        "observation_horizon": 2, "prediction_horizon": 16, "execution_horizon": 8,
        "action_period_s": 0.05,
    },
    "observation": {"observation": {"channels": CHANNELS, "history": 2, "dtype": "float64"}},
    "action": {
        "frame": "robot_base",
        "motion": "absolute",
        "position": {"columns": [0, 1, 2], "unit": "m"},
        "rotation": {"columns": [3, 4, 5, 6, 7, 8], "form": "rotation_6d"},
        "gripper": {"column": 9, "open": 1.0, "open_m": 1.0},
    },
    "timeout_s": 5.0,
}  # fmt: skip


@pytest.fixture
def entry_of():
    """An entry like the planted one, with other fields."""
    return lambda **changes: ServerEntry.model_validate({**ENTRY, **changes})


@pytest.fixture
def entry(entry_of):
    return entry_of()


@pytest.fixture(scope="session")
def serving():
    """A context: an answering function behind the wire; gives the address."""

    @contextmanager
    def serve(answer, metadata):
        with Listening(answer, metadata, port=0) as listening:
            thread = threading.Thread(target=listening.serve_forever, daemon=True)
            thread.start()
            yield f"ws://127.0.0.1:{listening.port}"
        thread.join(5)

    return serve


@pytest.fixture(scope="session")
def starts(data, task):
    """Four moments of each of ten episodes; more of an episode than the kit itself takes."""
    cut = data.windows("train", 2, 16)
    parts = [data.windows(split, 2, 16) for split in ("validation", "test")]
    observations = np.concatenate([cut.observations, *(part.observations for part in parts)])
    chunks = np.concatenate([cut.actions, *(part.actions for part in parts)])
    whole = np.flatnonzero(~np.concatenate([cut.is_pad, *(part.is_pad for part in parts)]).any(1))
    rows = whole[np.linspace(0, len(whole) - 1, num=40).astype(int)]
    return RecordedStarts(
        observations[rows], chunks[rows], np.array([str(row) for row in rows]),
        measured(observations[rows], task.observation),
    )  # fmt: skip
