"""How each chunk of a policy met what was commanded before, derived again from its journal.

Of every chunk that entered the queue: the way from the last command to its first row that is due,
and the largest jerk of the TCP over that boundary, as drawn and as admitted. Commands before the
last one are joint positions; where they had the TCP is asked of MuJoCo. Shares no code with what
wrote the table.
"""

import math
from collections import defaultdict
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from genpolicy.verification.joined import LABEL
from genpolicy.verification.journal_source import Message, floats
from genpolicy.verification.pose import POSITION

Array = NDArray[np.float64]

KEYS = ("method", "perturbation", "start", "invocation")
"""Columns by which a splice is known."""
REPLACING = "replace"
"""How chunks join in a session that does not say how."""
EARLIER, LATER = 2, 3
"""Commands before the last one, and rows from the first that is due on, over which a jerk reaches:
a third difference over the boundary needs no more."""


class Spliced:
    """Takes the events of journals in; its rows are those of `splices.parquet`.

    A chunk that does not say what it was held against has no row: the checker objects to it.

    Args:
        scene_path: MJCF of robot and scene: the arm's joints first, a site `tcp` behind them.

    Attributes:
        rows: A row a chunk, without the training seed, in the order of the events. Ways in m,
            jerks in m/s^3; None where too little was commanded before.
    """

    def __init__(self, scene_path: Path) -> None:
        self.rows: list[dict[str, Any]] = []
        self._model: Any = mujoco.MjModel.from_xml_path(str(scene_path))
        self._data: Any = mujoco.MjData(self._model)
        self._tcp = int(self._model.site("tcp").id)
        self._sessions: dict[str, Message] = {}
        self._begun: dict[str, list[str]] = defaultdict(list)
        self._made: dict[tuple[str, str], Message] = {}

    def read(self, kind: str, m: Message) -> None:
        """Take an event in."""
        session = str(m.get("session"))
        if kind == "session":
            self._sessions[session] = m
        elif kind == "invocation" and m["stage"] == "begin":
            self._begun[session].append(m["id"])
        elif kind == "joined":
            self._made[session, m["chunk_id"]] = m
        elif kind == "enqueue" and m["source"] == "policy" and m["motion"] is not None:
            self._enter(session, m)

    def forget(self) -> None:
        """Another journal begins, whose sessions are other ones."""
        self._sessions.clear()
        self._begun.clear()
        self._made.clear()

    def _enter(self, session: str, chunk: Message) -> None:
        opened = self._sessions[session]
        labels, period_s = opened["labels"], opened["period_ns"] / 1e9
        made = self._made.get((session, chunk["chunk_id"]))
        invocation = chunk["chunk_id"] if made is None else made["invocation"]
        raw_m, raw_jerk = self._boundary(chunk, chunk["raw"] or chunk["actions"], period_s)
        jump_m, jerk = self._boundary(chunk, chunk["actions"], period_s)
        self.rows.append({
            "method": labels["method"], "perturbation": labels["perturbation"],
            "start": int(labels["start"]), "rule": labels.get(LABEL, REPLACING),
            "invocation": self._begun[session].index(invocation),
            "parents": 0 if made is None else len(made["parents"]),
            "raw_jump_m": raw_m, "raw_jerk_m_s3": raw_jerk, "jump_m": jump_m, "jerk_m_s3": jerk,
        })  # fmt: skip

    def _boundary(
        self, chunk: Message, actions: str, period_s: float
    ) -> tuple[float, float | None]:
        motion, (first, last) = chunk["motion"], chunk["checked_rows"]
        due = floats(actions).reshape(chunk["rows"], -1)[first:last, POSITION]
        told = floats(motion["last_action"])[POSITION]
        before = floats(motion["q_before_rad"]).reshape(-1, motion["joints"])[-EARLIER:]
        path = np.array([*(self._where(q_rad) for q_rad in before), told, *due[:LATER]])
        steps = path[1:] - path[:-1]
        turns = steps[1:] - steps[:-1]
        jerks = (turns[1:] - turns[:-1]) / period_s**3
        largest = max((math.hypot(*jerk) for jerk in jerks), default=math.nan)
        return math.dist(due[0], told), largest if math.isfinite(largest) else None

    def _where(self, q_rad: Array) -> Array:
        """Where the TCP is at some joint positions, m."""
        self._data.qpos[: len(q_rad)] = q_rad
        mujoco.mj_kinematics(self._model, self._data)
        return np.array(self._data.site_xpos[self._tcp])
