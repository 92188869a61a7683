"""What pins a candidate: hashes of what lies there, a card that agrees with checkpoint and plan."""

from gates.configured import CHECKPOINT, entry_of, otherwise
from gates.criterion import Measured
from gates.evidence import Evidence, MissingEvidenceError
from gates.need.settings import TRAINED as BASELINES
from gates.reproducibility.compute import cost_of, miscounted
from gates.reproducibility.files import WEIGHTS, evaluations_said, folders_of, unlike_files
from gates.reproducibility.identity import contradicted, says_nothing, unplanned, unrecorded
from gates.reproducibility.settings import (
    BROUGHT_FOLDER,
    GENERATORS,
    RELOAD,
    ReproducibilitySettings,
)
from gates.reproducibility.weights import weights_at
from genpolicy.evidence.documents.brought import BROUGHT, Brought
from genpolicy.evidence.documents.given import MATCHED, TrainedConfig
from genpolicy.evidence.documents.reproducibility import CANDIDATES, CandidateIdentity
from genpolicy.evidence.split import split_sha256
from genpolicy.integrity.documents import canonical_json, read_json
from genpolicy.integrity.hashing import sha256_bytes

MANIFEST = "artifacts/ingest/manifest.json"
TOTAL = "total"


def unpinned(evidence: Evidence, settings: ReproducibilitySettings, candidate: str) -> Measured:
    """How many items are not pinned, not recorded, or not what checkpoint and plan say.

    Raises:
        MissingEvidenceError: What would tell is not there.
    """
    entry = identity_of(evidence, candidate)
    pins = {
        "checkpoint": entry.checkpoint,
        "config": entry.config,
        "dataset": entry.dataset,
        "normalisation": entry.normalisation,
        "seed": entry.seed,
        "sampler": entry.sampler,
    }
    missing = [name for name, pin in pins.items() if says_nothing(pin)]
    if candidate in settings.brought:
        return _unpinned_of_brought(evidence, settings, candidate, missing)
    missing += unlike_files(evidence, candidate, entry, seeds=settings.seeds)
    if entry.dataset != evidence.digest(MANIFEST):
        missing.append("dataset: trained on another one than the audited")
    config = config_of(evidence, candidate)
    missing += unrecorded(entry.card)
    own = config.provenance.get("episodes_sha256") or _split(evidence)
    counts = evaluations_said(evidence, candidate)
    missing += contradicted(entry, config, split=own, evaluations=counts)
    missing += miscounted(cost_of(evidence, candidate, config), config)
    if entry.card.device != settings.device:
        missing.append(f"device: ran on {entry.card.device}, compute.device is {settings.device}")
    missing += unplanned(entry.card, settings, draws=config.sampler.get("name"))
    if folders_of(evidence, candidate):
        missing += otherwise(evidence, GENERATORS, candidate, first=settings.seeds[0])
        missing += _reference(evidence, settings)
        missing += _unlike_weights(evidence, candidate, entry)
        missing += _unlike_seeds(evidence, candidate, entry)
    missing += _unlike_hashes(entry, config)
    return Measured(float(len(missing)), caveat=", ".join(missing) or "all pinned by hash")


def _reference(evidence: Evidence, settings: ReproducibilitySettings) -> list[str]:
    """What the reference of the comparison is said to be, against the baseline's own checkpoint."""
    said = evidence.document(GENERATORS, MATCHED)
    if said.reference not in said.methods:
        return []  # that nothing is compared with it is another question's answer
    found = otherwise(
        evidence, GENERATORS, said.reference, first=settings.seeds[0], place=BASELINES
    )
    return [f"reference {said.reference}: {one}" for one in found]


def _unlike_weights(evidence: Evidence, candidate: str, entry: CandidateIdentity) -> list[str]:
    """Count and precision of the weights, where they are not those of the card, by training."""
    found = []
    for folder in folders_of(evidence, candidate).values():
        weights = weights_at(evidence, f"{folder}/{WEIGHTS}")
        name = folder.rpartition("/")[2]
        if weights.count != entry.card.parameters:
            found.append(f"parameters: {entry.card.parameters}, {name} holds {weights.count}")
        if weights.precision != entry.card.precision:
            found.append(f"precision: {entry.card.precision}, {name} is {weights.precision}")
    return found


def _unlike_seeds(evidence: Evidence, candidate: str, entry: CandidateIdentity) -> list[str]:
    """Training seeds that are not those of the configurations that lie there."""
    folders = folders_of(evidence, candidate).values()
    own = sorted(evidence.document(folder, CHECKPOINT).training_seed for folder in folders)
    if sorted(entry.seed) == own or says_nothing(entry.seed):
        return []
    said, trained = (", ".join(map(str, seeds)) for seeds in (sorted(entry.seed), own))
    return [f"seed: {said}; its trainings have {trained}"]


def _unlike_hashes(entry: CandidateIdentity, config: TrainedConfig) -> list[str]:
    """Pins of a part of the configuration that are not its hash."""
    parts = {"normalisation": config.normalisation, "sampler": config.sampler}
    return [
        f"{name}: not the hash of the checkpoint's own"
        for name, part in parts.items()
        if not says_nothing(pin := getattr(entry, name))
        and pin != sha256_bytes(canonical_json(part))
    ]


def _unpinned_of_brought(
    evidence: Evidence, settings: ReproducibilitySettings, candidate: str, missing: list[str]
) -> Measured:
    """Of a policy behind the wire: its entry pins what it is, and says what is on the card."""
    entry, brought = identity_of(evidence, candidate), brought_of(evidence, candidate)
    if not brought.files:
        missing.append("checkpoint file: its entry names none by hash")
    if entry.checkpoint != brought.sha256:
        missing.append("checkpoint: another entry was asked than stands in the stage candidates")
    if brought.training_seed is None or entry.seed != [brought.training_seed]:
        missing.append("seed: not the one that its entry declares")
    text = "entry and files pinned by hash; what its maker declares is not checked"
    if entry.dataset != evidence.digest(MANIFEST):
        other = "dataset: trained on another one than the audited"
        if candidate in settings.unmatched:
            text += f"; {other}, by exception"
        else:
            missing.append(other)
    elif entry.card.split and entry.card.split != _split(evidence):
        missing.append("split: not that of the audited dataset, which it says it was trained on")
    missing += unrecorded(entry.card)
    missing += unplanned(entry.card, settings, draws=brought.stochastic)
    return Measured(float(len(missing)), caveat=", ".join(missing) or text)


def _split(evidence: Evidence) -> str:
    """Of the audited dataset, whose manifest is bound already; empty where it has none."""
    manifest = read_json(evidence.root / MANIFEST)
    return split_sha256(manifest) if "split" in manifest else ""


def brought_of(evidence: Evidence, candidate: str) -> Brought:
    """Entry of a candidate that was brought.

    Raises:
        MissingEvidenceError: None.
    """
    entry = evidence.document(BROUGHT_FOLDER, BROUGHT).get(candidate)
    if entry is None:
        raise MissingEvidenceError(f"{BROUGHT_FOLDER}/{BROUGHT.file} has no entry of {candidate}")
    return entry


def config_of(evidence: Evidence, candidate: str) -> TrainedConfig:
    """Configuration of a candidate that was trained here, of the training that is promoted.

    Raises:
        MissingEvidenceError: None.
    """
    return entry_of(evidence, GENERATORS, candidate)[1].config


def identity_of(evidence: Evidence, candidate: str) -> CandidateIdentity:
    """Who a candidate is said to be.

    Raises:
        MissingEvidenceError: Nobody says.
    """
    entry = evidence.document(RELOAD, CANDIDATES).get(candidate)
    if entry is None:
        raise MissingEvidenceError(f"{RELOAD}/{CANDIDATES.file} has no entry of {candidate}")
    return entry
