"""Policies that were brought: who they are is read again from their entries and their files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gates.reproducibility.settings import BROUGHT_FOLDER
from gates.settings import section_of
from gates.stated import compare_keys, mapping, training_seed
from genpolicy.candidates.brought import BroughtPolicy, read_brought
from genpolicy.candidates.wire.entry import verify_files
from genpolicy.evidence.documents.brought import BROUGHT, brought_document
from genpolicy.integrity.documents import read_json


def brought_policy(root: Path, params: Mapping[str, Any], name: str) -> BroughtPolicy | None:
    """The policy of that name, if it was brought.

    Raises:
        ConfigError: Its entry cannot be read, or the section is missing.
    """
    entries = mapping(section_of(params, "candidates"))
    if name not in entries:
        return None
    seed = training_seed(params)
    number = seed if isinstance(seed, int) else 0
    return read_brought({name: str(entries[name])}, seed=number, root=root)[0]


def rederive_brought(root: Path, params: Mapping[str, Any]) -> None:
    """Hold what the stage wrote against the entries and the files as they are now.

    Raises:
        RefusedError: An entry says something else than the stage wrote.
        IntegrityError: A file is missing, or another one than its entry says.
        ConfigError: An entry cannot be read.
    """
    entries = {name: str(path) for name, path in section_of(params, "candidates").items()}
    policies = read_brought(entries, seed=0, root=root)
    for policy in policies:
        verify_files(policy.entry, policy.folder)
    found = brought_document(policies)
    stated = mapping(read_json(root / BROUGHT_FOLDER / BROUGHT.file))
    how = "as its entry says now"
    compare_keys("B", f"{BROUGHT_FOLDER}/{BROUGHT.file}", stated, BROUGHT.plain(found), how)
