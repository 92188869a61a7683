"""Answers of slow checks, kept line by line: an interrupted audit asks none of them twice.

A replay and the feasibility of a chunk depend on nothing but their input, so an answer that was
written before the interruption is the answer. A line that was cut off is asked again.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.audit.labels import Replay
from genpolicy.audit.mean_versus_modes import Admissible
from genpolicy.integrity.hashing import sha256_bytes

Array = NDArray[np.float64]


class Answers:
    """A file of answers by key.

    Args:
        path: The file; its folder is made. Name it after everything the answers depend on.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[str, Any] = {}
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_file():
            for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
                self._read(line)

    def __len__(self) -> int:
        return len(self._known)

    def ask(self, key: str, answer: Callable[[], Any]) -> Any:
        """The kept answer to `key`, or a new one, which is kept."""
        if key not in self._known:
            self._known[key] = answer()
            with self._path.open("a", encoding="utf-8") as stream:
                # A line of its own even after a line that was cut off.
                stream.write("\n" + json.dumps([key, self._known[key]]))
        return self._known[key]

    def _read(self, line: str) -> None:
        try:
            key, value = json.loads(line)
        except (ValueError, TypeError):
            return
        if isinstance(key, str):
            self._known[key] = value


def remembered_replay(replay: Replay, answers: Answers) -> Replay:
    """The same replay; an episode that was replayed before is not replayed again."""
    return lambda uuid: str(answers.ask(f"replay {uuid}", lambda: replay(uuid)))


def remembered_admissible(admissible: Admissible, answers: Answers) -> Admissible:
    """The same check; a chunk that was checked at this observation before is not checked again."""

    def check(actions: Array, observation: Array) -> tuple[bool, str]:
        numbers = (np.ascontiguousarray(actions), np.ascontiguousarray(observation))
        key = sha256_bytes(b"".join(repr(a.shape).encode() + a.tobytes() for a in numbers))
        passed, reason = answers.ask(f"chunk {key}", lambda: list(admissible(actions, observation)))
        return bool(passed), str(reason)

    return check
