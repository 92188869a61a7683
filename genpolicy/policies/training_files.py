"""The folder that a training leaves: weights, config, records, and the weights as they were before.

The folder of the earlier weights is a checkpoint too, so that what is measured of the result can be
measured of it; nothing runs it.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from genpolicy.integrity.atomic import output_folder, write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.rows import write_rows
from genpolicy.policies.checkpoint import CheckpointConfig, save_checkpoint
from genpolicy.policies.validation_row import VALIDATION_FILE, ValidationRow

TRAINING_FILE = "training.json"
METRICS_FILE = "metrics.jsonl"


class TrainingFiles:
    """Files of one training, written whole or not at all."""

    def __init__(
        self,
        records: Sequence[Mapping[str, float | int | None]],
        summary: Mapping[str, object],
        measured: Sequence[ValidationRow],
    ) -> None:
        """Records of the training's course, its summary, and the losses by episode, if any."""
        self._records, self._summary, self._measured = records, summary, measured
        self._checkpoints: dict[str, tuple[bytes, CheckpointConfig]] = {}

    def add(self, part: str, weights: bytes, config: CheckpointConfig) -> None:
        """A checkpoint to write: "." is the result, any other name a folder in its folder."""
        self._checkpoints[part] = (weights, config)

    def write(self, folder: Path) -> str:
        """Write everything; returns the SHA-256 of the result's checkpoint.

        Raises:
            BadInputError: The place cannot be written.
        """
        lines = "".join(json.dumps(record, sort_keys=True) + "\n" for record in self._records)
        identities = {}
        with output_folder(folder) as temporary:
            for part, (weights, config) in self._checkpoints.items():
                (temporary / part).mkdir(exist_ok=True)
                identities[part] = save_checkpoint(temporary / part, weights=weights, config=config)
            summary = {**self._summary, "checkpoint_sha256": identities["."]}
            write_bytes(temporary / METRICS_FILE, lines.encode())
            write_bytes(temporary / TRAINING_FILE, canonical_json(summary))
            if self._measured:
                write_rows(temporary / VALIDATION_FILE, ValidationRow, list(self._measured))
        return identities["."]
