"""False evidence that is cheap to write: what Gate B reads again instead of believing it.

Each case is a table or document that nothing else contradicts but what it claims to be about.
"""

import json
from dataclasses import fields

import evidence
import numpy as np
import pandas as pd
import pytest
from asked import asked
from editing import cells

from gates.evidence import MissingEvidenceError
from gates.proof import SPECS
from gates.reproducibility import modelled, planned
from gates.reproducibility.fixtures import TrainedFixture
from gates.reproducibility.identity import WARM_UP
from gates.reproducibility.modelled import uniforms
from genpolicy.evidence import fixtures_again
from genpolicy.evidence.reproducibility import latency
from genpolicy.evidence.reproducibility.benchmark import DISCARDED
from genpolicy.integrity.tables import read_table, write_table
from genpolicy.policies.fixtures import FixtureRow

CRITERIA = {item.id: item for item in SPECS["B"].criteria}
IDENTITY, MATCHED = "reload/identity.json", "train_generators/matched.json"
LATENCY, MODEL = "latency/latency.parquet", "latency/model.parquet"
SAMPLES, MODES = "reload/samples.parquet", "reload/modes.parquet"
FIXTURES = "train_generators/fixtures.parquet"
UNKNOWN = {"measured_running_s": np.nan, "drawn_running_s": np.nan}


def forged(root, path, change):
    """Only this table or document says otherwise; nothing follows it."""
    file = root / "artifacts" / path
    if path.endswith(".json"):
        value = json.loads(file.read_bytes())
        evidence.document(root, path, change(value) or value)
    else:
        frame = change(read_table(file).to_pandas())
        write_table(file, evidence.pa.Table.from_pandas(frame, preserve_index=False))


def held(root, name):
    """What a criterion says of `flow`: why it measures nothing, or what it counts."""
    item = CRITERIA[name]
    try:
        found = asked(root, item, *(["flow"] if item.per_candidate else []), gate="B")
    except MissingEvidenceError as error:
        return str(error)
    return found.caveat if found.value else ""


def card(**values):
    return lambda document: document["flow"]["card"].update(values)


def config(change):
    return lambda document: change(document["methods"]["flow"]["config"])


def of_flow(change):
    """A change of the rows of one candidate alone."""
    return lambda f: pd.concat([f[f["method"] != "flow"], change(f[f["method"] == "flow"])])


def run_2(frame):
    return (frame["run"] == 2) & (frame["process"] == 3)


PLANNED = [
    (SAMPLES, lambda f: f[f["row"] == 0], "samples_difference",
     "has 1 of 8 planned fixtures (policy.fixtures) of flow, seed 0, on cpu"),
    (SAMPLES, lambda f: f.assign(row=f["row"] + 1), "samples_difference",
     "has 7 of 8 planned fixtures"),
    (LATENCY, lambda f: f[(f["repeat"] == 0) | (f["temperature"] == "cold")],
     "warm_latency_ratio_upper",
     "has 1 warm invocations of flow in process 1 of run 1; planned are 8 (latency.warm)"),
    (LATENCY, lambda f: f[(f["repeat"] == 0) | (f["temperature"] == "warm")],
     "cold_latency_ratio_upper", "has 1 cold invocations of flow in process 1 of run 1; planned"),
    (LATENCY, lambda f: f[(f["repeat"] == 0) | (f["temperature"] == "cold")],
     "latency_model_ratio_upper", "has 1 warm invocations of flow"),
    (LATENCY, lambda f: f[(f["repeat"] == 0) | (f["method"] != "act")],
     "latency_model_ratio_upper", "has 1 warm invocations of act"),
    (LATENCY, lambda f: f[~run_2(f)], "warm_latency_ratio_upper",
     "has 0 warm invocations of flow in process 3 of run 2"),
    (LATENCY, lambda f: f[(f["process"] < 3) | (f["source"] == "declared")],
     "warm_latency_ratio_upper", "in process 3 of run 1"),
]  # fmt: skip
SITUATIONS = [
    (MODES, lambda f: f[f["episode_uuid"] != "e1"], "mode_coverage_lower",
     "holds 29 of the 30 situations that the audit names and 0 others, of flow, seed 0"),
    (MODES, lambda f: f[f["episode_uuid"] != "e1"], "outside_modes_upper", "holds 29 of the 30"),
    ("reload/modes_earlier.parquet", lambda f: f[f["episode_uuid"] != "e1"], "late_change_upper",
     "modes_earlier.parquet holds 29 of the 30"),
    (MODES, lambda f: f.replace({"episode_uuid": {"e1": "e0"}}), "mode_coverage_lower",
     "holds 29 of the 30 situations that the audit names and 1 others"),
    (MODES, lambda f: pd.concat([f, f[f["index"] == 1]]), "mode_coverage_lower",
     "has a situation of flow twice"),
    (MODES, lambda f: f.assign(samples=2, fewest_admissible=1), "mode_coverage_lower",
     "in which flow drew 2 candidates; planned are 16"),
    (MODES, lambda f: f.assign(seed=1), "mode_coverage_lower",
     "no rows of flow of training seed 0"),
    (MODES, of_flow(lambda f: pd.concat([f, f.assign(convention="other")])), "mode_coverage_lower",
     "draws flow in several ways"),
]  # fmt: skip
CONFIGURED = [
    (MATCHED, config(lambda c: c["training"].update(learning_rate=9.0)), "unpinned_items",
     "training.learning_rate: matched.json says 9.0, seed_0 "),
    (MATCHED, config(lambda c: c.update(training_only_parameters=5)), "unpinned_items",
     "training_only_parameters: matched.json says 5, seed_0 0"),
    (MATCHED, lambda d: d["methods"]["flow"]["parameters"].update(total=101), "unpinned_items",
     "parameters: matched.json counts others than its configuration"),
    (MATCHED, lambda d: d["methods"]["chunked_bc"]["config"]["training"].update(weight_decay=5.0),
     "unpinned_items", "reference chunked_bc: training.weight_decay: matched.json says 5.0"),
    (MATCHED, lambda d: d.update(reference="flow"), "unpinned_items",
     "flow has no config.json of training seed 0"),
]  # fmt: skip
CARD = [
    (IDENTITY, card(**{item: value}), "unpinned_items", said)
    for item, value, said in (
        ("deadline_s", 9.0, "deadline_s: 9.0, planned 0.15"),
        ("candidates", 1, "candidates: 1, planned 4"),
        ("warm_up", 1, "warm_up: 1, planned 10"),
        ("threads", 64, "threads: 64, planned 1"),
        ("precision", "float64", "precision: float64, seed_0 is float32"),
    )
]
PINS = [
    (IDENTITY, lambda d: d["flow"].update(normalisation="e" * 64), "unpinned_items",
     "normalisation: not the hash of the checkpoint's own"),
    (IDENTITY, lambda d: d["flow"].update(sampler="e" * 64), "unpinned_items",
     "sampler: not the hash of the checkpoint's own"),
    (IDENTITY, lambda d: d["flow"].update(nonfinite_weights=1), "nonfinite_weights",
     "1 weights are said to be none, 0 are"),
    (FIXTURES, of_flow(lambda f: f.assign(sha256="e" * 64)), "samples_difference",
     "holds 0 of the 8 samples that training drew"),
    (FIXTURES, of_flow(lambda f: f.assign(checkpoint="e" * 64)), "samples_difference",
     "is of another checkpoint or sampler of flow"),
    (FIXTURES, of_flow(lambda f: f.assign(sampler="e" * 64)), "samples_difference",
     "is of another checkpoint or sampler of flow"),
    (FIXTURES, of_flow(lambda f: f.assign(nfe=7)), "samples_difference",
     "counts other evaluations of flow"),
    (FIXTURES, lambda f: f[f["method"] != "flow"], "samples_difference", "no rows of flow"),
    ("reload/nfe.parquet",
     lambda f: f.assign(recorded=9, counted=9, expected=9, least=9, most=9), "nfe_mismatch",
     "allows flow 9 to 9 evaluations; by its definition euler takes 8 to 8"),
]  # fmt: skip
DECLARED = [
    (LATENCY, cells("seconds", seconds, where=lambda f: f["component"] == "network"),
     "latency_terms_missing", "missing: network; ")
    for seconds in (0.0, 0.01)
]  # fmt: skip
LEARNED = [
    ("train_baselines/act/seed_0/validation.parquet", change, "baseline_fall_upper",
     "act/seed_0/validation.parquet has ")
    for change in (lambda f: f[f["episode_uuid"] != "e1"], lambda f: f.assign(windows=1),
                   lambda f: f.replace({"episode_uuid": {"e1": "e99"}}))
]  # fmt: skip
MODELLED = [
    (MODEL, lambda f: f.assign(measured_s=f["drawn_s"], **UNKNOWN), "latency_model_ratio_upper",
     "flow: what model.parquet says was measured is not what the times"),
    (MODEL, lambda f: f.assign(drawn_s=f["measured_s"], **UNKNOWN), "latency_model_ratio_upper",
     "flow: what model.parquet says was drawn is not what the times"),
    (MODEL, lambda f: f.assign(**{
        name: f[name].mask(f["method"] == "act", value)
        for name, value in {"drawn_s": f["measured_s"], **UNKNOWN}.items()}),
     "latency_model_ratio_upper", "act: what model.parquet says was drawn"),
    (MODEL, lambda f: f.assign(measured_running_s=1e-3 * f["measured_s"]),
     "latency_model_ratio_upper", "give without the time waited"),
    (MODEL, lambda f: f[(f["method"] != "act") | (f["process"] < 3)], "latency_model_ratio_upper",
     "act: artifacts/latency/model.parquet does not hold each timed process once"),
]  # fmt: skip
FORGED = [*PLANNED, *SITUATIONS, *CONFIGURED, *CARD, *PINS, *DECLARED, *LEARNED, *MODELLED]


@pytest.mark.parametrize(("path", "change", "criterion", "said"), FORGED)
def test_false_evidence_that_nothing_else_contradicts_is_named(repo, path, change, criterion, said):
    forged(repo, path, change)
    assert said in held(repo, criterion)


def test_none_of_these_criteria_says_so_of_true_evidence(repo):
    for name in {criterion for _, _, criterion, _ in FORGED}:
        item = CRITERIA[name]
        found = asked(repo, item, *(["flow"] if item.per_candidate else []), gate="B")
        assert found.value is not None


def test_more_than_planned_is_no_fault(repo):
    change = lambda p: (p["policy"].update(fixtures=1), p["latency"].update(warm=1, cold=1))  # noqa: E731
    evidence.write_params(repo, change)
    for name in ("samples_difference", "warm_latency_ratio_upper", "latency_model_ratio_upper"):
        assert asked(repo, CRITERIA[name], "flow", gate="B").value is not None


@pytest.mark.parametrize("seeds", [[0, 1], [1]])
def test_a_training_seed_that_was_planned_and_is_not_there_is_named(repo, seeds):
    evidence.write_params(repo, lambda p: p["policy"].update(seeds=seeds))
    assert "no rows of flow of training seed 1" in held(repo, "mode_coverage_lower")
    said = held(repo, "unpinned_items")
    assert "seed: 1 planned and not trained" in said or "training seed 1" in said


def test_weights_that_are_others_than_the_card_says_are_counted(repo):
    file = repo / "artifacts/train_generators/flow/seed_0/model.safetensors"
    for data, said in (
        (evidence.weights("flow", (0.5,) * 99), "parameters: 100, seed_0 holds 99"),
        (
            evidence.weights("flow", (0.5,) * 100, kind="F64"),
            "precision: float32, seed_0 is float64",
        ),
    ):
        file.write_bytes(data)
        evidence.follow(repo)
        assert held(repo, "unpinned_items") == said


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_weight_that_is_no_number_is_counted_where_it_lies(repo, value):
    file = repo / "artifacts/train_generators/flow/seed_0/model.safetensors"
    file.write_bytes(evidence.weights("flow", (0.5,) * 99 + (value,)))
    assert held(repo, "nonfinite_weights") == "0 weights are said to be none, 1 are"
    forged(repo, IDENTITY, lambda d: d["flow"].update(nonfinite_weights=1))
    assert asked(repo, CRITERIA["nonfinite_weights"], "flow", gate="B").value == 1.0


def test_what_is_no_file_of_weights_is_missing_evidence(repo):
    for data in (b"", b"flow", (2**40).to_bytes(8, "little") + b"{}", b"\x02" + b"\0" * 7 + b"[]"):
        (repo / "artifacts/train_generators/flow/seed_0/model.safetensors").write_bytes(data)
        assert "is no file of weights" in held(repo, "nonfinite_weights")


def test_a_method_that_always_draws_the_same_draws_one_candidate(repo):
    def direct(document):
        document["methods"]["flow"]["config"]["sampler"]["name"] = "direct"

    evidence.edit_document(repo, MATCHED, direct)
    forged(repo, IDENTITY, card(sampler="direct"))
    assert "candidates: 4, planned 1" in held(repo, "unpinned_items")


def test_numbers_behind_the_drawn_invocations_hang_on_the_seed_alone():
    assert np.array_equal(uniforms(1)["sample"], uniforms(1)["sample"])
    assert not np.array_equal(uniforms(1)["sample"], uniforms(2)["sample"])


def test_what_gates_know_by_other_words_is_what_was_measured_by():
    """Gates import no network; so these stand twice, and here both sides meet."""
    assert (planned.RUNS, planned.PROCESSES) == (latency.RUNS, latency.PROCESSES)
    assert planned.SHOWN_TO_BROUGHT == fixtures_again.FIXTURES
    assert modelled.DRAWN == latency.DRAWN
    assert WARM_UP == DISCARDED
    own, theirs = ([(f.name, f.type) for f in fields(of)] for of in (TrainedFixture, FixtureRow))
    assert own == theirs
