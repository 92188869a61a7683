"""What an import gives back."""

from dataclasses import dataclass
from pathlib import Path

from genpolicy.data.assemble import Refusal
from genpolicy.data.formats.contract import ImportContract


@dataclass(frozen=True)
class Opened:
    """Recordings as a dataset.

    Attributes:
        folder: The dataset folder; the recordings themselves where they already were one.
        contract: How they were read: the contract given, or the one proposed.
        found: Episodes found.
        accepted: Episodes accepted.
        refused: Which were refused, and why.
        notes: What was guessed, contradictory or not recorded, a sentence each.
    """

    folder: Path
    contract: ImportContract
    found: int
    accepted: int
    refused: tuple[Refusal, ...]
    notes: tuple[str, ...]
