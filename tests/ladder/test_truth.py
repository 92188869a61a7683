"""The benchmark of planted wrongs tells its three outcomes apart, on real runs."""

import json
from pathlib import Path

import pytest
import yaml

from benchmarks.ladder_truth.__main__ import chosen, in_lots, try_one
from benchmarks.ladder_truth.bringing import OWN, Brings
from benchmarks.ladder_truth.catalogue import WRONGS
from benchmarks.ladder_truth.honest import HONEST
from benchmarks.ladder_truth.outcome import (
    GATE_OF_STAGE,
    Expected,
    Seen,
    Stop,
    count,
    look,
    of_candidate,
    refused_by,
)
from benchmarks.ladder_truth.planted_server import WRONGS as SERVED
from benchmarks.ladder_truth.planting import Wrong, patches_of, silently
from benchmarks.ladder_truth.workspace import ROOT
from gates.pipeline import RUNGS
from gates.report import stage_of
from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.wire.entry import verify_files

BIT = silently("artifacts/ingest/frames.parquet")
AT_A = Expected("A", refusal=r"sha256 of artifacts/ingest/frames\.parquet")
CASES = {
    "right": ((BIT, AT_A), "right"),
    "another gate was named": ((BIT, Expected("B", refusal=AT_A.refusal)), "elsewhere"),
    "nothing was planted": ((lambda workspace: None, AT_A), "not at all"),
}
PROVED_WHOLE = "nothing was planted"
"""The ladder is proved to its end."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.long] * (name == PROVED_WHOLE)) for name in CASES],
)
def test_a_planted_wrong_is_counted(finished: Path, tmp_path: Path, name: str) -> None:
    (plant, expected), counted = CASES[name]
    wrong = Wrong(name, "test", name, "small", plant, expected)
    result = try_one(wrong, finished, tmp_path / "copy")
    assert (result["count"], result["fault"]) == (counted, ""), result
    assert not (tmp_path / "copy").exists()


def test_a_plant_that_cannot_be_made_is_broken_and_counts_as_nothing(tmp_path: Path) -> None:
    wrong = Wrong("broken", "test", "", "small", BIT, AT_A)
    result = try_one(wrong, tmp_path / "no such base", tmp_path / "copy")
    assert result["count"] == "broken"
    assert "no such base" in str(result["fault"])


@pytest.mark.parametrize("wrong", WRONGS, ids=lambda wrong: wrong.name)
def test_every_patch_of_the_catalogue_still_fits_the_code_and_leaves_python(wrong: Wrong) -> None:
    for patch in patches_of(wrong.plant):
        text = patch.text(ROOT)
        if patch.file.endswith(".py"):
            compile(text, patch.file, "exec")


STOPS = {
    "the named criterion": (Stop("B", "nfe_mismatch", ""), "right"),
    "another criterion of the gate": (Stop("B", "unpinned_items", ""), "elsewhere"),
    "the criterion for another candidate": (Stop("B", "nfe_mismatch", "", "cvae"), "elsewhere"),
    "the same criterion of another gate": (Stop("C", "nfe_mismatch", ""), "elsewhere"),
    "a refusal in the named words": (Stop("B", "refusal", "sampler.steps is 3"), "right"),
    "a refusal in other words": (Stop("B", "refusal", "no space left"), "elsewhere"),
    "not measured, in the named words": (
        Stop("B", "x", "None, limit <= 1 (not measured: sampler.steps is 3)"),
        "right",
    ),
    "not measured, in other words": (
        Stop("B", "x", "None, limit <= 1 (not measured: no rows)"),
        "elsewhere",
    ),
    "measured, and the words by chance": (
        Stop("B", "x", "2, limit <= 1 (sampler.steps is 3)"),
        "elsewhere",
    ),
}


@pytest.mark.parametrize("name", STOPS)
def test_gate_and_reason_are_both_asked_for(name: str) -> None:
    stop, counted = STOPS[name]
    expected = Expected("B", ("nfe_mismatch",), r"sampler\.steps", candidate="flow")
    assert count(expected, Seen((stop,))) == counted


def test_a_stop_below_the_named_gate_is_elsewhere() -> None:
    stops = (Stop("A", "data_defects", ""), Stop("B", "nfe_mismatch", ""))
    assert count(Expected("B", ("nfe_mismatch",)), Seen(stops)) == "elsewhere"


def test_a_refusal_before_any_stage_counts_for_the_gate_of_the_folder_that_it_names() -> None:
    said = "is a file that the stage stress did not write, expected nothing else"
    for place, gate in (
        ("artifacts/stress/journals/extra.mcap", "D"),
        ("artifacts/monitors/scores.parquet", "D"),
        ("reports/x", "A"),
    ):
        stop = refused_by("", f"{place} {said}")
        assert stop and (stop.gate, stop.reason) == (gate, "refusal")
    stop = refused_by("shadow", f"artifacts/stress/journals/extra.mcap {said}")
    assert stop and stop.gate == "C"


def test_a_finished_ladder_shows_no_stop_and_a_fail_is_one(finished: Path, tmp_path: Path) -> None:
    assert look(finished, "small").stops == ()
    (tmp_path / "reports").mkdir()
    text = (finished / "reports" / "gate_a.json").read_text()
    failed = text.replace('"verdict": "PASS"', '"verdict": "FAIL"')
    assert failed != text
    (tmp_path / "reports" / "gate_a.json").write_text(failed)
    assert {stop.gate for stop in look(tmp_path, "small").stops} == {"A"}


def test_a_gate_that_waits_stops_only_where_everybody_had_signed(tmp_path: Path) -> None:
    """A signature that is taken away leaves nothing wrong to see, and lets nobody by."""
    criterion = {
        "id": "owners_signed", "verdict": "PENDING_REVIEW", "candidate": None, "measured": 3.0,
        "threshold": 4.0, "comparison": ">=", "caveat": "missing: safety",
    }  # fmt: skip
    report = {"criteria": [criterion], "verdict": "PENDING_REVIEW", "caveats": []}
    (tmp_path / "reports").mkdir()
    (tmp_path / "reports" / "gate_e.json").write_text(json.dumps(report))
    assert look(tmp_path, "small").stops == ()
    (stop,) = look(tmp_path, "signed").stops
    assert stop == Stop("E", "owners_signed", "3.0, limit >= 4.0 (missing: safety)")


AREAS = {
    "data", "labels", "leakage", "training", "checkpoint", "sampler", "projection", "queue",
    "supervisor", "evidence", "code", "limits", "signatures", "brought policies", "selection",
}  # fmt: skip
"""What can be wrong with a ladder; of each something is planted."""


def test_the_catalogue_is_large_enough_and_names_are_asked_for_exactly() -> None:
    assert len(WRONGS) >= 60
    assert len(HONEST) >= 20
    assert {w.area for w in WRONGS} == AREAS
    assert {w.base for w in WRONGS} == {"small", "brought", "signed"}
    assert [item.name for item in chosen(["two_cards"], [])] == ["two_cards"]
    with pytest.raises(SystemExit, match="no_such_wrong"):
        chosen(["no_such_wrong"], [])


def test_every_stage_counts_for_the_gate_that_judges_it() -> None:
    of_stage = {name: gate for gate, names in RUNGS.items() for name in (*names, stage_of(gate))}
    assert of_stage == GATE_OF_STAGE


def test_what_is_planted_together_runs_once_and_each_is_a_candidate_of_its_own() -> None:
    together = [item for item in (*WRONGS, *HONEST) if item.together]
    lots = in_lots([*WRONGS, *HONEST])
    assert len(lots) == len(WRONGS) + len(HONEST) - len(together) + 1
    for lot in (lot for lot in lots if lot[0].together):
        assert len({item.candidate for item in lot}) == len(lot)
        for item in lot:
            assert isinstance(item.plant, Brings)
            assert item.plant.name == item.candidate and item.plant.wrong in SERVED


OWN_STOPS = (
    Stop("B", "conformance", "1 (scale: mm)", "planted"),
    Stop("B", "nfe_mismatch", "", "other"),
    Stop("D", "verdict_reachable", ""),
    Stop("D", "reset_upper", "", "flow"),
    Stop("D", "reset_upper", "", "planted"),
)


def test_a_candidate_is_stopped_by_what_speaks_of_it_and_of_nobody_in_particular() -> None:
    seen = of_candidate(Seen(OWN_STOPS), "planted")
    assert [stop.reason for stop in seen.stops] == [
        "conformance", "verdict_reachable", "reset_upper",
    ]  # fmt: skip
    beyond = of_candidate(Seen(OWN_STOPS), "planted", twin="flow")
    assert [stop.reason for stop in beyond.stops] == ["conformance", "verdict_reachable"]


def test_what_a_criterion_says_is_asked_for_where_it_is_named() -> None:
    seen = of_candidate(Seen(OWN_STOPS), "planted")
    for said, counted in (("scale", "right"), ("own_answers", "elsewhere"), ("", "right")):
        expected = Expected("B", ("conformance",), candidate="planted", said=said)
        assert count(expected, seen) == counted


def test_a_planted_candidate_is_an_entry_with_pinned_files(tmp_path: Path) -> None:
    flow = tmp_path / "artifacts/train_generators/flow/seed_0"
    flow.mkdir(parents=True)
    for name in ("model.safetensors", "config.json"):
        (flow / name).write_bytes(name.encode())
    (tmp_path / "artifacts/reload").mkdir()
    card = {
        "dataset": "d" * 64, "split": "e" * 64, "architecture": "small", "parameters": 10,
        "path": "straight", "sampler": "euler", "sampler_steps": 4, "precision": "float32",
        "device": "cpu", "threads": 1, "cpu_capability": "AVX2", "batch_rows": 1,
        "evaluations": "4",
    }  # fmt: skip
    identity = {"flow": {"card": card, "seed": [7]}}
    (tmp_path / "artifacts/reload/identity.json").write_text(json.dumps(identity))
    horizons = {
        "observation_horizon": 2, "prediction_horizon": 16, "execution_horizon": 8,
        "action_period_s": 0.05,
    }  # fmt: skip
    params = {"horizons": horizons, "candidates": {}, "gate_b": {"unmatched": {}}}
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(params))
    for item in (item for item in (*WRONGS, *HONEST) if item.together):
        item.plant(tmp_path)
        entry = read_entry(tmp_path / OWN / f"{item.candidate}.yaml")
        verify_files(entry, tmp_path / OWN)
        assert entry.name == item.candidate and len(entry.files) == 3
    found = yaml.safe_load((tmp_path / "params.yaml").read_text())
    assert set(found["candidates"]) == set(found["gate_b"]["unmatched"])
    assert len(found["candidates"]) == 12
