"""`genpolicy ingest` and `genpolicy propose`: recordings of one's own to a dataset."""

import argparse
import json
from pathlib import Path
from typing import Any

from genpolicy.cli.progress import ProgressLine
from genpolicy.data.formats import FORMATS, Opened, open_dataset, propose
from genpolicy.data.formats.contract import ImportContract, load_contract, write_contract
from genpolicy.data.formats.standing import standing_notes
from genpolicy.errors import ConfigError

EXAMPLES = """examples:
  genpolicy propose recordings/ --out contract.yaml     # look, correct what was guessed
  genpolicy ingest recordings/ --contract contract.yaml --out dataset/
  genpolicy ingest pusht_cchi_v7_replay.zarr --out dataset/
"""
SHOWN_REFUSALS = 20


def add(verbs: "argparse._SubParsersAction[Any]") -> None:
    """Add the verbs `ingest` and `propose`."""
    ingest = verbs.add_parser(
        "ingest",
        help="convert recordings to a verified dataset",
        description="Convert recordings to a verified dataset. Every episode is accepted, or "
        "refused by name with row and reason.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_input(ingest)
    ingest.add_argument("--out", type=Path, required=True, help="dataset folder to write")
    ingest.add_argument("--json", action="store_true", help="print one JSON document")
    ingest.set_defaults(run=run_ingest)
    proposal = verbs.add_parser(
        "propose",
        help="write the contract that an import would guess",
        description="Write the contract that an import would guess, for a person to correct.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_input(proposal, contract=False)
    proposal.add_argument("--out", type=Path, required=True, help="contract.yaml to write")
    proposal.add_argument("--force", action="store_true", help="replace an old contract.yaml")
    proposal.set_defaults(run=run_propose)


def add_input(parser: argparse.ArgumentParser, *, contract: bool = True) -> None:
    """The arguments by which every verb names recordings."""
    parser.add_argument("path", type=Path, metavar="PATH", help="file or folder of recordings")
    parser.add_argument("--format", choices=FORMATS, default="auto", help="layout (default: auto)")
    if contract:
        parser.add_argument(
            "--contract", type=Path, help="contract.yaml; proposed from the data if absent"
        )
    parser.add_argument("--task", help="name of the task; for MCAP, of a registered one")


def given_contract(options: argparse.Namespace) -> ImportContract | None:
    """The contract that the options name, if they name one.

    Raises:
        ConfigError: The file breaks its schema.
    """
    return None if options.contract is None else load_contract(options.contract)


def run_ingest(options: argparse.Namespace) -> int:
    """Import, and print what was accepted, refused, guessed and missing."""
    progress = ProgressLine("episodes")
    try:
        opened = open_dataset(
            options.path,
            out=options.out,
            format=options.format,
            contract=given_contract(options),
            task=options.task,
            progress=progress,
        )
    finally:
        progress.close()
    if opened.folder != options.out:
        raise ConfigError(
            where=str(options.path),
            found="a dataset already",
            expected="recordings",
            action="Use it as it is, for instance with `genpolicy audit`.",
        )
    print(json.dumps(as_json(opened), indent=2) if options.json else as_text(opened))
    return 0


def run_propose(options: argparse.Namespace) -> int:
    """Write the proposal, and print what it leaves open."""
    if options.out.exists() and not options.force:
        raise ConfigError(
            where=str(options.out),
            found="there already",
            expected="a new file: somebody may have corrected the old one",
            action="Name another file, or give --force.",
        )
    contract = propose(options.path, format=options.format, task=options.task)
    write_contract(options.out, contract)
    print(f"contract  {options.out}")
    print(f"channels  {', '.join(f'{c.name} ({len(c.components)})' for c in contract.channels)}")
    print(f"action    {len(contract.action.components)} numbers at {contract.rate_hz:g} Hz")
    for note in dict.fromkeys([*contract.notes, *standing_notes(contract)]):
        print(f"note      {note}")
    return 0


def as_json(opened: Opened) -> dict[str, Any]:
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
