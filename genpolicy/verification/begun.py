"""Whose actions a session was to execute, and where it began: what a journal says of its maker."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.verification.journal_source import floats, read_messages

Maker = tuple[str, str]
"""SHA-256 of weights with their configuration, and of the sampler's settings."""


@dataclass
class Begun:
    """How a session began.

    Attributes:
        labels: What it says of itself, by name.
        makers: Every maker that was in force, in order.
        bodies: The scene as it was first seen: x, y, z, m, and w, x, y, z by body.
        q_rad: Joints as they were first measured; None where nobody did. Shape (J,).
    """

    labels: dict[str, str]
    makers: list[Maker] = field(default_factory=list)
    bodies: dict[str, NDArray[np.float64]] | None = None
    q_rad: NDArray[np.float64] | None = None


def begun_sessions(path: Path) -> dict[str, Begun]:
    """How each session of a journal file began, by session.

    Raises:
        IntegrityError: No regular file.
        BadInputError: Not a whole journal.
        KeyError: An event of a session that never said what it is.
    """
    found: dict[str, Begun] = {}
    for kind, message in read_messages(path):
        name = str(message.get("session"))
        if kind == "session":
            found[name] = Begun(dict(message["labels"]))
            continue
        session = found[name]
        if kind == "active":
            session.makers.append((str(message["checkpoint"]), str(message["sampler"])))
        elif kind == "scene" and session.bodies is None:
            session.bodies = {body: floats(text) for body, text in message["bodies"].items()}
        elif kind == "state" and session.q_rad is None:
            session.q_rad = np.asarray(message["q_rad"], dtype=np.float64)
    return found
