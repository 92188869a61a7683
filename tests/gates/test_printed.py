"""What is printed of the gates, and which exit code says it."""

import itertools
import json

import pytest
from test_differences import REPORT

from gates import printed
from gates.printed import (
    NOT_BUILT,
    coloured,
    not_built,
    page_problem,
    pages_code,
    print_cases,
    print_rungs,
    worst,
)
from gates.proof import Rung
from gates.writing import INDEX
from genpolicy.errors import BadInputError, IntegrityError

BAD = {"where": "x", "found": "1", "expected": "2", "action": "Stop."}
RUNGS = [
    Rung("A", "need", "PASS", "", "every byte", "reports/gate_a.json", 0),
    Rung("B", "reproducibility", "FAIL", "nfe: 5", "not shown", "reports/gate_b.json", 3),
    Rung("E", "card", "NOT JUDGED", "", "", "reports/gate_e.json", 3),
]


def test_what_cannot_be_read_comes_before_what_is_refused_and_that_before_what_is_done():
    """Every set of the codes: 1, a fault of ours, hides neither of them."""
    for size in range(5):
        for codes in itertools.combinations((0, 1, 2, 3), size):
            order = [code for code in (2, 3, 1, 0) if code in codes]
            assert worst(set(codes)) == (order or [0])[0], codes


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (None, None),
        ("", None),
        ("reports/gate_b.md", ("reports/gate_b.md", 3, "reports/gate_b.md is another page")),
        (BadInputError(**BAD), (INDEX, 2, "x is 1, expected 2")),
        (IntegrityError(**BAD), (INDEX, IntegrityError.exit_code, "x is 1, expected 2")),
    ],
)
def test_a_page_that_is_another_or_cannot_be_made(tmp_path, monkeypatch, capsys, found, said):
    def changed(root):
        assert root == tmp_path
        if isinstance(found, Exception):
            raise found
        return found

    monkeypatch.setattr(printed, "changed_page", changed)
    problem = page_problem(tmp_path)
    if said is None:
        assert problem is None and pages_code(tmp_path) == set()
        assert capsys.readouterr() == ("", "")
        return
    file, code, text = said
    assert (problem[0], problem[2], problem[3]) == ("page", file, code)
    assert problem[1].startswith(text)
    assert pages_code(tmp_path) == {code}
    assert capsys.readouterr() == ("", f"{problem[1]}\n"), "for a person, beside what is printed"


def test_a_line_for_each_gate(capsys):
    print_rungs(RUNGS, as_json=False)
    assert capsys.readouterr().out.splitlines() == [
        "A  need             PASS            every byte",
        "B  reproducibility  FAIL            nfe: 5",
        "E  card             NOT JUDGED",
    ]


def test_on_a_terminal_each_verdict_has_its_colour_and_the_columns_stay(monkeypatch, capsys):
    monkeypatch.setattr(printed, "coloured", lambda: True)
    waits = Rung("E", "card", "PENDING_REVIEW", "sign", "", "reports/gate_e.json", 3)
    print_rungs([*RUNGS, waits], as_json=False)
    assert capsys.readouterr().out.splitlines() == [
        "A  need             \x1b[32mPASS          \x1b[0m  every byte",
        "B  reproducibility  \x1b[31mFAIL          \x1b[0m  nfe: 5",
        "E  card             NOT JUDGED",
        "E  card             \x1b[33mPENDING_REVIEW\x1b[0m  sign",
    ]


@pytest.mark.parametrize("verdict", ["PASS", "FAIL"])
def test_what_is_overridden_is_said_in_red_where_there_is_colour(monkeypatch, capsys, verdict):
    told = "OVERRIDDEN: nfe_mismatch of flow by rita; without, gate B FAIL."
    decided = "" if verdict == "PASS" else "nfe: 5"
    rung = Rung("B", "b", verdict, decided, f"Go on. {told}", "reports/gate_b.json", 0)
    print_rungs([rung], as_json=False)
    said = decided or "Go on."
    assert capsys.readouterr().out.endswith(f"  {said} {told}\n")
    monkeypatch.setattr(printed, "coloured", lambda: True)
    print_rungs([rung], as_json=False)
    assert capsys.readouterr().out.endswith(f"  {said} \x1b[31m{told}\x1b[0m\n")


@pytest.mark.parametrize(
    ("page", "command"),
    [
        ("reports/gate_c.html", "dvc repro -f gate_c"),
        ("reports/gate_e/signatures.csv", "dvc repro -f gate_e"),
        (INDEX, "python -m gates.writing"),
    ],
)
def test_a_page_is_printed_again_by_its_own_stage(tmp_path, monkeypatch, page, command):
    monkeypatch.setattr(printed, "changed_page", lambda root: page)
    assert f"Run `{command}`, which prints it again" in page_problem(tmp_path)[1]


def test_the_same_as_json_whole_and_in_their_own_letters(capsys):
    print_rungs([*RUNGS, Rung("D", "stress", "FAIL", "é ≤ 1", "", "r", 3)], as_json=True)
    out = capsys.readouterr().out
    assert "é ≤ 1" in out and out.startswith('[\n  {\n    "gate": "A",\n')
    rows = json.loads(out)
    assert [row["gate"] for row in rows] == list("ABED")
    assert rows[1] == {
        "gate": "B", "name": "reproducibility", "verdict": "FAIL", "decided_by": "nfe: 5",
        "note": "not shown", "report": "reports/gate_b.json", "exit_code": 3,
    }  # fmt: skip


@pytest.mark.parametrize("layout", ["junit", "github"])
def test_only_a_report_that_was_proved_is_read_for_its_criteria(
    tmp_path, monkeypatch, capsys, layout
):
    """What was refused, or is not there, must not speak for itself."""
    read = []

    def read_report(root, gate):
        read.append((root, gate))
        return REPORT, "0" * 64

    monkeypatch.setattr(printed, "read_report", read_report)
    rungs = [*RUNGS, Rung("C", "f", "REFUSED", "", "a byte", "reports/gate_c.json", 3)]
    print_cases(tmp_path, rungs, [("page", "another", "p.html", 3)], layout)
    assert read == [(tmp_path, "A"), (tmp_path, "B")]
    out = capsys.readouterr().out
    assert out.startswith("<" if layout == "junit" else "::error")
    assert "another" in out and "p.html" in out and "a byte" in out


def _all(*verdicts):
    return [
        Rung(gate, "n", verdict, "", "", "r", 3)
        for gate, verdict in zip("ABCDE", verdicts, strict=False)
    ]


def test_where_nothing_is_built_one_sentence_says_what_to_do(tmp_path):
    none, clone = _all(*["NOT JUDGED"] * 5), _all("REFUSED", *["NOT JUDGED"] * 4)
    assert not_built(tmp_path, none) == NOT_BUILT == "not built: make ladder"
    assert not_built(tmp_path, clone).startswith(f"{NOT_BUILT} (reports lie here without")
    (tmp_path / "artifacts").mkdir()
    assert not_built(tmp_path, none) == NOT_BUILT
    (tmp_path / "artifacts/record").mkdir()
    assert not_built(tmp_path, none) == not_built(tmp_path, clone) == ""


@pytest.mark.parametrize("verdict", ["PASS", "FAIL", "PENDING_REVIEW", "INCONCLUSIVE"])
def test_what_was_judged_is_built(tmp_path, verdict):
    assert not_built(tmp_path, _all("REFUSED", verdict, "NOT JUDGED")) == ""


@pytest.mark.parametrize(("terminal", "wish", "seen"), [
    (True, None, True), (True, "", True), (True, "1", False), (False, None, False),
    (False, "1", False),
])  # fmt: skip
def test_colour_is_for_a_terminal_whose_user_wants_it(monkeypatch, terminal, wish, seen):
    monkeypatch.setattr("sys.stdout.isatty", lambda: terminal, raising=False)
    monkeypatch.delenv("NO_COLOR", raising=False)
    if wish is not None:
        monkeypatch.setenv("NO_COLOR", wish)
    assert coloured() is seen
