"""Who was brought (`candidates.json`), and whose process failed in reload (`faults.json`)."""

from collections.abc import Sequence
from dataclasses import dataclass

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.hosts.commands import installed_module
from genpolicy.candidates.hosts.translation import program_files
from genpolicy.candidates.wire.entry import ServerEntry
from genpolicy.documents.document import Count, Document


@dataclass(frozen=True)
class Brought:
    """A policy that was not trained here.

    Attributes:
        kind: How it is hosted.
        author: Who made it, as an e-mail address; may not review it.
        sha256: Of what its entry says.
        files: What it is: SHA-256 of each file, by path from the entry's folder.
        program: What runs it beside them: SHA-256 of the adapter, or of each file that its command
            names from that folder; of an installed module that it names, by `name==version`, of
            what the record of the distribution says of the module's files.
        started_here: Whether the ladder starts its server; else somebody else does.
        stochastic: Whether its candidates differ; else one is drawn.
        dataset: SHA-256 of the manifest of the dataset that it was trained on; empty if unsaid.
        training_seed: Root seed of its training; None if unsaid.
    """

    kind: str
    author: str
    sha256: str
    files: dict[str, str]
    program: dict[str, str]
    started_here: bool
    stochastic: bool
    dataset: str
    training_seed: int | None


BROUGHT = Document("candidates.json", dict[str, Brought])
"""By name."""


@dataclass(frozen=True)
class Failed:
    """How the process of a brought policy failed while it was reloaded.

    Attributes:
        asked: Invocations.
        faults: How many of them ended in each kind of fault.
        last_words: What was seen at the last of them; empty without any.
    """

    asked: Count
    faults: dict[str, Count]
    last_words: str


FAULTS = Document("faults.json", dict[str, Failed])
"""By name, of those that were brought; missing where none was."""


def brought_document(policies: Sequence[BroughtPolicy]) -> dict[str, Brought]:
    """What the stage writes of the policies that were brought."""
    return {
        policy.name: Brought(
            kind=policy.entry.kind,
            author=policy.entry.author,
            sha256=policy.sha256,
            files=dict(policy.entry.files),
            program=_program(policy),
            started_here=policy.entry.started_here,
            stochastic=policy.entry.stochastic,
            dataset=policy.entry.declared.dataset if policy.entry.declared else "",
            training_seed=policy.entry.declared.training_seed if policy.entry.declared else None,
        )
        for policy in policies
    }


def _program(policy: BroughtPolicy) -> dict[str, str]:
    found = program_files(policy.entry, policy.folder)
    if isinstance(policy.entry, ServerEntry):
        found |= installed_module(policy.entry, policy.folder)
    return found
