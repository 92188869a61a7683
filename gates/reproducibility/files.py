"""The files of a candidate's trainings, held against who it is said to be, and of which seeds.

A card may name any hash; what lies in the checkpoint's folder has one. Every training seed that
was trained is asked: a method of which only the best seed has rows was selected.
"""

import contextlib
from collections.abc import Sequence

import pandas as pd
from pydantic import ValidationError

from gates.evidence import Evidence, MissingEvidenceError
from gates.reproducibility.settings import GENERATORS, MODES, NFE, allowed_nfe, fixtures_of
from gates.reproducibility.weights import weights_at
from genpolicy.errors import ConfigError
from genpolicy.evidence.documents.given import TrainedConfig
from genpolicy.evidence.documents.reproducibility import CandidateIdentity
from genpolicy.evidence.rows.need import ModeRow
from genpolicy.evidence.rows.reproducibility import NfeRow
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.policies.evaluations import allowed_evaluations
from genpolicy.policies.settings import SamplerConfig

WEIGHTS, CONFIG = "model.safetensors", "config.json"


def unlike_files(
    evidence: Evidence, candidate: str, entry: CandidateIdentity, *, seeds: Sequence[int]
) -> list[str]:
    """Pins that are not those of the files that lie there, by name.

    Args:
        evidence: The evidence.
        candidate: The candidate.
        entry: Who it is said to be.
        seeds: Training seeds that are planned; the first is promoted.

    Raises:
        MissingEvidenceError: A table lacks the candidate.
    """
    folders = folders_of(evidence, candidate)
    if not folders:
        return ["checkpoint file"]
    found = []
    weights = [evidence.digest(f"{folder}/{WEIGHTS}") for folder in folders.values()]
    configs = [evidence.digest(f"{folder}/{CONFIG}") for folder in folders.values()]
    known = [
        # The identity of a checkpoint (`genpolicy.policies.checkpoint`), by other words.
        sha256_bytes(f"{one}\n{other}\n".encode())
        for one, other in zip(weights, configs, strict=True)
    ]
    if entry.checkpoint and (
        entry.checkpoint not in entry.checkpoints[:1] or sorted(entry.checkpoints) != sorted(known)
    ):
        found.append("checkpoint: not the files of its trainings")
    elif entry.checkpoint and entry.checkpoint != dict(zip(folders, known, strict=True)).get(
        seeds[0]
    ):
        found.append(f"checkpoint: not that of training seed {seeds[0]}, the first that is planned")
    if lacking := set(seeds) - set(folders):
        found.append(f"seed: {_listed(lacking)} planned and not trained")
    if entry.config and sorted(entry.config) != sorted(configs):
        found.append("config: not the files of its trainings")
    return found + _unasked(evidence, candidate, set(folders))


def folders_of(evidence: Evidence, candidate: str) -> dict[int, str]:
    """Folder of each training seed, by its number."""
    found = {}
    for path in evidence.bind(f"{GENERATORS}/{candidate}/seed_*/{WEIGHTS}"):
        folder = path.rpartition("/")[0]
        number = folder.rpartition("_")[2]
        if number.isdecimal():
            found[int(number)] = folder
    evidence.bind(f"{GENERATORS}/{candidate}/seed_*/{CONFIG}")
    return found


def _unasked(evidence: Evidence, candidate: str, trained: set[int]) -> list[str]:
    """Tables that do not hold each training seed once at least, by name."""
    asked = {
        "samples": set(fixtures_of(evidence, candidate)),
        "evaluations": set(evidence.of(NFE, NfeRow, candidate)["seed"]),
        "modes": trained,
    }
    # Without any the questions about modes have no answer, and say so themselves.
    with contextlib.suppress(MissingEvidenceError):
        asked["modes"] = set(evidence.of(MODES, ModeRow, candidate)["seed"])
    return [
        f"seed: {name} are of {_listed(seeds)}, trained were {_listed(trained)}"
        for name, seeds in asked.items()
        if not seeds >= trained
    ]


def _listed(seeds: set[int]) -> str:
    return ", ".join(str(seed) for seed in sorted(seeds)) or "none"


def evaluations_said(evidence: Evidence, candidate: str) -> str:
    """Network evaluations of a sample that the definition allows, as a card says them."""
    allowed = allowed_nfe(evidence, candidate)
    return " to ".join(f"{count:.0f}" for count in dict.fromkeys(allowed))


def nonfinite_that_lie(evidence: Evidence, candidate: str) -> int:
    """Weights of all trainings of a candidate that are no numbers, where they lie.

    Raises:
        MissingEvidenceError: A file of weights is none.
    """
    folders = folders_of(evidence, candidate).values()
    return sum(weights_at(evidence, f"{folder}/{WEIGHTS}").nonfinite for folder in folders)


def weights_that_lie(evidence: Evidence, candidate: str) -> int:
    """How many weights all trainings of a candidate have, where they lie; errors as above."""
    folders = folders_of(evidence, candidate).values()
    return sum(weights_at(evidence, f"{folder}/{WEIGHTS}").count for folder in folders)


def require_by_definition(rows: pd.DataFrame, candidate: str, config: TrainedConfig) -> None:
    """Counts that are said to be allowed are those of the sampler that the checkpoint has.

    Args:
        rows: `nfe.parquet` of the candidate.
        candidate: The candidate.
        config: Its configuration.

    Raises:
        MissingEvidenceError: Others, or nobody wrote down what that sampler takes.
    """
    try:
        allowed = allowed_evaluations(SamplerConfig.model_validate(config.sampler))
    except (ConfigError, ValidationError) as error:
        raise MissingEvidenceError(f"the sampler of {candidate} has no definition") from error
    for row in rows.to_dict("records"):
        said = row["least"], row["most"], row["expected"]
        if said != (allowed.least, allowed.most, allowed.nearest(int(row["counted"]))):
            raise MissingEvidenceError(
                f"{NFE} allows {candidate} {said[0]} to {said[1]} evaluations; by its definition "
                f"{config.sampler['name']} takes {allowed.least} to {allowed.most}"
            )
