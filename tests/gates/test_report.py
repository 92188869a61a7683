"""Reports as files: malformed, doubled or of another version, refused."""

import json

import pytest

from gates.proof import admit
from gates.report import report_path
from genpolicy.errors import IntegrityError


def _edit_report(root, gate, change):
    path = root / report_path(gate)
    report = json.loads(path.read_bytes())
    change(report)
    path.write_text(json.dumps(report, sort_keys=True, indent=2))


@pytest.mark.parametrize("version", [0, 1, "2", True, None])
def test_another_schema_version_asks_to_judge_again(ladder, version):
    _edit_report(ladder, "A", lambda r: r.update(schema_version=version))
    with pytest.raises(IntegrityError, match=r"dvc repro -f gate_a") as caught:
        admit("train_generators", ladder)
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(
    "text",
    [
        '{"schema_version": 2, "schema_version": 2}',
        '{"schema_version": 2, "verdict": NaN}',
        "[]",
        "",
        "{",
        '{"schema_version": 2}',
    ],
)
def test_a_malformed_report_is_an_integrity_error(ladder, text):
    (ladder / report_path("A")).write_text(text)
    with pytest.raises(IntegrityError, match="gate_a"):
        admit("train_generators", ladder)


def test_a_duplicate_key_in_a_true_report_is_refused(ladder):
    path = ladder / report_path("A")
    path.write_text(path.read_text().replace('"gate": "A"', '"gate": "B", "gate": "A"'))
    with pytest.raises(IntegrityError, match="twice"):
        admit("train_generators", ladder)
