"""Both rules of matching on Gate B's page: every pair, with what the report says of it."""

import evidence

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.tables_matching import HEADS, RULES
from gates.proof import judge


def test_every_candidate_stands_beside_every_trained_baseline(whole, judged):
    (found,) = draw_all((RULES,), Evidence(whole), judged("B"))
    heads, *rows = found.listed
    assert heads == HEADS
    pairs = [(row[0], row[1]) for row in rows]
    assert {pair[0] for pair in pairs} == set(evidence.CANDIDATES)
    assert len(pairs) == len(set(pairs)) and {"bc", "act"} <= {pair[1] for pair in pairs}
    for row in rows:
        line = dict(zip(heads, row, strict=True))
        assert line["updates"] == f"{evidence.UPDATES} and {evidence.UPDATES}"
        assert (line["by equal updates"], line["by equal convergence"]) == ("PASS", "PASS")
        assert line["candidate's loss still falls"].startswith("4 % (")
        assert line["may still learn"] == "neither"
    assert RULES.title in gate_page(whole, judged("B"))


def test_a_limit_that_is_missing_leaves_the_table_out(ladder):
    evidence.write_params(
        ladder, lambda params: params["gate_b"]["limits"]["model"].pop("baseline_fall_upper")
    )
    (found,) = draw_all((RULES,), Evidence(ladder), judge(ladder, "B"))
    assert "has no limit" in found.skipped
