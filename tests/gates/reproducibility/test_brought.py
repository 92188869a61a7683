"""A policy that was brought: what it cannot show fails by name, and an exception says who answers.

The synthetic `flow` stands for one: its rows are there, and nothing of its training.
"""

import evidence
import pytest
from asked import found_in

from gates.card.card import caveats_of
from gates.doubts import of_a_ladder
from gates.proof import judge
from gates.reproducibility.settings import MATCHING
from gates.settings import WAIVED
from genpolicy.candidates.conformance.finding import OF_ANSWERS
from genpolicy.errors import ConfigError
from genpolicy.evidence.split import split_sha256
from genpolicy.integrity.hashing import sha256_file

FINDINGS = [
    {"name": name, "judged": "holds", "gate": "B", "said": "as it should"} for name in OF_ANSWERS
]
ANSWERED = {
    "episodes": 40, "moments": 40, "candidates": 4, "observations_sha256": "f" * 64, "seeded": True,
    "counts_evaluations": True, "most_candidates": 4, "findings": FINDINGS,
}  # fmt: skip
EXCEPTION = {"owner": "model", "reason": "trained by its maker", "expires": "2027-01-31"}
ENTRY = "own/flow.yaml"


def bring(root, *, unmatched, change=None, document=None, findings=None, told=None):
    """Let `flow` be brought: no training of it is left, and its entry is in the evidence."""

    def params(found):
        del found["train_generators"]["samplers"]["flow"]
        found["candidates"] = {"flow": ENTRY}
        found["gate_b"]["unmatched"] = {"flow": unmatched} if unmatched else {}

    evidence.write_params(root, params)

    def untrained(found):
        for name in ("methods", "differing_keys"):
            found[name].pop("flow")

    evidence.edit_document(root, "train_generators/matched.json", untrained)
    split(root)
    identity = {}
    evidence.edit_document(
        root, "reload/identity.json", lambda found: identity.update(found["flow"])
    )
    pinned = {
        "author": "author@example.org", "sha256": identity["checkpoint"],
        "files": {"weights.bin": "a" * 64}, "program": {},
        "kind": "torch", "stochastic": True, "started_here": True,
        "dataset": identity["dataset"],
        "training_seed": identity["seed"][0],
    }  # fmt: skip
    evidence.document(root, "candidates/candidates.json", {"flow": {**pinned, **(document or {})}})
    said = {**ANSWERED, "findings": FINDINGS if findings is None else findings, **(told or {})}
    evidence.document(root, "reload/conformance.json", {"flow": said})
    evidence.edit_document(
        root, "reload/identity.json",
        lambda found: found["flow"].update({"seed": identity["seed"][:1], **(change or {})}),
    )  # fmt: skip
    evidence.record(root)


def split(root):
    """Let the dataset have a split: its hash is another one then, wherever it is named."""
    place = root / "artifacts"
    before = sha256_file(place / "ingest/manifest.json")
    evidence.edit_document(root, "ingest/manifest.json", lambda found: found.update(evidence.SPLIT))
    now = sha256_file(place / "ingest/manifest.json")
    for path in (place / "reload/identity.json", place / "train_generators/matched.json"):
        path.write_text(path.read_text().replace(before, now))
    evidence.edit_document(
        root, "reload/identity.json",
        lambda found: found["flow"]["card"].update(split=split_sha256(evidence.SPLIT)),
    )  # fmt: skip


def of_flow(report, name):
    (answer,) = [item for item in found_in(report, name) if item.candidate == "flow"]
    return answer


def test_by_exception_it_passes_and_the_report_says_who_answers(ladder):
    bring(ladder, unmatched=EXCEPTION)
    report = judge(ladder, "B")
    assert report.candidates == {"diffusion": "PASS", "flow": "PASS"}
    asked = {item.id for item in report.criteria if item.candidate == "flow"}
    assert not asked & set(MATCHING)
    of_ours = {item.id for item in report.criteria if item.candidate == "diffusion"}
    assert set(MATCHING) <= of_ours
    (said,) = [text for text in report.caveats if "unmatched evidence" in text]
    assert "model owner answers for it until 2027-01-31: trained by its maker" in said
    assert WAIVED.match(said)  # so it stands at the top of the page


def test_unmatched_evidence_stands_first_on_the_desk_and_on_the_card(ladder):
    promoting = judge(ladder, "D")
    bring(ladder, unmatched=EXCEPTION)
    report = judge(ladder, "B")
    (said,) = [text for text in report.caveats if "unmatched evidence" in text]
    weighed, behind = of_a_ladder([report])
    assert [doubt.text for doubt in weighed if doubt.kind == "not asked"] == [said]
    assert said not in [doubt.text for doubt in behind]
    assert said in caveats_of({"B": report, "D": promoting})


def test_a_process_that_failed_fails_by_its_last_words(ladder):
    failed = {"asked": 64, "faults": {"closed": 16, "gone": 48}, "last_words": "no weights here"}
    evidence.document(ladder, "reload/faults.json", {"flow": failed})
    bring(ladder, unmatched=EXCEPTION, change={"nonfinite_weights": 64})
    report = judge(ladder, "B")
    assert report.candidates == {"diffusion": "PASS", "flow": "FAIL"}
    answer = of_flow(report, "nonfinite_weights")
    assert answer.verdict == "FAIL"
    assert answer.caveat.endswith(
        "; of 64 invocations failed: closed 16, gone 48; the last because no weights here"
    )
    assert "artifacts/reload/faults.json" in report.materials


def test_without_an_exception_it_fails_by_name_and_the_others_stand(ladder):
    bring(ladder, unmatched=None)
    report = judge(ladder, "B")
    assert report.candidates == {"diffusion": "PASS", "flow": "FAIL"}
    answer = of_flow(report, "unmatched_keys")
    assert answer.verdict == "FAIL" and "gate_b.unmatched.flow" in answer.caveat


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({"files": {}}, "checkpoint file"),
        ({"sha256": "b" * 64}, "another entry was asked"),
        ({"training_seed": None}, "seed"),
        ({"training_seed": 99}, "seed"),
    ],
)
def test_what_nobody_pins_fails_by_name(ladder, document, said):
    bring(ladder, unmatched=EXCEPTION, document=document)
    answer = of_flow(judge(ladder, "B"), "unpinned_items")
    assert (answer.verdict, answer.measured) == ("FAIL", 1.0) and said in answer.caveat


def test_what_its_maker_does_not_declare_is_missing_from_the_card(ladder):
    def undeclared(found):
        found["flow"]["card"].update({"architecture": "", "threads": 0})

    bring(ladder, unmatched=EXCEPTION)
    evidence.edit_document(ladder, "reload/identity.json", undeclared)
    evidence.record(ladder)
    answer = of_flow(judge(ladder, "B"), "unpinned_items")
    assert answer.verdict == "FAIL" and "architecture, threads" in answer.caveat


@pytest.mark.parametrize("unmatched", [EXCEPTION, None])
def test_another_split_of_our_data_is_refused_with_and_without_an_exception(ladder, unmatched):
    def another(found):
        found["flow"]["card"]["split"] = "c" * 64

    bring(ladder, unmatched=unmatched)
    assert of_flow(judge(ladder, "B"), "unpinned_items").verdict == "PASS"
    evidence.edit_document(ladder, "reload/identity.json", another)
    evidence.record(ladder)
    answer = of_flow(judge(ladder, "B"), "unpinned_items")
    assert (answer.verdict, answer.measured) == ("FAIL", 1.0)
    assert answer.caveat.startswith("split: not that of the audited dataset")


def test_other_data_are_told_by_exception_and_unpinned_without(ladder):
    bring(ladder, unmatched=EXCEPTION, change={"dataset": "c" * 64})
    answer = of_flow(judge(ladder, "B"), "unpinned_items")
    assert (
        answer.verdict == "PASS" and "another one than the audited, by exception" in answer.caveat
    )
    bring_again = {"candidates": {"flow": ENTRY}}

    def without(found):
        del found["train_generators"]["samplers"]["flow"]
        found.update(bring_again)

    evidence.write_params(ladder, without)
    evidence.record(ladder)
    assert of_flow(judge(ladder, "B"), "unpinned_items").verdict == "FAIL"


def test_an_answer_that_is_none_counts_where_nobody_sees_weights(ladder):
    bring(ladder, unmatched=EXCEPTION, change={"nonfinite_weights": 1})
    answer = of_flow(judge(ladder, "B"), "nonfinite_weights")
    assert answer.verdict == "FAIL" and "behind the wire" in answer.caveat


@pytest.mark.parametrize(
    ("exception", "told"),
    [
        ({**EXCEPTION, "expires": "2027-02-30"}, "expires"),
        ({**EXCEPTION, "expires": "soon"}, "expires"),
        ({**EXCEPTION, "owner": "nobody"}, "owner"),
        ({**EXCEPTION, "reason": ""}, "reason"),
        ({**EXCEPTION, "reason": "  "}, "reason"),
    ],
)
def test_an_exception_names_owner_reason_and_day(ladder, exception, told):
    bring(ladder, unmatched=exception)
    with pytest.raises(ConfigError, match=told):
        judge(ladder, "B")


def test_who_is_trained_here_is_matched_or_fails(ladder):
    evidence.write_params(
        ladder, lambda found: found["gate_b"].update(unmatched={"diffusion": EXCEPTION})
    )
    with pytest.raises(ConfigError, match="diffusion is excepted and not among"):
        judge(ladder, "B")
