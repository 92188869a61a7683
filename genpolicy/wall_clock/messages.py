"""What policy and operator say to the supervisor's process, and what it asks: JSON in frames.

An answer carries actions and who made them, and nothing else: when the observation was, which
phase, which session and when a chunk begins is what the supervisor's process knows by itself.
What cannot be read is None; nothing here raises because of what a sender wrote.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.execution.journal import encode_actions
from genpolicy.integrity.documents import canonical_json, parse_json

Array = NDArray[np.float64]

LONGEST_NAME = 128
MOST_ROWS = 512
"""The largest prediction horizon that settings allow."""
MOST_COLUMNS = 32


@dataclass(frozen=True)
class Ask:
    """One invocation.

    Attributes:
        invocation: Its name; the answer repeats it.
        observations: What conditions it, newest last. Shape (H_o, D_o).
        noise: Names the noise, so that a replay draws the same.
    """

    invocation: str
    observations: Array
    noise: tuple[str, ...]

    def encoded(self) -> bytes:
        """As bytes."""
        return canonical_json(
            {
                "invocation": self.invocation,
                "observations": self.observations.tolist(),
                "noise": list(self.noise),
            }
        )

    @classmethod
    def decoded(cls, data: bytes) -> "Ask":
        """Inverse of `encoded`, for the policy's side, which trusts who asks."""
        said = parse_json(data, where="an ask")
        return cls(
            said["invocation"],
            np.array(said["observations"], dtype=np.float64),
            tuple(said["noise"]),
        )


@dataclass(frozen=True)
class Answer:
    """What a policy says to an ask; it claims, and is asked for everything.

    Attributes:
        invocation: What it answers.
        checkpoint: Weights that made it.
        sampler: Sampler settings that did.
        method: Name of the method.
        actions: One candidate chunk, finite or not. Shape (rows, columns).
    """

    invocation: str
    checkpoint: str
    sampler: str
    method: str
    actions: Array

    def encoded(self) -> bytes:
        """As bytes; numbers bit for bit."""
        rows, columns = self.actions.shape
        return canonical_json(
            {
                "invocation": self.invocation, "checkpoint": self.checkpoint,
                "sampler": self.sampler, "method": self.method, "rows": rows, "columns": columns,
                "actions": encode_actions(self.actions),
            }
        )  # fmt: skip


class Order(StrEnum):
    """What a person at the operator's channel may want."""

    EMERGENCY_STOP = "emergency_stop"
    RESET = "reset"
    END = "end"


@dataclass(frozen=True)
class Operator:
    """What a person wants, and who it is; a reset needs a name."""

    order: Order
    person: str = ""

    def encoded(self) -> bytes:
        """As bytes."""
        return canonical_json({"order": str(self.order), "person": self.person})


def read_answer(data: bytes) -> Answer | None:
    """An answer; None of anything else, whatever it is."""
    try:
        said = parse_json(data, where="an answer")
        rows, columns = said["rows"], said["columns"]
        names = [_name(said[key]) for key in ("invocation", "checkpoint", "sampler", "method")]
        sized = type(rows) is type(columns) is int and 0 < rows <= MOST_ROWS
        if set(said) != {"invocation", "checkpoint", "sampler", "method", "rows", "columns",
                         "actions"} or not (sized and 0 < columns <= MOST_COLUMNS):  # fmt: skip
            return None
        actions = np.frombuffer(bytes.fromhex(said["actions"]), dtype="<f8")
        return Answer(
            names[0],
            names[1],
            names[2],
            names[3],
            actions.reshape(rows, columns).astype(np.float64),
        )
    except Exception:  # of bytes that a stranger chose, reading may raise anything
        return None


def read_operator(data: bytes) -> Operator | None:
    """What the operator wants; None of anything else."""
    try:
        said = parse_json(data, where="the operator's channel")
        return Operator(Order(said["order"]), _name(said["person"]))
    except Exception:  # as above
        return None


def _name(value: Any) -> str:
    if not isinstance(value, str) or len(value) > LONGEST_NAME:
        raise ValueError("no name")
    return value
