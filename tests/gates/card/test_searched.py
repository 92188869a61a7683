"""What a search found is on the card word for word, and moves no number of Gate D."""

from dataclasses import replace

import pytest
from evidence import record

from gates.card.card import card_bytes
from gates.card.drafting import draft
from gates.card.searched import NOBODY, SEARCHED, searched, searched_caveats, size_of
from gates.card.signing import read_draft
from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.tables_searched import FOUND
from gates.proof import judge
from gates.report import GATES, read_report
from genpolicy.evidence.rows.failures import SearchedRow
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.rows import write_rows

ONE = SearchedRow(
    method="flow", seed=0, perturbation="camera_delay@search", of="camera_delay", start=0,
    point=(0.5, 1.0), scene_start="{}", start_sha256="a" * 64, field="magnitude_s", severity=0.08,
    most=0.08, outcome="success", failed=False, worth=0.4,
)  # fmt: skip
ROWS = [
    ONE,
    replace(ONE, start=1, severity=0.05, outcome="timeout", failed=True, worth=-0.4),
    replace(ONE, start=2, severity=0.031, outcome="force_stop", failed=True, worth=-0.6),
    replace(ONE, perturbation="nominal@search", of="nominal", field="", severity=None, most=None),
    replace(ONE, method="diffusion", start=0, outcome="timeout", failed=True),
]


def plant(root, rows=ROWS):
    (root / SEARCHED).parent.mkdir(parents=True, exist_ok=True)
    write_rows(root / SEARCHED, SearchedRow, rows)
    record(root)


def passed(root):
    found = {gate: read_report(root, gate) for gate in GATES[:4]}
    return {g: r for g, (r, _) in found.items()}, {g: digest for g, (_, digest) in found.items()}


def test_found_is_counted_by_candidate_and_condition_with_the_mildest_failure(tmp_path):
    plant(tmp_path)
    delayed, nominal, other = searched(tmp_path)
    assert (delayed.evaluated, delayed.failed, delayed.mildest) == (3, 2, ROWS[2])
    assert size_of(delayed) == "magnitude_s 0.031 (stated up to 0.08)"
    assert (nominal.failed, nominal.mildest, size_of(nominal)) == (0, None, "")
    assert other.method == "diffusion"


def test_the_card_says_how_often_one_looked_and_that_it_counts_nowhere(tmp_path):
    plant(tmp_path)
    (said,) = searched_caveats(tmp_path, "flow")
    for part in (
        "found by search; counted in no promotion test",
        "flow failed in 2 of 4 rollouts",
        "camera_delay 2 of 3, mildest at magnitude_s 0.031 (stated up to 0.08): force_stop at "
        "camera_delay@search/2",
        "nominal 0 of 1; artifacts/failure_search/searched.parquet, SHA-256 ",
        "no rate of failure",
    ):
        assert part in said


def test_where_nobody_looked_the_card_says_so(tmp_path):
    assert searched_caveats(tmp_path, "flow") == (NOBODY,)
    plant(tmp_path, [])
    assert searched_caveats(tmp_path, "flow") == (NOBODY,)


def test_no_number_of_gate_d_moves_whatever_a_search_found(ladder):
    before = judge(ladder, "D")
    plant(ladder, [replace(ONE, start=n, failed=True, outcome="collision") for n in range(500)])
    after = judge(ladder, "D")
    assert before.verdict == "PASS"
    assert after.model_dump() == before.model_dump(), "nor is the table a material of the gate"


def test_a_draft_without_what_was_found_is_refused(team):
    assert NOBODY in read_draft(team.root).caveats
    plant(team.root)
    (upstream,) = [c for c in team.judge().criteria if c.id == "upstream_passed"]
    assert (upstream.verdict, "leaves out a caveat" in upstream.caveat) == ("FAIL", True)
    card = draft(team.root, *passed(team.root))
    assert searched_caveats(team.root, card.candidate)[0] in card.caveats
    write_bytes(team.root / "artifacts/card/card.json", card_bytes(card))
    record(team.root)
    report = team.judge()
    assert {c.verdict for c in report.criteria if c.id == "upstream_passed"} == {"PASS"}
    assert SEARCHED in report.materials


@pytest.mark.parametrize("rows", [ROWS, []])
def test_the_page_of_gate_e_lists_every_condition(team, rows):
    plant(team.root, rows)
    report, evidence = team.judge(), Evidence(team.root)
    if not rows:
        with pytest.raises(MissingEvidenceError, match="nobody looked"):
            FOUND.read(evidence, report)
        return
    _, first, *others = FOUND.read(evidence, report)
    assert first[:4] == ("camera_delay", "flow", "3", "2") and len(others) == 2
    assert first[5] == "force_stop, failures/flow__camera_delay@search__2.json"
    plant(team.root, rows[:1])
    with pytest.raises(MissingEvidenceError, match="not the file that the report names"):
        FOUND.read(Evidence(team.root), report)
