"""`genpolicy ingest` and `genpolicy propose`: recordings of one's own to a dataset."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from genpolicy.data.formats import Opened, open_dataset, propose
from genpolicy.data.formats.contract import ImportContract, load_contract, write_contract
from genpolicy.data.formats.open_questions import open_questions
from genpolicy.progress import ProgressLine

SHOWN_REFUSALS = 20


@dataclass(frozen=True)
class Recordings:
    """How a command names recordings.

    Attributes:
        path: File or folder.
        format: Layout, or `auto`.
        contract: contract.yaml; proposed from the data if absent.
        task: Name of the task, if given.
    """

    path: Path
    format: str = "auto"
    contract: Path | None = None
    task: str | None = None


def given_contract(recordings: Recordings) -> ImportContract | None:
    """The contract that the options name, if they name one.

    Raises:
        ConfigError: The file breaks its schema.
    """
    return None if recordings.contract is None else load_contract(recordings.contract)


def run_ingest(recordings: Recordings, *, out: Path, as_json: bool) -> int:
    """Import, and print what was accepted, refused, guessed and missing."""
    progress = ProgressLine("episodes")
    try:
        opened = open_dataset(
            recordings.path,
            out=out,
            format=recordings.format,
            contract=given_contract(recordings),
            task=recordings.task,
            progress=progress,
        )
    finally:
        progress.close()
    print(json.dumps(document_of(opened), indent=2) if as_json else as_text(opened))
    return 0


def run_propose(path: Path, *, out: Path, format: str, task: str | None) -> int:
    """Write the proposal, and print what it leaves open."""
    contract = propose(path, format=format, task=task)
    write_contract(out, contract)
    print(f"contract  {out}")
    print(f"channels  {', '.join(f'{c.name} ({len(c.components)})' for c in contract.channels)}")
    print(f"action    {len(contract.action.components)} numbers at {contract.rate_hz:g} Hz")
    for note in dict.fromkeys([*contract.notes, *open_questions(contract)]):
        print(f"note      {note}")
    return 0


def document_of(opened: Opened) -> dict[str, Any]:
    """What an import did, as plain values."""
    return {
        "dataset": str(opened.folder),
        "format": opened.contract.format,
        "found": opened.found,
        "accepted": opened.accepted,
        "refused": [{"file": r.file, "reason": r.reason} for r in opened.refused],
        "notes": list(opened.notes),
    }


def as_text(opened: Opened) -> str:
    """What an import did, for a person."""
    lines = [
        f"dataset   {opened.folder}",
        f"found     {opened.found}",
        f"accepted  {opened.accepted}",
        f"refused   {len(opened.refused)}",
    ]
    lines += [f"  {refusal.reason}" for refusal in opened.refused[:SHOWN_REFUSALS]]
    if len(opened.refused) > SHOWN_REFUSALS:
        rest = len(opened.refused) - SHOWN_REFUSALS
        lines.append(f"  and {rest} more, all in {opened.folder / 'refusals.json'}")
    lines += [f"note      {note}" for note in opened.notes]
    return "\n".join(lines)
