"""A policy of somebody else for a ladder that has run: its own flow, brought as the docs say."""

import re
import shutil
import sys
from pathlib import Path
from typing import Any

import yaml

from benchmarks.ladder_truth.bringing import FLOW, OWN, as_the_twin
from benchmarks.ladder_truth.workspace import edit_params
from gates.exceptions import utc_today
from genpolicy.integrity.hashing import sha256_file

NAME = "my_flow"
DOCS = Path(__file__).parents[2] / "docs" / "candidates.md"
PLACE = "own/candidate.yaml"


def bring_flow(workspace: Path) -> None:
    """Files, entry and lines of `params.yaml` of the checkpoint that the ladder trained.

    Entry, `declared` and lines are those of docs/candidates.md, with its own hashes, its own
    numbers where the docs have an example's, and this Python where they say `genpolicy`.
    """
    own = workspace / OWN
    shutil.copytree(workspace / FLOW, own / "flow" / "seed_0")
    said = as_the_twin(workspace, NAME)
    entry, declared = documented("candidate.yaml"), documented("declared")
    assert (entry["name"], entry["command"][:2]) == (NAME, ["genpolicy", "serve-policy"])
    entry["command"][0:1] = [sys.executable, "-m", "genpolicy"]
    entry["files"] = {name: sha256_file(own / name) for name in entry["files"]}
    assert set(declared["declared"]) == set(said["declared"])
    entry |= declared | {"declared": said["declared"], "horizons": said["horizons"]}
    (workspace / PLACE).write_text(yaml.safe_dump(entry, sort_keys=False))
    lines = documented("params.yaml")
    assert lines["candidates"] == {NAME: PLACE}

    def change(params: dict[str, Any]) -> None:
        params["candidates"] |= lines["candidates"]
        exceptions = lines["gate_b"]["unmatched"]
        exceptions[NAME]["expires"] = str(utc_today())  # whenever this is run
        params["gate_b"]["unmatched"] |= exceptions

    edit_params(workspace, change)


def documented(name: str) -> dict[str, Any]:
    """The one block of the docs that begins with that file's name, or with that key."""
    blocks = re.findall(r"```yaml\n(.*?)```", DOCS.read_text(), re.DOTALL)
    [text] = [one for one in blocks if one.startswith((f"# {name}\n", f"{name}:"))]
    found: dict[str, Any] = yaml.safe_load(text)
    return found
