"""A key that is gone or misspelt in what the gates read is bad input, or said, never a fault."""

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import evidence
import pytest
import yaml

from gates import engine, rederive
from gates.card.card import DRAFT_PATH, read_card
from gates.card.drafting import draft
from gates.card.envelope import ENVELOPE_FILE, simulated_envelope
from gates.card.history import evidence_digests
from gates.card.people import load_allow_list
from gates.cause.reading import folder_numbers
from gates.engine import judge_gate
from gates.evidence import Evidence
from gates.pipeline import TASK_IDENTITY, basis_of, changed_pages, changed_task, check_record
from gates.preregistration import moved_caveats
from gates.present import present_runs
from gates.proof import SPECS, admit
from gates.protection import require_protection
from gates.report import GATES, read_report, report_path, stage_of
from gates.settings import read_limits, read_settings
from genpolicy.integrity.documents import canonical_json

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def whole(tmp_path_factory, _ladder):
    root = tmp_path_factory.mktemp("bad") / "repo"
    shutil.copytree(_ladder, root)
    return root


@pytest.fixture
def edited(whole):
    """Reads a changed document in place of a file, which comes back afterwards."""
    kept = {}

    def reader(name, read):
        path = whole / name
        kept[path] = path.read_bytes() if path.is_file() else None

        def changed(document):
            # JSON writes 1e-05, which YAML reads as a text.
            as_yaml = path.suffix == ".yaml"
            written = yaml.dump(document, Dumper=yaml.CSafeDumper).encode() if as_yaml else None
            path.write_bytes(written or canonical_json(document))
            read()

        return changed

    yield reader
    for path, data in kept.items():
        path.write_bytes(data) if data is not None else path.unlink(missing_ok=True)


def test_parameters_of_every_gate(fallen_over, tmp_path):
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    (tmp_path / "preregistration.yaml").write_bytes((ROOT / "preregistration.yaml").read_bytes())

    def read(document):
        for gate, spec in SPECS.items():
            read_settings(document, stage_of(gate), spec.settings)
            require_protection(document, gate)
            read_limits(document, gate, spec.criteria)
        moved_caveats(tmp_path, document, "E")

    read(params)
    refused, faults = fallen_over(params, read)
    assert faults == {} and refused > 100


def test_parameters_that_journals_are_held_to(fallen_over, monkeypatch):
    for name in ("load_task", "cell_of", "expected_motion"):
        task = SimpleNamespace(action_at=None, scene_poses=None)
        monkeypatch.setattr(rederive, name, lambda *given, task=task, **named: task)
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    few = {name: params[name] for name in ("horizons", "execution", "feasibility", "task")}
    rederive._held_to(few)
    refused, faults = fallen_over(few, rederive._held_to)
    assert faults == {} and refused > 30


def test_preregistration(fallen_over, edited, whole):
    plan = yaml.safe_load((ROOT / "preregistration.yaml").read_text())
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    said = []
    read = edited("preregistration.yaml", lambda: said.append(moved_caveats(whole, params, "E")))
    read(plan)
    assert said == [()]
    _, faults = fallen_over(plan, read)
    assert faults == {} and all(said[1:])  # whatever is gone or misspelt is said


READERS = {
    "basis": lambda root: basis_of(root, "C"),
    "record": lambda root: check_record(root, "C", {}),
    "pages": lambda root: changed_pages(root, "C"),
    "present": present_runs,
    "digest": evidence_digests,
}


@pytest.mark.parametrize("name", ["dvc.lock", "dvc.yaml"])
@pytest.mark.parametrize("reader", READERS)
def test_lock_and_pipeline(fallen_over, edited, whole, name, reader):
    document = json.loads((whole / name).read_text())
    stages = document["stages"]
    few = {"stages": {stage: stages[stage] for stage in ("shadow", "stress") if stage in stages}}
    read = edited(name, lambda: READERS[reader](whole))
    read(few)
    assert fallen_over(few, read)[1] == {}


def test_reviewers(fallen_over, edited, whole):
    key = "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a"  # RFC 8032, test 1
    people = {"people": [{"id": "ada", "name": "Ada", "role": "author", "public_key": key,
                          "emails": ["ada@example.org"]}]}  # fmt: skip
    read = edited("reviewers.yaml", lambda: load_allow_list(whole))
    read(people)
    refused, faults = fallen_over(people, read)
    assert faults == {} and refused == 11  # all but the list of addresses, which may be empty


def test_card(fallen_over, whole):
    card = json.loads((whole / DRAFT_PATH).read_text())
    refused, faults = fallen_over(
        card, lambda document: read_card(canonical_json(document), where="card.json")
    )
    assert faults == {} and refused > 20


@pytest.mark.parametrize("gate", "BD")
def test_report(fallen_over, edited, whole, gate):
    report = json.loads((whole / report_path(gate)).read_text())
    report["materials"] = dict(list(report["materials"].items())[:1])
    read = edited(report_path(gate), lambda: read_report(whole, gate))
    refused, faults = fallen_over(report, read)
    assert faults == {} and refused > 20


@pytest.mark.parametrize("name", [TASK_IDENTITY, ENVELOPE_FILE, "artifacts/reload/identity.json"])
def test_what_the_card_is_drafted_from(fallen_over, edited, whole, name):
    admitted = admit("card", whole)

    def read():
        changed_task(whole)
        simulated_envelope(Evidence(whole))
        draft(whole, admitted.reports, admitted.hashes)

    document = json.loads((whole / name).read_text())
    reader = edited(name, read)
    reader(document)
    refused, faults = fallen_over(document, reader)
    assert faults == {} and refused > 0


@pytest.mark.parametrize("name", ["summary", "persistence"])
def test_documents_of_the_audit(fallen_over, edited, whole, name):
    path = f"artifacts/audit/{name}.json"
    reader = edited(path, lambda: folder_numbers(whole / "artifacts/audit"))
    document = json.loads((whole / path).read_text())
    reader(document)
    refused, faults = fallen_over(document, reader)
    assert faults == {} and refused > 0


class Answers:
    """Answers of a gate's criteria; of those that do not read what is changed, the known ones.

    The first change of each document asks all of them. Afterwards who did not read it, with and
    without that change, would do again what it did.
    """

    def __init__(self, answer):
        self.answer, self.known, self.readers = answer, {}, {}
        self.changed, self.all_asked = None, True

    def __call__(self, item, found, inputs, limit, candidate):
        key = (item.id, candidate)
        readers = self.readers.setdefault(self.changed, set())
        if not self.all_asked and key not in readers:
            return self.known[key]
        answer = self.answer(item, found, inputs, limit, candidate)
        if self.changed is None:
            self.known[key] = answer
        if self.changed in (*answer.evidence, *self.known[key].evidence):
            readers.add(key)
        return answer


@pytest.mark.parametrize("gate", GATES[:4])
def test_documents_of_the_evidence(whole, gate, monkeypatch):
    """Every key at the top of every document: the gate says what is missing, or does not need it.

    Only deleted, and judged without the record: one judgement for each key is slow enough.
    """
    answers = Answers(engine._answer)
    monkeypatch.setattr(engine, "_answer", answers)
    judge_gate(SPECS[gate], whole)
    folder = {"A": "audit measure_baselines", "B": "train_generators reload", "C": "shadow",
              "D": "stress"}[gate]  # fmt: skip
    files = [
        path
        for name in folder.split()
        for path in sorted((whole / "artifacts" / name).glob("*.json"))
    ]
    assert files
    lost = []
    for path in files:
        data = path.read_bytes()
        document = json.loads(data)
        keys = list(document) if isinstance(document, dict) else range(len(document))
        answers.changed = path.relative_to(whole).as_posix()
        for place, key in enumerate(keys):
            answers.all_asked = place == 0
            less = json.loads(data)
            del less[key]
            path.write_bytes(canonical_json(less))
            evidence.record(whole)
            try:
                judge_gate(SPECS[gate], whole)
            except Exception as error:
                if getattr(error, "exit_code", 1) not in (2, 3):
                    lost.append((path.name, key, repr(error)))
        path.write_bytes(data)
    evidence.record(whole)
    assert lost == []
