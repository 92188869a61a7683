"""Every file that the verdicts of a workspace rest on, so that another machine can derive them.

That is what the pipeline lists: what its stages read (code, settings, fixtures) and what they
wrote, beside the papers of Gate E and the files of policies that were brought.
"""

from collections.abc import Iterable
from pathlib import Path

from gates.card.people import ALLOW_LIST
from gates.card.signing import CARDS
from gates.pipeline import CODE, IGNORED, LOCK, PARAMS, PIPELINE, files_at, names_in, stages_of
from gates.preregistration import PREREGISTRATION
from gates.settings import read_params, section_of
from genpolicy.candidates.brought import BroughtPolicy, read_brought
from genpolicy.errors import ConfigError

SETTINGS = (PIPELINE, LOCK, IGNORED, PARAMS, PREREGISTRATION, ALLOW_LIST, "fixtures.yaml")


def files_of_the_run(root: Path) -> tuple[str, ...]:
    """Paths from the root of the workspace, sorted.

    Raises:
        ConfigError: The pipeline, the parameters or an entry cannot be read, or an entry lies
            outside the workspace.
        IntegrityError: One of the files is a link.
    """
    listed = set(SETTINGS) | set(_of_policies(root))
    for stage in stages_of(root, PIPELINE).values():
        for part in ("deps", "outs", "metrics", "plots"):
            listed |= set(names_in(stage.get(part)))
    listed |= {CARDS, *CODE}
    return tuple(sorted({file for path in listed for file in files_at(root, path)}))


def brought(root: Path) -> list[BroughtPolicy]:
    """Policies of the section `candidates`.

    Raises:
        ConfigError: The section or an entry cannot be read.
    """
    entries = section_of(read_params(root), "candidates")
    return read_brought({n: str(p) for n, p in entries.items()}, seed=0, root=root)


def _of_policies(root: Path) -> Iterable[str]:
    """Entries and the files that they name."""
    home = root.resolve()
    for policy in brought(root):
        for path in (policy.path, *(policy.folder / name for name in policy.entry.files)):
            if not path.resolve().is_relative_to(home):
                raise ConfigError(
                    where=f"params.yaml: candidates.{policy.name}",
                    found=f"{path}, which lies outside the workspace",
                    expected="entries and files below the workspace",
                    action="Put the policy into the workspace: what is named elsewhere cannot "
                    "be carried along.",
                )
            yield path.resolve().relative_to(home).as_posix()
