"""Whole reports held against versions of them that lie beside the tests.

Where the versions come from: the gates of this repository judged the synthetic evidence of
`evidence.py`, as it is and made uneven by the test. Not every row of them was read when they were
written, so they do not show that a number is right: that is shown by the tests beside the modules,
from outside sources. These show that no other number, interval, verdict or sentence of the report
moved unseen. After a change that is meant, write them again and read the difference:

    GOLDEN=write python -m pytest -n 0 tests/gates/golden
"""

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))
import held

GOLDEN = Path(__file__).parent / "golden"
OF_REPORT = ("verdict", "candidates", "promoted", "decision", "diagnosis", "caveats", "settings")


def told(report) -> dict[str, Any]:
    """What a report says to its reader, and by which files: all but hashes and library versions."""
    whole = report.model_dump(mode="json")
    criteria = {f"{c['id']}, {c['candidate']}": c for c in whole["criteria"]}
    said = {name: whole[name] for name in OF_REPORT}
    return said | {"criteria": criteria, "materials": sorted(whole["materials"])}


def hold(name: str, found: dict[str, Any]) -> None:
    """Compare with the version of that name; with GOLDEN=write, write it, and be red."""
    held.hold(GOLDEN / f"{name}.json", found)
