"""What no page says: when the run was, which commit holds it, what moved since a review."""

import base64
import json
import os
import subprocess

import pytest

from gates.proof import Rung
from gates.report import report_path
from gates.run_commands import report
from gates.status import NEVER, status_of, status_text
from genpolicy.cli.shell import run_program
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json

RUNGS = [
    Rung(gate, "n", verdict, "", note, "r", 0)
    for gate, verdict, note in (
        ("A", "PASS", ""), ("B", "FAIL", ""), ("C", "REFUSED", "x is missing"),
        ("D", "NOT JUDGED", ""),
    )
]  # fmt: skip


@pytest.fixture
def commit(ladder):
    def git(*args):
        done = subprocess.run(
            ["git", "-C", str(ladder), *args], check=True, capture_output=True, text=True
        )
        return done.stdout.strip()

    def commit():
        git("add", "-A", "--", "reports", "params.yaml", ".")
        named = ("-c", "user.name=Ada", "-c", "user.email=ada@example.org")
        git(*named, "commit", "-q", "-m", "x")
        return git("rev-parse", "HEAD")

    git("init", "-q")
    return commit


def envelope(root, **changes):
    """A card as an envelope holds it; whether its signatures are true is not asked here."""
    draft = json.loads((root / "artifacts/card/card.json").read_text())
    payload = canonical_json({"predicate": {**draft, **changes}})
    text = canonical_json({"payload": base64.b64encode(payload).decode()})
    write_bytes(root / "cards/trial.dsse.json", text)


def test_what_is_proved_and_what_is_not(ladder):
    said = status_of(ladder, RUNGS)
    assert said.proved == {
        "A": "now, PASS: every byte is as the report says",
        "B": "now, FAIL: every byte is as the report says",
        "C": "not proved: x is missing",
        "D": "not judged",
    }
    assert (said.task, said.candidate, said.authors) == ("tabletop_insertion", "flow", "ada")


def test_people_and_candidates_that_nobody_named_are_said_to_lack(ladder):
    (ladder / "params.yaml").write_text("task: {}")
    (ladder / report_path("D")).unlink()
    text = status_text(status_of(ladder, RUNGS))
    assert "authors    nobody is named in params.yaml: card.authors" in text
    assert "candidate  none promoted" in text and "task       not named" in text


def test_without_times_and_without_git_nothing_is_invented(ladder):
    said = status_of(ladder, RUNGS)
    assert said.ran == "not in this checkout: no stage left its time here"
    assert said.committed == "the reports are in no commit"
    assert said.reviewed.said == NEVER and not said.reviewed.moved


def test_when_its_stages_ended(ladder):
    for stage, seconds, ended_s in (("record", 4000.0, 1.0e9), ("gate_a", 25.0, 1.2e9)):
        path = ladder / f"build/times/{stage}.json"
        write_bytes(path, canonical_json({"exit_code": 0, "seconds": seconds, "peak_mib": 1}))
        os.utime(path, (ended_s, ended_s))
    (ladder / "dvc.lock").unlink()
    assert status_of(ladder, RUNGS).ran == "ended 2008-01-10 21:20 UTC; 2 stages, 67 min in all"


def test_the_commit_of_the_reports_and_that_they_moved_since(ladder, commit):
    known = commit()
    assert status_of(ladder, RUNGS).committed.startswith(known[:7])
    assert status_of(ladder, RUNGS).committed.endswith(", Ada")
    path = ladder / report_path("A")
    write_bytes(path, path.read_bytes() + b"\n")
    assert status_of(ladder, RUNGS).committed.endswith("Ada; changed since, not committed")


def test_what_moved_since_the_reviewed_run(ladder, commit):
    envelope(ladder)
    reviewed = commit()
    same = status_of(ladder, RUNGS).reviewed
    assert same.commit == reviewed and all(gate.same for gate in same.moved)
    assert [gate.gate for gate in same.moved] == list("ABCD")
    assert same.said.startswith(f"by the card of commit {reviewed[:7]} (its signatures:")
    path = ladder / report_path("B")
    document = json.loads(path.read_text())
    document.update(verdict="FAIL")
    write_bytes(path, canonical_json(document))
    commit()
    found = status_of(ladder, RUNGS)
    assert found.reviewed.commit == reviewed
    assert [gate.gate for gate in found.reviewed.moved if not gate.same] == ["B"]
    assert "B  reproducibility: PASS -> FAIL" in status_text(found)


def test_a_card_of_other_reports_is_no_review_of_these(ladder, commit):
    envelope(ladder, reports={gate: "0" * 64 for gate in "ABCD"})
    commit()
    found = status_of(ladder, RUNGS).reviewed
    assert "names other reports than that commit holds" in found.said and not found.moved


def _enveloped(payload):
    return canonical_json({"payload": base64.b64encode(canonical_json(payload)).decode()})


@pytest.mark.parametrize(
    "card",
    [
        b"[]", b"{", b"{}", b'{"payload": 1}', b'{"payload": "x"}', _enveloped([]), _enveloped({}),
        _enveloped({"predicate": {}}), _enveloped({"predicate": {"reports": []}}),
        _enveloped({"predicate": None}),
    ],
    ids=bytes.decode,
)  # fmt: skip
def test_a_card_that_is_none_cannot_be_compared(ladder, commit, card):
    write_bytes(ladder / "cards/trial.dsse.json", card)
    commit()
    found = status_of(ladder, RUNGS).reviewed
    assert "cannot be compared" in found.said and not found.moved


def test_the_command_proves_and_prints(ladder, capsys):
    assert run_program(report, "report", ["status", "--root", str(ladder)]) == 0
    out = capsys.readouterr().out
    assert "authors    ada" in out and "proved D   now, PASS" in out
    assert run_program(report, "report", ["status", "--json", "--root", str(ladder)]) == 0
    assert json.loads(capsys.readouterr().out)["candidate"] == "flow"
