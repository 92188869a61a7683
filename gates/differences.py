"""The first place where a report and the one derived again differ, in words."""

import json
from typing import Any

from gates.report import GateReport


def first_difference(report: GateReport, again: GateReport) -> tuple[str, str, str] | None:
    """Place, what is stated there and what was derived; None if all is the same."""
    old, new = _comparable(report), _comparable(again)
    if old == new:
        return None
    place, stated, derived = _first_difference(old, new, "")
    return place, _short(stated), _short(derived)


def _comparable(report: GateReport) -> Any:
    return json.loads(report.model_dump_json())


def _first_difference(old: Any, new: Any, place: str) -> tuple[str, Any, Any]:
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted(set(old) | set(new)):  # by the alphabet what decided comes first
            if old.get(key) != new.get(key) or (key in old) != (key in new):
                return _first_difference(old.get(key), new.get(key), f"{place}.{key}")
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for index, (one, other) in enumerate(zip(old, new, strict=True)):
            if one != other:
                return _first_difference(one, other, f"{place}[{index}]")
    return place, old, new


def _short(value: Any) -> str:
    if isinstance(value, list):
        return f"a list of {len(value)}"
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:59]}…"
