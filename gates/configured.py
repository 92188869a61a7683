"""What training says of its configurations, held against the configurations that lie there.

`matched.json` repeats the configuration of each method and lists what differs from the reference.
Both are read again from `config.json` of the checkpoints, which say how weights were made and are
pinned by hash: a list is no evidence of what it leaves out.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

from gates.evidence import Evidence, MissingEvidenceError
from genpolicy.documents.document import Document
from genpolicy.evidence.documents.given import (
    MATCHED,
    DistilledConfig,
    Matched,
    MatchedMethod,
    TrainedConfig,
)

Config = TrainedConfig | DistilledConfig
CHECKPOINT: Document[Config] = Document("config.json", Config)  # type: ignore[arg-type]
COUNTED = ("weights_sha256", "parameters", "training_only_parameters", "flops", "distilled")
"""Of a configuration what training counted and nobody set; budget and pins are held elsewhere."""
OF_A_SEED = ("training_seed", "weights_sha256", "distilled")
"""In which trainings of one method differ."""
SINGLE_ACTION = frozenset(
    ("horizons.prediction_horizon", "horizons.execution_horizon", "dimensions.prediction_horizon")
)
"""What whoever predicts one action has by definition, whatever training lists."""
ONE_MODE = frozenset(("provenance.episodes_sha256",))
"""What whoever learns the demonstrations of one mode has by definition."""


def entry_of(evidence: Evidence, folder: str, method: str) -> tuple[Matched, MatchedMethod]:
    """`matched.json` of a stage, and its entry of a method.

    Raises:
        MissingEvidenceError: It has none.
    """
    said = evidence.document(folder, MATCHED)
    if method not in said.methods:
        raise MissingEvidenceError(f"{folder}/{MATCHED.file} has no entry of {method}")
    return said, said.methods[method]


def unsaid(evidence: Evidence, folder: str, method: str, *, one_mode: bool = False) -> list[str]:
    """Settings in which a method differs from the reference although nothing says so.

    Training lists what differs; both configurations stand beside the list. That a method has a
    name of its own is no setting, and what it is by definition is left out, as training does.

    Args:
        evidence: The evidence.
        folder: Of the stage that trained it.
        method: The method.
        one_mode: Whether it learns one mode by definition.

    Raises:
        MissingEvidenceError: One of the two configurations is not there.
    """
    said, entry = entry_of(evidence, folder, method)
    _, reference = entry_of(evidence, folder, said.reference)
    own, other = flat(entry.config, COUNTED), flat(reference.config, COUNTED)
    known = {"method", *said.differing_keys.get(method, ())}
    if one_mode:
        known |= ONE_MODE
    if entry.config.horizons.get("prediction_horizon") == 1:
        known |= SINGLE_ACTION
    return sorted(key for key in {*own, *other} - known if own.get(key) != other.get(key))


def compared(evidence: Evidence, folder: str, method: str) -> int:
    """How many settings of a method and of the reference are held against each other.

    Raises:
        MissingEvidenceError: As `unsaid`.
    """
    said, entry = entry_of(evidence, folder, method)
    _, reference = entry_of(evidence, folder, said.reference)
    return len({*flat(entry.config, COUNTED), *flat(reference.config, COUNTED)} - {"method"})


def otherwise(
    evidence: Evidence, folder: str, method: str, *, first: int, place: str | None = None
) -> list[str]:
    """Settings of which `matched.json` and the checkpoints of a method say different things.

    Args:
        evidence: The evidence.
        folder: Of the stage that wrote `matched.json`.
        method: The method.
        first: Number of the training seed that `matched.json` is about.
        place: Folder of the stage that trained it, where that is another one.

    Raises:
        MissingEvidenceError: There is no entry, no checkpoint, or no configuration of one.
    """
    _, entry = entry_of(evidence, folder, method)
    said, found = flat(entry.config), []
    paths = evidence.bind(f"{place or folder}/{method}/seed_*/{CHECKPOINT.file}")
    folders = {path.rpartition("/")[0]: path for path in paths}
    if f"{place or folder}/{method}/seed_{first}" not in folders:
        raise MissingEvidenceError(f"{method} has no {CHECKPOINT.file} of training seed {first}")
    for part in folders:
        lies = flat(evidence.document(part, CHECKPOINT))
        is_first = part.endswith(f"/seed_{first}")
        keys = {*said, *lies}
        if not is_first:
            keys = {key for key in keys if key.partition(".")[0] not in OF_A_SEED}
        found += [
            f"{key}: {MATCHED.file} says {_short(said.get(key))}, {part.rpartition('/')[2]} "
            f"{_short(lies.get(key))}"
            for key in sorted(keys)
            if said.get(key) != lies.get(key)
        ]
    for name in ("parameters", "training_only_parameters", "flops"):
        if getattr(entry, name) != getattr(entry.config, name):
            found.append(f"{name}: {MATCHED.file} counts others than its configuration")
    return found


def flat(config: TrainedConfig, without: tuple[str, ...] = ()) -> dict[str, Any]:
    """Values of a configuration by their place, with dots between names."""
    return dict(_leaves({k: v for k, v in asdict(config).items() if k not in without}))


def _leaves(config: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in config.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{place}{key}.")
        else:
            yield f"{place}{key}", value


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 24 else f"{text[:23]}…"
