"""Reports as files: malformed, doubled or of another version, refused."""

import json

import pytest
from pydantic import ValidationError

from gates.proof import admit
from gates.readable import limit_text, measured_text
from gates.report import (
    SCHEMA_VERSION,
    StrictModel,
    message,
    parse_report,
    parse_section,
    place,
    report_path,
)
from genpolicy.errors import ConfigError, IntegrityError


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
        '{"schema_version": 4}',
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


def _fault(change, report):
    """The sentence about a report of this version that is otherwise whole."""
    document = json.loads(report)
    change(document)
    with pytest.raises(IntegrityError) as caught:
        parse_report(json.dumps(document).encode(), gate="A")
    return str(caught.value)


def test_the_first_of_several_faults_of_a_report_is_named_with_its_place(ladder):
    report = (ladder / report_path("A")).read_bytes()
    assert parse_report(report, gate="A").schema_version == SCHEMA_VERSION
    one = _fault(lambda r: r.update(verdict="MAYBE"), report)
    assert one.startswith("reports/gate_a.json: verdict is 'MAYBE'")
    several = _fault(lambda r: r.update(verdict="MAYBE", upstream=1, more=2), report)
    assert several.startswith("reports/gate_a.json: verdict is 'MAYBE'")
    deep = _fault(lambda r: r["criteria"][1].update(comparison="<"), report)
    assert deep.startswith("reports/gate_a.json: criteria.1.comparison is '<'")
    assert "gate is a report of gate B" in _fault(lambda r: r.update(gate="B"), report)


class Inner(StrictModel):
    depth_m: float


class Section(StrictModel):
    starts: int
    inner: Inner


@pytest.mark.parametrize(
    ("section", "said"),
    [({"starts": 1.5, "inner": {"depth_m": 1.0}}, "stress.starts is '1.5'"),
     ({"starts": "x", "inner": 3}, "stress.starts is 'x'"),
     ({"starts": 1, "inner": {"depth_m": "deep"}}, "gate_x.inner.depth_m is 'deep'"),
     ({"starts": 1, "inner": {"depth_m": "d" * 70}}, f"gate_x.inner.depth_m is '{'d' * 60}' ("),
     ([1], "gate_x.document is"), ({"starts": float("nan")}, "gate_x is not a plain settings"),
     ({"starts": {1}}, "gate_x is not a plain settings")],
)  # fmt: skip
def test_a_wrong_setting_is_named_where_it_stands(section, said):
    """A key that stands elsewhere is named there; what is no plain value by its section."""
    homes = {"starts": "stress.starts"}
    with pytest.raises(ConfigError) as caught:
        parse_section(Section, section, where="gate_x", homes=homes)
    assert str(caught.value).startswith(said)
    whole = {"starts": 1, "inner": {"depth_m": 0.5}}
    assert parse_section(Section, whole, where="gate_x").inner.depth_m == 0.5


def test_what_was_measured_and_what_is_asked_in_a_sentence(ladder):
    answer = parse_report((ladder / report_path("A")).read_bytes(), gate="A").criteria[0]

    def said(**changes):
        other = answer.model_copy(update={"verdict": "FAIL", "comparison": "<="} | changes)
        return measured_text(other), limit_text(other)

    assert said(measured=1 / 3, threshold=0.25) == ("0.333", "<= 0.25")
    assert said(measured=None, threshold=None) == ("not measured", "a limit in params.yaml")
    assert said(measured=0.0, threshold=0.0, comparison=">=") == ("0", ">= 0")
    assert said(measured=1.0, verdict="PENDING_REVIEW")[0] == "pending review"


@pytest.mark.parametrize("length", [59, 60, 61])
def test_sixty_signs_of_what_was_found_are_shown(length):
    class Numbers(StrictModel):
        n: int

    with pytest.raises(ValidationError) as caught:
        Numbers.model_validate({"n": "x" * length})
    said = f"'{'x' * min(length, 60)}' (Input should be a valid integer)"
    assert (place(caught.value), message(caught.value)) == ("n", said)
