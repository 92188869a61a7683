"""Stage `task`: the identity of the task, and of the recordings that are brought to it.

It runs every time (`always_changed`): a task may be installed and recordings may lie outside the
tree, where nothing else sees an edit. What it writes changes only when they do. Coming first, it
also stops the ladder before a stage would replace files that somebody else put in its folder,
where a fixture (controller, limits, supervisor, scene) is not the one that is pinned, where a
policy that is brought is not what its entry says, or does not answer where it should run already,
where an exception of one is over, where a method or a sampler of any section is none, where what
may differ between methods never may, where the machine has no such device, and where the task does
not do the same again: before anything trains.
"""

import sys
from pathlib import Path

from gates.exceptions import require_unmatched, unmatched_written, utc_today
from gates.may_differ import require_possible
from gates.protection import is_rehearsal
from genpolicy.candidates.brought import BroughtPolicy, BroughtSection, require_brought
from genpolicy.candidates.hosts.loadable import require_answering, require_loadable
from genpolicy.candidates.mapped import require_mapped
from genpolicy.candidates.planned import require_compared
from genpolicy.contract.planner import PLANNER
from genpolicy.documents.task import IDENTITY
from genpolicy.errors import BadInputError, ConfigError, IntegrityError
from genpolicy.evidence.documents.reproducibility import CANDIDATES
from genpolicy.evidence.failure_search.settings import search_settings
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.integrity.atomic import output_folder, write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.outputs import require_own_files
from genpolicy.policies.determinism import require_device
from genpolicy.tasks.api import load_task
from genpolicy.tasks.fixtures import fixture_hashes, require_pinned
from genpolicy.tasks.identity import task_identity
from genpolicy.tasks.same_again import require_same_again
from stages._samplers import require_samplers
from stages._source import SOURCE_FILE, SourceSection, refuse_foreign_files, source_document
from stages._stage import ARTIFACTS, Params, main


def work(params: Params) -> None:
    """Write both identities."""
    require_device(params.compute.device)
    refuse_foreign_files()
    require_own_files(Path.cwd())
    require_possible(params.raw.get("comparison"))
    search_settings(params.raw)  # read by a stage behind the last gate; wrong, it is told here
    simple = params.section("stress", StressSettings).baselines
    require_compared(params.task.name, simple, rehearsal=is_rehearsal(params.raw))
    entries = params.section("candidates", BroughtSection).root
    # The planner is that of the task, whether it offers one or not.
    taken = [PLANNER, *require_samplers(params)]
    brought = require_brought(entries, horizons=params.horizons, trained=taken)
    names = [policy.entry.name for policy in brought]
    require_unmatched(unmatched_written(params.raw), utc_today(), brought=names)
    if brought:
        task = load_task(params.task.name)
        require_mapped(brought, task)
        for policy in brought:
            require_loadable(policy.entry, policy.path, task.observation)
            _require_answering(policy)
    identity = task_identity(params.task.name)
    require_pinned(Path.cwd(), params.task.name, fixture_hashes(identity))
    section = params.section("source", SourceSection)
    source = source_document(section)
    require_same_again(
        load_task(params.task.name),
        period_s=params.horizons.action_period_s,
        demonstrates=section.kind == "embedded",
    )
    with output_folder(ARTIFACTS / "task") as folder:
        write_bytes(folder / IDENTITY.file, canonical_json(identity))
        write_bytes(folder / SOURCE_FILE, canonical_json(source))


def _require_answering(policy: BroughtPolicy) -> None:
    """Before anything trains; who has been asked by Gate B may have ended since, and is told so."""
    try:
        require_answering(policy.entry, policy.path)
    except ConfigError as error:
        if not _asked(policy):
            raise
        print(f"task: {error}", file=sys.stderr)


def _asked(policy: BroughtPolicy) -> bool:
    """Whether the evidence of Gate B is of this entry.

    Raises:
        BadInputError: It cannot be read.
    """
    folder = ARTIFACTS / "reload"
    if not (folder / CANDIDATES.file).exists():
        return False
    try:
        own = CANDIDATES.read(folder).get(policy.name)
    except (BadInputError, IntegrityError) as error:
        raise BadInputError(
            where=f"the policy {policy.name}",
            found="silent, and whether Gate B has asked it cannot be read",
            expected=f"an answer, or a whole {folder / CANDIDATES.file} ({error})",
            action="Start it: then nobody asks the document, and stage `reload` writes it again.",
        ) from error
    return own is not None and own.checkpoint == policy.sha256


if __name__ == "__main__":
    main("task", work)
