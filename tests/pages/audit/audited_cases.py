"""Planted causes, and the document of their audit."""

from planar import LIMITS

from gates.cause import cause_of

CASES = {
    "valid": {"episodes": 160, "recoveries": 20},
    "clock": {"episodes": 100, "clock_steps": 3},
    "labels": {"episodes": 100, "wrong_labels": 0.3},
    "operator": {"episodes": 100, "modes": "operator"},
    "one": {"episodes": 90, "modes": "none"},
}


BLANK = {"evidence": [], "rests_on": ["Units were guessed: <b>tcp</b>."], "modes": []}


def document(folder):
    cause = cause_of(folder, LIMITS)
    return {
        "verdict": cause.name.value, "variable": cause.variable, "kind": cause.kind,
        "layer": cause.topic.value, "confidence": cause.confidence,
        "next_action": cause.next_action, "limits": LIMITS.as_json(), **BLANK,
        "coverage": LIMITS.confidence,
        "questions": [answer.as_json() for answer in cause.answers],
        "dataset_manifest_sha256": "0" * 64,
    }  # fmt: skip
