"""Whole reports held against versions of them that lie beside the tests.

Where the versions come from: the gates of this repository judged the synthetic evidence of
`evidence.py`, as it is and made uneven by the test. Not every row of them was read when they were
written, so they do not show that a number is right: that is shown by the tests beside the modules,
from outside sources. These show that no other number, interval, verdict or sentence of the report
moved unseen. After a change that is meant, write them again and read the difference:

    GOLDEN=write python -m pytest -n 0 tests/gates/golden
"""

import json
import os
from pathlib import Path
from typing import Any

import pytest

GOLDEN = Path(__file__).parent / "golden"
OF_REPORT = ("verdict", "candidates", "promoted", "decision", "diagnosis", "caveats", "settings")
ROUNDING = 1e-9
"""Of a number as a share of it, and about 0: what another library of algebra may add."""


def told(report) -> dict[str, Any]:
    """What a report says to its reader, and by which files: all but hashes and library versions."""
    whole = report.model_dump(mode="json")
    criteria = {f"{c['id']}, {c['candidate']}": c for c in whole["criteria"]}
    said = {name: whole[name] for name in OF_REPORT}
    return said | {"criteria": criteria, "materials": sorted(whole["materials"])}


def hold(name: str, found: dict[str, Any]) -> None:
    """Compare with the version of that name; with GOLDEN=write, write it, and be red."""
    file = GOLDEN / f"{name}.json"
    if os.environ.get("GOLDEN") == "write":
        file.write_text(json.dumps(found, indent=1, sort_keys=True, ensure_ascii=False) + "\n")
        pytest.fail(f"{file.name} was written: read the difference, then ask again")
    assert list(differences(json.loads(file.read_text()), found)) == []


def differences(golden: Any, found: Any, place: str = ""):
    """Places at which two documents differ, with both values."""
    if isinstance(golden, dict) and isinstance(found, dict):
        for key in sorted({*golden, *found}):
            yield from differences(golden.get(key), found.get(key), f"{place}/{key}")
    elif isinstance(golden, list) and isinstance(found, list) and len(golden) == len(found):
        for number, pair in enumerate(zip(golden, found, strict=True)):
            yield from differences(*pair, f"{place}/{number}")
    elif type(golden) is type(found) is float:
        if found != pytest.approx(golden, rel=ROUNDING, abs=ROUNDING):
            yield place, golden, found
    elif golden != found or type(golden) is not type(found):
        yield place, golden, found
