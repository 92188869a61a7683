"""What pins a candidate and what a fresh process must give back."""

import evidence
import pandas as pd
import pytest
from asked import asked, found_in, red
from editing import cells

from gates import words
from gates.evidence import Evidence, MissingEvidenceError
from gates.proof import judge
from gates.reproducibility.files import WEIGHTS, folders_of
from gates.reproducibility.gate import (
    nfe_mismatch,
    nonfinite_weights,
    parameter_budget_deviation,
    samples_difference,
    unpinned_items,
)
from gates.reproducibility.weights import weights_at
from genpolicy.policies.settings import SamplerConfig

MODES = "reload/modes.parquet"
EARLIER = "reload/modes_earlier.parquet"


def test_a_candidate_of_another_dataset_is_not_pinned(ladder):
    evidence.document(ladder, "ingest/manifest.json", {"schema_version": 2})
    report = judge(ladder, "B")
    assert report.verdict == "FAIL"
    assert "another one than the audited" in found_in(report, "unpinned_items")[0].caveat


def test_a_solver_that_agrees_with_itself_but_not_with_its_definition_is_red(ladder):
    """One evaluation too often, at training and after reload: recorded and counted agree."""
    evidence.edit_table(ladder, "reload/nfe.parquet", lambda f: f.assign(recorded=9, counted=9))
    evidence.edit_table(ladder, MODES, cells("nfe", 9))
    report = judge(ladder, "B")
    assert red(report) == {"nfe_mismatch"}
    found = found_in(report, "nfe_mismatch")[0]
    assert found.measured == 1 and "8 by the definition" in found.caveat


@pytest.mark.parametrize(
    ("counted", "nearest", "fails"),
    [(22, 22, False), (23, 22, True), (4, 4, False), (61, 61, False), (64, 61, True)],
)
def test_an_adaptive_solver_is_held_against_the_counts_that_it_may_take(
    ladder, counted, nearest, fails
):
    """1 + 3 n up to a cap of 63; its count differs with the observation, and no other is right."""
    evidence.edit_table(
        ladder, "reload/nfe.parquet",
        lambda f: f.assign(recorded=counted, counted=counted, expected=nearest, least=4, most=61),
    )  # fmt: skip
    chosen = {"name": "bosh3", "steps": 1, "nfe_cap": 63}

    def adaptive(document):
        for name in evidence.CANDIDATES:
            document["methods"][name]["config"]["sampler"].update(chosen)
            document["differing_keys"][name] += [f"sampler.{key}" for key in chosen]

    allowed = [[f"sampler.{key}", "test"] for key in chosen]
    evidence.write_params(ladder, lambda p: p["comparison"]["may_differ"].extend(allowed))
    evidence.edit_document(ladder, "train_generators/matched.json", adaptive)
    said = {
        "evaluations": "4 to 61", "sampler": "bosh3", "sampler_steps": 1,
        "tolerance": SamplerConfig(name="bosh3").tolerance,
    }  # fmt: skip
    evidence.edit_document(
        ladder, "reload/identity.json",
        lambda d: [one["card"].update(said) for one in d.values()] and None,
    )  # fmt: skip
    for table in (MODES, EARLIER):
        evidence.edit_table(ladder, table, lambda f: f.assign(nfe=4 + 3 * (f["index"] % 20)))
    report = judge(ladder, "B")
    assert red(report) == ({"nfe_mismatch"} if fails else set())
    assert "4 to 61 by the definition" in found_in(report, "nfe_mismatch")[0].caveat
    evidence.edit_table(ladder, "reload/nfe.parquet", cells("recorded", counted + 3))
    assert "nfe_mismatch" in red(judge(ladder, "B"))


@pytest.mark.parametrize("change", [{"least": 9}, {"most": 7}])
def test_an_expected_count_outside_its_definition_is_no_evidence(ladder, change):
    evidence.edit_table(ladder, "reload/nfe.parquet", lambda f: f.assign(**change))
    found = found_in(judge(ladder, "B"), "nfe_mismatch")[0]
    assert found.verdict != "PASS" and "does not allow" in found.caveat


@pytest.mark.parametrize("factor", [0.9, 1.0, 1.1])
def test_the_budget_is_missed_by_a_share_either_way(ladder, factor):
    def scaled(document):
        parts = document["methods"]["flow"]["parameters"]
        parts.update({name: round(factor * number) for name, number in parts.items()})

    evidence.edit_document(ladder, "train_generators/matched.json", scaled)
    found = asked(ladder, parameter_budget_deviation, "flow", gate="B")
    assert found.value == pytest.approx(abs(factor - 1.0))


def test_the_budget_says_what_a_distilled_candidate_s_training_took(ladder):
    """By hand: four evaluations of a window and two ways back, against one of each: 8 over 3."""
    plain = asked(ladder, parameter_budget_deviation, "flow", gate="B").caveat

    def taught(document):
        config = document["methods"]["flow"]["config"]
        windows = config["training"]["updates"] * config["training"]["batch_size"]
        config["distilled"] = {
            "teacher": "diffusion", "teacher_sha256": "c" * 64, "updates": 8000,
            "evaluations": 4 * windows, "gradients": 2 * windows,
        }  # fmt: skip

    evidence.edit_document(ladder, "train_generators/matched.json", taught)
    said = asked(ladder, parameter_budget_deviation, "flow", gate="B").caveat
    assert said.startswith(plain) and "distilled" not in plain
    assert "distilled from diffusion cccc" in said
    assert "8000 updates and about 2.67 times" in said


@pytest.mark.parametrize(
    "item", ["checkpoint", "config", "dataset", "normalisation", "seed", "sampler"]
)
def test_each_item_that_is_not_pinned_is_named(ladder, item):
    def unpin(document):
        document["flow"][item] = type(document["flow"][item])()

    evidence.edit_document(ladder, "reload/identity.json", unpin)
    found = asked(ladder, unpinned_items, "flow", gate="B")
    assert found.value >= 1 and item in found.caveat


def test_hashes_that_differ_without_a_difference_are_no_measurement(ladder):
    evidence.edit_table(ladder, "reload/samples.parquet", cells("sha256_reloaded", "0" * 64))
    with pytest.raises(MissingEvidenceError, match="hashes differ although no sample is said to"):
        asked(ladder, samples_difference, "flow", gate="B")


def test_all_that_is_not_pinned_is_counted(ladder):
    def unpin(document):
        for item in ("checkpoint", "normalisation", "sampler"):
            document["flow"][item] = type(document["flow"][item])()

    evidence.edit_document(ladder, "reload/identity.json", unpin)
    assert asked(ladder, unpinned_items, "flow", gate="B").value == 3
    for file in (ladder / "artifacts/train_generators/flow").rglob("model.safetensors"):
        file.unlink()
    found = asked(ladder, unpinned_items, "flow", gate="B")
    assert found.value == 4 and "checkpoint file" in found.caveat


@pytest.mark.parametrize(
    ("change", "why"),
    [(lambda f: f.assign(sha256_trained="", sha256_reloaded=""), "without a hash"),
     (lambda f: f.assign(row=f["row"] // 2), "a fixture of flow twice")],
)  # fmt: skip
def test_samples_that_are_none_or_one_twice_are_no_measurement(ladder, change, why):
    evidence.edit_table(ladder, "reload/samples.parquet", change)
    with pytest.raises(MissingEvidenceError, match=why):
        asked(ladder, samples_difference, "flow", gate="B")


@pytest.mark.parametrize(
    "counted",
    [dict.fromkeys(("recorded", "counted", "expected", "least", "most"), 0), {"least": 0}],
)
def test_no_evaluation_is_no_count_that_agrees(ladder, counted):
    evidence.edit_table(ladder, "reload/nfe.parquet", lambda f: f.assign(**counted))
    with pytest.raises(MissingEvidenceError, match="without a network evaluation"):
        asked(ladder, nfe_mismatch, "flow", gate="B")


def test_the_largest_difference_counts_whichever_sample_has_it(ladder):
    def differ(frame):
        rows = frame.index[frame["method"] == "flow"]
        frame.loc[rows[0], ["max_abs_difference", "sha256_reloaded"]] = [0.25, "0" * 64]
        return frame

    evidence.edit_table(ladder, "reload/samples.parquet", differ)
    found = asked(ladder, samples_difference, "flow", gate="B")
    assert found.value == 0.25 and "1 not bit-equal" in found.caveat


@pytest.mark.parametrize("column", ["recorded", "counted"])
def test_one_evaluation_too_many_or_too_few_is_a_mismatch(ladder, column):
    for number in (7, 9):
        evidence.edit_table(
            ladder, "reload/nfe.parquet",
            lambda f, n=number: f.assign(**{"recorded": 8, "counted": 8, column: n}),
        )  # fmt: skip
        assert asked(ladder, nfe_mismatch, "flow", gate="B").value == 1


@pytest.mark.parametrize(
    ("path", "criterion", "said"),
    [("train_generators/matched.json", parameter_budget_deviation, "counts no parameters of flow"),
     ("train_generators/matched.json", unpinned_items, "has no entry of flow"),
     ("reload/identity.json", unpinned_items, "has no entry of flow"),
     ("reload/identity.json", nonfinite_weights, "has no entry of flow")],
)  # fmt: skip
def test_a_candidate_of_which_nothing_is_written_is_not_measured(ladder, path, criterion, said):
    evidence.edit_document(ladder, path, lambda d: d.get("methods", d).pop("flow") and None)
    with pytest.raises(MissingEvidenceError, match=said):
        asked(ladder, criterion, "flow", gate="B")


def test_a_reference_without_parameters_is_no_budget_and_one_of_one_is(ladder):
    def of(number):
        def change(document):
            document["methods"]["chunked_bc"]["parameters"]["total"] = number

        return change

    evidence.edit_document(ladder, "train_baselines/matched.json", of(1))
    assert asked(ladder, parameter_budget_deviation, "flow", gate="B").value == 99.0
    evidence.edit_document(ladder, "train_baselines/matched.json", of(0))
    with pytest.raises(MissingEvidenceError, match="chunked_bc has no parameters"):
        asked(ladder, parameter_budget_deviation, "flow", gate="B")
    evidence.edit_document(
        ladder, "train_baselines/matched.json",
        lambda d: d["methods"]["chunked_bc"]["parameters"].pop("total") and None,
    )  # fmt: skip
    with pytest.raises(MissingEvidenceError, match="parameters"):
        asked(ladder, parameter_budget_deviation, "flow", gate="B")


def answer_of(root, name):
    return next(one for one in found_in(judge(root, "B"), name) if one.candidate == "flow")


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ({"cpu": 0.0, "cuda": 0.0}, ("PASS", "two processes that loaded there")),
        ({"cpu": 0.0, "cuda": 1e-3}, ("FAIL", "two processes that loaded there")),
        ({"cpu": 0.0}, ("INCONCLUSIVE", "not every seed was drawn again on cuda")),
        ({"cuda": 0.0}, ("INCONCLUSIVE", "not every seed was drawn again on cpu")),
    ],
)
def test_on_another_device_both_comparisons_are_asked_for(ladder, rows, expected):
    def drawn(frame):
        return pd.concat([
            frame.assign(device=device, max_abs_difference=largest, sha256_reloaded="b" * 64)
            if largest else frame.assign(device=device)
            for device, largest in rows.items()
        ])  # fmt: skip

    evidence.edit_table(ladder, "reload/samples.parquet", drawn)
    evidence.write_params(ladder, lambda params: params["compute"].update(device="cuda"))
    found = answer_of(ladder, "samples_difference")
    assert found.verdict == expected[0] and expected[1] in found.caveat
    pinned = answer_of(ladder, "unpinned_items")
    assert pinned.verdict == "FAIL" and "ran on cpu, compute.device is cuda" in pinned.caveat


def test_of_how_many_weights_none_may_be_no_number(ladder):
    held = Evidence(ladder)
    folders = folders_of(held, "flow").values()
    weights = sum(weights_at(held, f"{folder}/{WEIGHTS}").count for folder in folders)
    counted = answer_of(ladder, "nonfinite_weights").counted
    assert weights > 0 and counted == f"all {words.number(weights)} weights"


def test_chunks_of_its_own_sampler_that_are_no_numbers_fail_a_candidate(ladder):
    evidence.edit_document(
        ladder, "reload/identity.json", lambda said: said["flow"].update(nonfinite_chunks=3)
    )
    found = answer_of(ladder, "nonfinite_weights")
    assert found.verdict == "FAIL" and "3 chunks of its own sampler" in found.caveat
    evidence.edit_document(ladder, "reload/identity.json", lambda d: d["flow"].update(given_up=3))
    found = answer_of(ladder, "nonfinite_weights")
    assert found.verdict == "FAIL" and found.measured == 3
    assert "3 were given up at sampler.nfe_cap" in found.caveat
    assert "hold a number that is none" not in found.caveat
