"""Every file that the verdicts of gates A to D rest on, so that another machine can derive them.

That is what the pipeline lists: what its stages read (code, settings, fixtures) and what they
wrote, and the files of policies that were brought. Papers of Gate E stay behind: who may sign is
said by the reader's own allow-list, never by one that comes with what was signed.
"""

from collections.abc import Iterable
from pathlib import Path, PurePosixPath

from gates.overrides import OVERRIDES
from gates.pipeline import (
    CODE,
    IGNORED,
    LOCK,
    PARAMS,
    PIPELINE,
    RUNGS,
    files_at,
    names_in,
    stages_of,
)
from gates.preregistration import PREREGISTRATION
from gates.report import GATES, stage_of
from gates.settings import read_params, section_of
from genpolicy.candidates.brought import BroughtPolicy, read_brought
from genpolicy.candidates.hosts.translation import program_files
from genpolicy.candidates.wire.entry import ServerEntry
from genpolicy.errors import ConfigError

SETTINGS = (PIPELINE, LOCK, IGNORED, PARAMS, PREREGISTRATION, OVERRIDES, "fixtures.yaml")
LAST = GATES[-1]
OF_THE_CARD = (*RUNGS[LAST], stage_of(LAST))
"""Stages whose outputs stay behind."""


def files_of_the_run(root: Path) -> tuple[str, ...]:
    """Paths from the root of the workspace, sorted.

    Raises:
        ConfigError: The pipeline, the parameters or an entry cannot be read, or an entry lies
            outside the workspace or behind a link.
        IntegrityError: One of the files is a link.
    """
    listed = {*SETTINGS, *CODE, *_of_policies(root)}
    for name, stage in stages_of(root, PIPELINE).items():
        if name not in OF_THE_CARD:
            for part in ("deps", "outs", "metrics", "plots"):
                listed |= set(names_in(stage.get(part)))
    for path in sorted(listed):
        _require_below(root, path, f"{PIPELINE} or an entry")
    return tuple(sorted({file for path in listed for file in files_at(root, path)}))


def brought(root: Path) -> list[BroughtPolicy]:
    """Policies of the section `candidates`.

    Raises:
        ConfigError: The section or an entry cannot be read.
    """
    entries = section_of(read_params(root), "candidates")
    return read_brought({n: str(p) for n, p in entries.items()}, seed=0, root=root)


def _of_policies(root: Path) -> Iterable[str]:
    """Entries, the files that they name, and those that a command of one names beside them.

    An adapter is ours, and read from the checkout of whoever asks again.
    """
    entries = section_of(read_params(root), "candidates")
    for policy in brought(root):
        where = f"{PARAMS}: candidates.{policy.name}"
        entry = PurePosixPath(str(entries[policy.name]))
        own = set(policy.entry.files)
        if isinstance(policy.entry, ServerEntry):
            own |= set(program_files(policy.entry, policy.folder))
        for name in (entry, *(entry.parent / file for file in sorted(own))):
            _require_below(root, name.as_posix(), where)
            yield name.as_posix()


def _require_below(root: Path, path: str, where: str) -> None:
    """Refuse what leads out of the workspace, or to a file by another name."""
    plain = root.resolve() / path
    if ".." in PurePosixPath(path).parts or plain.resolve() != plain or path.startswith("/"):
        raise ConfigError(
            where=where,
            found=f"{path}, which lies outside the workspace or behind a link",
            expected="files below the workspace, by their own names",
            action="Put the files into the workspace: what is named elsewhere is not carried.",
        )
