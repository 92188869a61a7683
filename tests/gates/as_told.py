"""Whole reports held against versions of them that lie beside the tests.

Where the versions come from: the gates of this repository judged the synthetic evidence of
`evidence.py`, made uneven by the test, and the file was read by a person before it was committed.
What a number has to be is shown by the tests beside the modules, from outside sources; these show
that no other number, interval, verdict or sentence of the report moved unseen. After a change that
is meant, write them again and read the difference:

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
    """What a report says to its reader: all but hashes and library versions."""
    whole = report.model_dump(mode="json")
    criteria = {f"{c['id']}, {c['candidate']}": c for c in whole["criteria"]}
    return {name: whole[name] for name in OF_REPORT} | {"criteria": criteria}


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
