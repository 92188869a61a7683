"""Stage `task`: the identity of the task that everything else is measured on.

It runs every time (`always_changed`): a task may be installed outside the tree, where nothing
else sees an edit. What it writes changes only when the task does.
"""

from genpolicy.integrity.atomic import output_folder, write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.tasks.identity import IDENTITY_FILE, task_identity
from stages._stage import ARTIFACTS, Params, main


def work(params: Params) -> None:
    """Write the identity."""
    with output_folder(ARTIFACTS / "task") as folder:
        write_bytes(folder / IDENTITY_FILE, canonical_json(task_identity(params.task.name)))


if __name__ == "__main__":
    main("task", work)
