"""Drafting the trial card from the passed ladder: what the card stage calls."""

from pathlib import Path

from gates.admission import Admission
from gates.card import CardSettings, TrialCard, draft_card, promoted
from gates.models import parse_section
from gates.registry import plain_section
from genpolicy.errors import IntegrityError
from genpolicy.integrity.documents import read_json

IDENTITY = "artifacts/reload/identity.json"


def draft(root: Path, admission: Admission) -> TrialCard:
    """The draft of an admitted card stage; the fields of the reviewer stay empty.

    Args:
        root: Repository root.
        admission: What `admit("card", root)` returned: gates A to D, proved and passed.

    Raises:
        ConfigError: Section `card` is missing or wrong.
        IntegrityError: Gate B pinned no checkpoint of the promoted candidate.
        RefusedError: Gate D promotes no one.
    """
    settings = parse_section(CardSettings, plain_section(root, "card"), where="params.yaml: card")
    candidate = promoted(admission.reports["D"])
    identity = read_json(root / IDENTITY)
    entry = identity.get(candidate) if isinstance(identity, dict) else None
    checkpoint = entry.get("checkpoint") if isinstance(entry, dict) else None
    if not isinstance(checkpoint, str) or not checkpoint:
        raise IntegrityError(
            where=f"{IDENTITY}: {candidate}.checkpoint",
            found="missing",
            expected="the hash of the promoted checkpoint",
            action="Run `dvc repro reload`.",
        )
    return draft_card(settings, admission.reports, admission.hashes, checkpoint)
