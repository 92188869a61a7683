"""Who was brought and answers otherwise than at Gate B is stopped by the gate that sees it."""

import evidence
import pandas as pd
import pytest

from gates.proof import judge
from gates.report import report_bytes, report_path
from genpolicy.evidence.rows.brought import FixtureAgainRow
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.rows import write_rows
from genpolicy.integrity.tables import read_table
from tests.gates.reproducibility.test_brought import EXCEPTION, bring, of_flow

FOLDERS = {"C": ("shadow", ("shadow",)), "D": ("stress", evidence.CONDITIONS)}


def asked_again(root, gate, change=lambda row: row):
    """Write what was asked again of `flow`; `change` maps each row, None leaves it out."""
    samples = read_table(root / "artifacts/reload/samples.parquet").to_pandas()
    own = samples[samples["method"] == "flow"]
    folder, conditions = FOLDERS[gate]
    rows = [
        FixtureAgainRow("flow", condition, when, int(row), True, digest)
        for condition in conditions
        for when in ("before", "after")
        for row, digest in zip(own["row"], own["sha256_reloaded"], strict=True)
    ]
    path = root / "artifacts" / folder / "fixtures.parquet"
    write_rows(path, FixtureAgainRow, [new for row in rows if (new := change(row)) is not None])
    evidence.record(root)


@pytest.fixture
def brought(ladder):
    """A ladder to which `flow` was brought, judged as far as the gate that is asked for."""
    bring(ladder, unmatched=EXCEPTION)

    def limits(params):
        del params["train_generators"]["samplers"]["flow"]
        params["candidates"] = {"flow": "own/flow.yaml"}
        params["gate_b"]["unmatched"] = {"flow": EXCEPTION}

    evidence.write_params(ladder, limits)
    for gate in "CD":
        asked_again(ladder, gate)
    for gate in "BC":
        write_bytes(ladder / report_path(gate), report_bytes(judge(ladder, gate)))
    return ladder


def other(row, **changes):
    return FixtureAgainRow(**(vars(row) | changes))


@pytest.mark.parametrize("gate", "CD")
def test_who_answers_as_before_passes_and_only_who_was_brought_is_asked(brought, gate):
    report = judge(brought, gate)
    asked = [item for item in report.criteria if item.id == "changed_answers"]
    assert [(item.candidate, item.verdict, item.measured) for item in asked] == [
        ("flow", "PASS", 0.0)
    ]
    assert "artifacts/reload/samples.parquet" in asked[0].evidence


@pytest.mark.parametrize("gate", "CD")
@pytest.mark.parametrize("when", ["before", "after"])
def test_one_other_answer_is_red_for_that_candidate_alone(brought, gate, when):
    last = FOLDERS[gate][1][-1]
    asked_again(
        brought, gate,
        lambda row: other(row, sha256="0" * 64)
        if (row.condition, row.when, row.row) == (last, when, 0) else row,
    )  # fmt: skip
    report = judge(brought, gate)
    answer = of_flow(report, "changed_answers")
    assert (answer.verdict, answer.measured) == ("FAIL", 1.0)
    assert answer.caveat.endswith(f"the first one {when} {last}")
    assert report.candidates["flow"] == "FAIL" and report.candidates["diffusion"] == "PASS"


@pytest.mark.parametrize("gate", "CD")
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda row: None if row.when == "after" else row, "not all of it was asked again after"),
        (lambda row: None if row.row == 0 else row, "not all of it was asked again before"),
        (lambda row: other(row, answered=False, sha256=""), "were not answered again"),
    ],
)
def test_what_was_not_asked_or_not_answered_is_no_pass(brought, gate, change, said):
    asked_again(brought, gate, change)
    answer = of_flow(judge(brought, gate), "changed_answers")
    assert answer.verdict == "INCONCLUSIVE"
    assert said in answer.caveat


def test_a_silent_server_that_also_changed_is_red(brought):
    def change(row):
        if row.row == 0:
            return other(row, answered=False, sha256="")
        return other(row, sha256="0" * 64)

    asked_again(brought, "C", change)
    rows = read_table(brought / "artifacts/shadow/fixtures.parquet").to_pandas()
    assert isinstance(rows, pd.DataFrame) and len(rows)
    answer = of_flow(judge(brought, "C"), "changed_answers")
    silent = int((~rows["answered"]).sum())
    changed = len(rows) - silent
    assert silent == 2 and (answer.verdict, answer.measured) == ("FAIL", changed)
    assert answer.counted == "2 times" and answer.caveat.startswith(
        f"{changed} of {len(rows)} answers, {changed} other than at Gate B, the first one "
    )
