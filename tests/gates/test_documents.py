"""Every JSON document that a gate reads: another key or type in it is refused by name.

Taken from the modules of the gates, so that a document is tried as soon as one of them names it.
"""

import importlib
import json
import pkgutil
import shutil
from dataclasses import fields, is_dataclass

import evidence
import pytest

import gates
from gates.evidence import Evidence, MissingEvidenceError
from gates.proof import judge
from genpolicy.documents.document import Document
from genpolicy.errors import BadInputError
from genpolicy.evidence.documents.failures import FAILURE
from genpolicy.evidence.documents.stress import BLOCKS, TRAININGS, Blocks, Trainings
from genpolicy.integrity.documents import canonical_json


def documents():
    """By file and class: every document that some module of the gates names."""
    found = {}
    for module in pkgutil.walk_packages(gates.__path__, "gates."):
        if module.name != "gates.__main__":
            for value in vars(importlib.import_module(module.name)).values():
                if isinstance(value, Document):
                    found[f"{value.file}-{id(value)}"] = value
    return sorted(found.values(), key=lambda of: (of.file, str(of.kind)))


DOCUMENTS = documents()


@pytest.fixture(scope="module")
def root(tmp_path_factory, _ladder):
    copied = shutil.copytree(_ladder, tmp_path_factory.mktemp("documents") / "repo")
    # Nobody is brought to that ladder, and of nobody no key can be left out.
    somebody = {
        "author": "a@example.org", "sha256": "a" * 64, "files": {"weights": "b" * 64},
        "kind": "server", "stochastic": True, "program": {}, "started_here": True,
        "dataset": "c" * 64, "training_seed": 1,
    }  # fmt: skip
    path = copied / "artifacts/candidates/candidates.json"
    path.write_bytes(canonical_json({"flow": somebody}))
    found = {
        "episodes": 35, "moments": 175, "candidates": 4, "observations_sha256": "d" * 64,
        "seeded": True, "counts_evaluations": True, "most_candidates": 4,
        "findings": [{"name": "answers", "judged": "holds", "gate": "B", "said": "35 of 35"}],
    }  # fmt: skip
    (copied / "artifacts/reload/conformance.json").write_bytes(canonical_json({"flow": found}))
    failed = {"asked": 64, "faults": {"late": 1}, "last_words": "no answer within 2 s"}
    (copied / "artifacts/reload/faults.json").write_bytes(canonical_json({"flow": failed}))
    # One seed trained everybody there, and of further ones no list is written.
    TRAININGS.write(copied / "artifacts/stress", Trainings(seeds=[1]))
    # All starts are one block there, and of blocks nothing is said.
    said = Blocks(block=20, starts=80, last={"flow": 2}, out={"flow": "promotion_e_value"})
    BLOCKS.write(copied / "artifacts/stress", said)
    # Nobody searched on that ladder; a file of each failure is named by what it is about.
    failure = copied / "artifacts/failure_search" / FAILURE.file
    failure.parent.mkdir(parents=True)
    failure.write_bytes(canonical_json({
        "task": "t", "method": "flow", "checkpoint": "a" * 64, "training_seed": 0, "root_seed": 1,
        "condition": "nominal", "perturbation": "nominal@search", "severity": 0.5, "number": 3,
        "point": [0.5], "start": "{}", "start_sha256": "b" * 64, "outcome": "timeout",
        "events_sha256": "c" * 64,
    }))  # fmt: skip
    return copied


def folders(root, of):
    """Folders of the evidence that hold a file of this name and form."""
    found = []
    for path in sorted((root / "artifacts").rglob(of.file)):
        folder = path.parents[of.file.count("/")]
        try:
            of.read(folder)
        except BadInputError:
            continue
        found.append(folder.relative_to(root).as_posix())
    return found


def objects(content, at=()):
    """Place and keys of every object of fixed keys; of a list or mapping one of each class."""
    if is_dataclass(content):
        names = [field.name for field in fields(content)]
        yield at, names
        for name in names:
            yield from objects(getattr(content, name), (*at, name))
    elif isinstance(content, dict | list | tuple):
        items = content.items() if isinstance(content, dict) else enumerate(content)
        for key, value in {type(value): (key, value) for key, value in items}.values():
            yield from objects(value, (*at, key))


def changes(content):
    """What is changed, where, the name that must be said, and the change of the object there."""
    for at, names in objects(content):
        yield "extra", at, "odd", lambda inner: inner.update(odd=1)
        for name in names:
            yield "missing", at, name, lambda inner, name=name: inner.pop(name)
            yield (
                "misspelt",
                at,
                f"{name}x",
                lambda inner, name=name: inner.update({f"{name}x": inner.pop(name)}),
            )
            yield "another type", at, name, lambda inner, name=name: inner.update({name: [[True]]})


def test_the_documents_are_those_that_gates_judge_by():
    assert {of.file for of in DOCUMENTS} >= {
        "checker.json", "envelope.json", "identity.json", "latent.json", "matched.json",
        "mutants.json", "persistence.json", "power.json", "refusals.json", "summary.json",
        "variants.json",
    }  # fmt: skip


@pytest.mark.parametrize("of", DOCUMENTS, ids=[of.file for of in DOCUMENTS])
def test_another_key_or_type_is_refused_by_name(root, of):
    found = folders(root, of)
    assert found, f"the evidence of the tests holds no {of.file}"
    path = root / found[0] / of.file
    kept = path.read_bytes()
    tried = 0
    try:
        for what, at, name, change in changes(of.read(root / found[0])):
            document = json.loads(kept)
            inner = document
            for part in at:
                inner = inner[part]
            change(inner)
            path.write_bytes(canonical_json(document))
            with pytest.raises(MissingEvidenceError) as caught:
                Evidence(root).document(found[0], of)
            said = str(caught.value)
            assert said.startswith(f"{found[0]}/{of.file} is a document with"), (what, at, said)
            assert name in said and ", expected " in said and "dvc repro" in said, (what, at, said)
            tried += 1
    finally:
        path.write_bytes(kept)
    assert tried > 3


@pytest.mark.parametrize("of", DOCUMENTS, ids=[of.file for of in DOCUMENTS])
def test_what_is_read_is_what_would_be_written(root, tmp_path, of):
    for folder in folders(root, of):
        of.write(tmp_path, of.read(root / folder))
        assert (tmp_path / of.file).read_bytes() == (root / folder / of.file).read_bytes()


@pytest.mark.parametrize(
    ("gate", "path", "criterion"),
    [("A", "train_factors/variants.json", "factors_isolated"),
     ("B", "reload/identity.json", "unpinned_items"),
     ("C", "shadow/mutants.json", "mutants_undetected"),
     ("D", "stress/power.json", "verdict_reachable")],
)  # fmt: skip
def test_a_gate_says_so_and_decides_nothing(ladder, gate, path, criterion):
    def odd(document):
        first = document[0] if isinstance(document, list) else document
        (next(iter(first.values())) if path.startswith("reload") else first)["odd"] = 1

    evidence.edit_document(ladder, path, odd)
    answers = [c for c in judge(ladder, gate).criteria if c.id == criterion]
    assert {answer.verdict for answer in answers} == {"INCONCLUSIVE"}
    assert all("unknown key" in answer.caveat and "odd" in answer.caveat for answer in answers)
