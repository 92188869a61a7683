"""Proposals that the layers rejected, from the tables beside a journal of shadow.

A journal states a candidate's verdict and the hash of its actions; the actions themselves stand in
`candidates.parquet`, and what touches what in `gallery.json`. Beside the folder of the journals of
stress they stand in `refused.parquet`, of failures and of rollouts that are worth a look. A row is
taken only where its actions have the hash that the journal states.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from genpolicy.contract.action import ACTION_DIM
from genpolicy.errors import IntegrityError
from genpolicy.evidence.documents.gallery import GALLERY
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.rows.stress import RefusedRow
from genpolicy.evidence.shadow.candidate_rows import numbers_sha256
from genpolicy.feasibility.settings import LAYERS
from genpolicy.integrity.rows import read_columns

Array = NDArray[np.float64]
Key = tuple[str, int]
"""Of a candidate: its chunk, empty where a session has one invocation, and its number."""

TABLE, REFUSED = "candidates.parquet", "refused.parquet"
HELD_OUT = "held_out"


@dataclass(frozen=True)
class RejectedProposal:
    """One candidate that a layer rejected.

    Attributes:
        index: Its number among the candidates of the invocation.
        layer: Layer that rejected it.
        reason: The check that it was rejected for.
        row: First offending action, counted from 0; None where there is none.
        margin: Limit minus value, in `unit`; None where it is no number.
        unit: Unit of the margin.
        raw: Actions as sampled; None where nobody keeps them. Shape (K, 10).
        projected: Actions after projection, likewise.
        touching: Names of the two shapes that touch; empty where none do, or nobody keeps them.
    """

    index: int
    layer: str
    reason: str
    row: int | None
    margin: float | None
    unit: str
    raw: Array | None = None
    projected: Array | None = None
    touching: tuple[str, ...] = ()

    @property
    def judged(self) -> Array | None:
        """The actions that the layer looked at: as sampled in the first layer, else projected."""
        return self.raw if self.layer == LAYERS[0] else self.projected

    @property
    def said(self) -> str:
        """Why, in a line."""
        text = f"{self.layer}: {self.reason.replace('_', ' ')}"
        if self.row is not None:
            text += f", action {self.row}"
        if self.margin is not None:
            text += f", margin {self.margin:.3g} {self.unit}".rstrip()
        return text + (f", {' and '.join(self.touching)} touch" if self.touching else "")


class Proposals:
    """The candidates of one session as the tables beside its journal keep them.

    Args:
        folder: Folder of the journal.
        labels: Labels of the session.

    Raises:
        BadInputError: A table that lies there cannot be read.
        IntegrityError: It is of another version.
    """

    def __init__(self, folder: Path, labels: Mapping[str, str]) -> None:
        self._rows: dict[Key, dict[str, Any]] = {}
        self._touching: dict[int, tuple[str, ...]] = {}
        self._shadow = "fixture" in labels
        path = folder / TABLE if self._shadow else folder.parent / REFUSED
        self._where = str(path)
        if not path.is_file():
            return
        if not self._shadow:
            rows = _refused(path, labels)
            self._rows = {(row["chunk_id"], int(row["candidate"])): row for row in rows}
            return
        self._rows = {("", int(row["candidate"])): row for row in _rows(path, labels)}
        own = (labels.get("method"), labels.get("observation"))
        if labels["fixture"] == HELD_OUT and (folder / GALLERY.file).is_file():
            for example in GALLERY.read(folder).examples:
                if (example.method, str(example.observation)) == own:
                    self._touching[example.candidate] = tuple(example.touching)

    def rejected(self, candidate: Mapping[str, Any]) -> RejectedProposal | None:
        """What is known of a candidate event; None of one that passed.

        Args:
            candidate: Payload of the event.

        Raises:
            IntegrityError: The table has other actions than the journal states.
        """
        if not candidate["first_reason"]:
            return None
        index, measures = int(candidate["index"]), candidate["measures"]
        layers = candidate["layers"]
        layer = next((name for name in LAYERS if layers.get(name) is not True), LAYERS[-1])
        row = self._rows.get(("" if self._shadow else candidate["chunk_id"], index))
        raw, projected = self._actions(index, row, measures)
        facts = measures if self._shadow or row is None else row
        return RejectedProposal(
            index=index,
            layer=layer,
            reason=str(candidate["first_reason"]),
            row=facts.get("first_row"),
            margin=facts.get("layer_margin"),
            unit=facts.get("margin_unit", ""),
            raw=raw,
            projected=projected,
            touching=self._touching.get(index, ()) or tuple(facts.get("touching", ())),
        )

    def _actions(
        self, index: int, row: Mapping[str, Any] | None, measures: Mapping[str, Any]
    ) -> tuple[Array | None, Array | None]:
        if row is None:
            return None, None
        for name in ("raw", "projected"):
            stated = measures.get(f"{name}_sha256")
            if numbers_sha256(row[name]) != stated:
                raise IntegrityError(
                    where=f"{self._where}: {name} of candidate {index}",
                    found="another one than the journal states",
                    expected=f"actions with sha256 {str(stated)[:16]}…",
                    action="Table and journal are not of one run; run their stage again.",
                )
        return _chunk(row["raw"]), _chunk(row["projected"])


def _chunk(numbers: Any) -> Array | None:
    """Actions (K, 10); None of what is no chunk."""
    found = np.array(numbers, dtype=np.float64)
    return found.reshape(-1, ACTION_DIM) if len(found) and len(found) % ACTION_DIM == 0 else None


def _refused(path: Path, labels: Mapping[str, str]) -> list[dict[str, Any]]:
    """Rows of a rollout."""
    table = read_columns(path, RefusedRow)
    frame = table.select(["method", "perturbation", "start"]).to_pandas()
    own = np.full(len(frame), True)
    for name in frame:
        own &= (frame[name].astype(str) == labels.get(name)).to_numpy()
    found: list[dict[str, Any]] = table.filter(own).to_pylist()
    return found


def _rows(path: Path, labels: Mapping[str, str]) -> list[dict[str, Any]]:
    """Rows of a session; a session that plays what was judged before has those of that."""
    table = read_columns(path, CandidateRow)
    frame = table.select(["method", "fixture", "observation"]).to_pandas()
    own = frame["method"] == labels.get("method")
    own &= frame["observation"].astype(str) == labels.get("observation")
    for fixture in (labels["fixture"], HELD_OUT):
        found: list[dict[str, Any]] = table.filter(
            (own & (frame["fixture"] == fixture)).to_numpy()
        ).to_pylist()
        if found:
            return found
    return []
