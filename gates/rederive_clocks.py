"""The two clocks: what the checker and the tables say of their windows, against the journals."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gates.rederive_sessions import rederive_sessions
from gates.stated import compare_keys, compare_rows, section
from gates.stress.clocks import WALL_CLOCK
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.shadow.tables import checked
from genpolicy.execution.cell import ExecutionSettings
from genpolicy.integrity.tables import read_table
from genpolicy.verification.checker import check_journal
from genpolicy.verification.clocks import derived_windows
from genpolicy.verification.expected import ExpectedSettings
from genpolicy.verification.journal_source import readable
from genpolicy.verification.motion import ExpectedMotion

WINDOW = ("method", "clock", "episode")
KEYS = {
    "invocations": (*WINDOW, "invocation"),
    "ages": (*WINDOW, "invocation", "row"),
    "ticks": WINDOW,
}


def rederive_clocks(
    root: Path, params: Mapping[str, Any], held_to: tuple[ExpectedSettings, ExpectedMotion]
) -> None:
    """Hold what Gate D prints of the two clocks against their journals; nothing where none ran.

    Args:
        root: Root of the workspace.
        params: `params.yaml`.
        held_to: What every session must have declared, and what every executed row must keep to.

    Raises:
        RefusedError: A row, or a finding of the checker, is not what the journals say, or a window
            was made by another policy.
        IntegrityError: A file is missing or no regular file.
        BadInputError: A file cannot be read.
    """
    folder = root / WALL_CLOCK
    if not folder.is_dir():
        return
    journals = sorted(folder.glob("journals/*.mcap"))
    again = checked({path.name: check_journal(path, *held_to).as_document() for path in journals})
    stated, where = CHECKER.read(folder), f"{WALL_CLOCK}/{CHECKER.file}"
    compare_keys("D", where, CHECKER.plain(stated), CHECKER.plain(again), "as checked again")
    rederive_sessions(root, "D", params, journals, recorded=True)
    deadline_s = section(params, "execution", ExecutionSettings).deadline_s
    with readable(f"{WALL_CLOCK}/journals"):
        found = derived_windows(journals, deadline_s=deadline_s)
    for name, keys in KEYS.items():
        path = f"{WALL_CLOCK}/{name}.parquet"
        rows = getattr(found, name)
        compare_rows("D", path, keys, read_table(root / path).to_pylist(), rows, seed=None)
