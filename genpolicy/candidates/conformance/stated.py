"""What Gate B will say of an entry whatever its policy answers: read, and nobody is asked."""

from dataclasses import dataclass

from genpolicy.candidates.conformance.finding import Finding
from genpolicy.candidates.wire.entry import Entry


@dataclass(frozen=True)
class DatasetHashes:
    """What `declared` says of the dataset, if the policy was trained on this one.

    Attributes:
        manifest: SHA-256 of its manifest.
        split: SHA-256 of its split.
    """

    manifest: str
    split: str


def stated(entry: Entry, data: DatasetHashes) -> list[Finding]:
    """Whether what Gate B reads in an entry is there, and true of the dataset."""
    return [_pinned(entry), _declared(entry, data)]


def _pinned(entry: Entry) -> Finding:
    if not entry.files:
        said = "`files` names none: nobody knows by a hash which weights answered"
        return Finding("pinned", "fails", "B", said)
    said = f"{len(entry.files)} files by hash; whether they are all of it, nobody can tell"
    return Finding("pinned", "holds", "B", said)


def _declared(entry: Entry, data: DatasetHashes) -> Finding:
    said = entry.declared
    if said is None:
        nothing = "nothing: without `declared` each item of the identity card is unknown"
        return Finding("declared", "fails", "B", nothing)
    if said.dataset != data.manifest:
        other = "another dataset than this one: Gate B fails it unless `gate_b.unmatched` names it"
        return Finding("declared", "unknown", "B", other)
    if said.split != data.split:
        other = f"this dataset, and {said.split[:16]}… as its split, which is {data.split[:16]}…"
        return Finding("declared", "fails", "B", other)
    return Finding("declared", "holds", "B", "all of it, and the split of this dataset")
