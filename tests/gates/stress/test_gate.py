"""Gate D: the least evidence over the baselines, and the best of them."""

from types import SimpleNamespace

import evidence
import pandas as pd
import pytest
from asked import asked, settings_of

from gates.evidence import Evidence, MissingEvidenceError
from gates.proof import judge
from gates.stress.gate import best_baseline, promotion_e_value
from gates.stress.pairs import paired_differences
from gates.stress.planned import planner_said
from gates.stress.rollouts import REFUSED, UNPLANNED
from genpolicy.contract.planner import PLANNER
from genpolicy.evidence.rows.stress import RefusedRow
from genpolicy.integrity.hashing import sha256_file
from genpolicy.integrity.rows import write_rows
from genpolicy.statistics.eprocess import paired_e_value

TABLE = "stress/rollouts.parquet"


def edit(root, change):
    evidence.edit_table(root, TABLE, change)
    return Evidence(root), settings_of(root, "D")


def test_the_baseline_against_which_there_is_least_evidence_decides(ladder):
    better = lambda f: f.assign(  # noqa: E731
        success=f["success"] | ((f["method"] == "chunked_bc") & (f["start"] % 5 == 0))
    )
    _, settings = edit(ladder, better)
    values = {
        name: paired_e_value(
            paired_differences(Evidence(ladder), settings, "flow", name),
            margin=settings.margin, alpha=settings.alpha,
        ).e_value
        for name in settings.baselines
    }  # fmt: skip
    found = asked(ladder, promotion_e_value, "flow", gate="D")
    assert found.value == min(values.values())
    assert min(values, key=values.get) == "chunked_bc" and "against chunked_bc" in found.caveat


def test_the_best_baseline_is_the_first_of_equals_and_never_a_candidate(ladder):
    every = lambda frame: frame.assign(success=True)  # noqa: E731
    reader, settings = edit(ladder, every)
    assert best_baseline(reader, settings) == settings.baselines[0]
    last = settings.baselines[-1]
    only = lambda frame: frame.assign(success=~frame["method"].isin(settings.baselines[:-1]))  # noqa: E731
    assert best_baseline(*edit(ladder, only)) == last


def test_a_baseline_that_did_not_meet_the_plan_is_not_called_the_best(ladder):
    def elsewhere(frame):
        own = (frame["method"] == "bc") & (frame["perturbation"] == "camera_delay")
        return frame.assign(perturbation=frame["perturbation"].mask(own, "storm"))

    with pytest.raises(MissingEvidenceError, match="bc did not meet camera_delay"):
        best_baseline(*edit(ladder, elsewhere))
    evidence.edit_table(ladder, "stress/stub.parquet", lambda f: f.assign(stale=1))
    report = judge(ladder, "D")
    assert report.verdict == "FAIL"
    assert report.decision.startswith("return to the simpler policy (bc did not meet")


def test_what_layers_refused_is_bound(ladder):
    """Nobody reads it to judge, and it stands in bundles and pictures of failures."""
    table = ladder / REFUSED
    write_rows(table, RefusedRow, [])
    evidence.record(ladder)
    assert judge(ladder, "D").materials[REFUSED] == sha256_file(table)


def _with_planner(root, every=1):
    """It succeeds on one of so many starts; of the others, of which none always does, nothing
    changes.
    """
    evidence.write_params(root, lambda p: p["stress"]["baselines"].append(PLANNER))

    def counted_beside(frame):
        own = frame[frame["method"] == "chunked_bc"].assign(method=PLANNER)
        return pd.concat([frame, own], ignore_index=True)

    def beside(frame):
        own = frame[frame["method"] == "bc"].assign(method=PLANNER)
        own["success"] = own["start"] % every == 0
        own["outcome"] = own["success"].map({True: "success", False: "timeout"})
        return pd.concat([frame, own], ignore_index=True)

    evidence.edit_table(root, TABLE, beside)
    for name in ("stub", "conservation", "counts", "invocations"):
        evidence.edit_table(root, f"stress/{name}.parquet", counted_beside)
    return Evidence(root), settings_of(root, "D")


def test_who_does_no_better_than_the_planner_alone_is_not_promoted(ladder):
    before = asked(ladder, promotion_e_value, "flow", gate="D")
    reader, settings = _with_planner(ladder)
    assert before.value >= 1.0 / settings.alpha, "over all others a gain is shown"
    found = asked(ladder, promotion_e_value, "flow", gate="D")
    assert found.value < 1.0 and f"against {PLANNER}" in found.caveat
    assert best_baseline(reader, settings) == PLANNER


def test_a_comparison_without_a_planner_says_so(ladder):
    assert UNPLANNED in settings_of(ladder, "D").caveats
    assert UNPLANNED in judge(ladder, "D").caveats
    assert UNPLANNED not in _with_planner(ladder)[1].caveats


@pytest.mark.parametrize(("every", "said"), [(1, 0), (4, 1)])
def test_a_planner_that_is_worth_less_than_a_simple_method_is_said_to_be(ladder, every, said):
    _with_planner(ladder, every)
    caveats = [text for text in judge(ladder, "D").caveats if text.startswith(PLANNER)]
    assert len(caveats) == said
    if said:
        assert "is worth 0.25 in success" in caveats[0] and "nothing against a better" in caveats[0]


def test_a_planner_alone_is_held_to_what_the_plan_says_of_a_simple_method(ladder):
    """As in a rehearsal, which may leave out the others."""
    reader, settings = _with_planner(ladder, 3)
    alone = settings.model_copy(update={"baselines": (PLANNER,)})
    planned = settings.planned_effect[0]
    assert planned > 1 / 3
    [caveat] = planner_said(SimpleNamespace(evidence=reader, settings=alone))
    assert f"the plan's simple method {planned:.2f}" in caveat


def test_of_a_planner_that_did_not_meet_the_plan_nothing_is_said(ladder):
    _with_planner(ladder, 4)
    evidence.edit_table(
        ladder, TABLE, lambda f: f[(f["method"] != PLANNER) | (f["perturbation"] == "nominal")]
    )
    assert not [text for text in judge(ladder, "D").caveats if text.startswith(PLANNER)]
