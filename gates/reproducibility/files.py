"""The files of a candidate's trainings, held against who it is said to be, and of which seeds.

A card may name any hash; what lies in the checkpoint's folder has one. Every training seed that
was trained is asked: a method of which only the best seed has rows was selected.
"""

import contextlib

from gates.evidence import Evidence, MissingEvidenceError
from gates.reproducibility.settings import GENERATORS, MODES, NFE, allowed_nfe, fixtures_of
from genpolicy.evidence.documents.reproducibility import CandidateIdentity
from genpolicy.evidence.rows.need import ModeRow
from genpolicy.evidence.rows.reproducibility import NfeRow
from genpolicy.integrity.hashing import sha256_bytes

WEIGHTS, CONFIG = "model.safetensors", "config.json"


def unlike_files(evidence: Evidence, candidate: str, entry: CandidateIdentity) -> list[str]:
    """Pins that are not those of the files that lie there, by name.

    Raises:
        MissingEvidenceError: A table lacks the candidate.
    """
    folders = _folders(evidence, candidate)
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
    if entry.config and sorted(entry.config) != sorted(configs):
        found.append("config: not the files of its trainings")
    return found + _unasked(evidence, candidate, set(folders))


def _folders(evidence: Evidence, candidate: str) -> dict[int, str]:
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
