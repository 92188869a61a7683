"""The walk stops at the first place that is not in order, and says what it did not ask."""

from dataclasses import replace

import evidence
import pytest
from causes_planted import FLOW

from gates.diagnosis.places import PLACES
from gates.diagnosis.reports import EVERYBODY
from gates.diagnosis.walk import criteria_at, walk
from gates.report import Overridden


def turned(reports, name, verdict, candidate=None):
    """The reports, with another verdict of one criterion, as if it had been judged so."""
    gate, _, wanted = name.partition(".")
    report = reports.judged[gate]
    assert any(c.id == wanted and c.candidate == candidate for c in report.criteria)
    criteria = tuple(
        c.model_copy(update={"verdict": verdict})
        if (c.id, c.candidate) == (wanted, candidate)
        else c
        for c in report.criteria
    )
    changed = report.model_copy(update={"criteria": criteria})
    return replace(reports, judged={**reports.judged, gate: changed})


def without(reports, *gates):
    judged = {gate: report for gate, report in reports.judged.items() if gate not in gates}
    return replace(
        reports, judged=judged, missing={**reports.missing, **{g: f"no {g}" for g in gates}}
    )


def test_where_every_gate_passes_each_place_is_asked_and_in_order(honest):
    found = walk(honest, FLOW)
    assert [stop.place for stop in found.stops] == list(PLACES)
    assert {stop.state for stop in found.stops} == {"in order"}
    assert found.whole and found.ended_at is None and found.behind == ()
    every = sum(len(report.criteria) for report in honest.judged.values())
    others = sum(c.candidate == "diffusion" for r in honest.judged.values() for c in r.criteria)
    assert sum(stop.asked for stop in found.stops) == every - others


@pytest.mark.parametrize("place", PLACES)
def test_it_stops_at_whichever_place_is_red_and_asks_nothing_behind_it(honest, place):
    gate, item = next((g, i) for g, i in criteria_at(place) if i.id not in ("changed_answers",))
    who = FLOW if item.per_candidate else None
    found = walk(turned(honest, f"{gate}.{item.id}", "FAIL", who), FLOW)
    assert found.ended_at.place == place and found.ended_at.state == "RED"
    assert [stop.place for stop in found.stops] + list(found.behind) == list(PLACES)
    assert found.ended_at.unmet[0].startswith(f"{item.id} (gate {gate}): ")
    assert found.ended_at.unmet[0].endswith(item.look_at)


def test_a_red_place_behind_a_red_one_is_not_named(honest):
    both = turned(turned(honest, "A.data_defects", "FAIL"), "D.force_peak_p95_n", "FAIL", FLOW)
    found = walk(both, FLOW)
    assert found.ended_at.place == "data semantics" and "contact controller" in found.behind


def test_what_another_candidate_fails_is_not_its_own(honest):
    of_diffusion = turned(honest, "D.deadline_miss_upper", "FAIL", "diffusion")
    assert walk(of_diffusion, FLOW).whole
    assert walk(of_diffusion, "diffusion").ended_at.place == "timing and queue"


@pytest.mark.parametrize("verdict", ["INCONCLUSIVE", "PENDING_REVIEW"])
def test_what_is_not_decided_stops_as_well_and_is_not_called_red(honest, verdict):
    found = walk(turned(honest, "A.told_share", verdict), FLOW)
    assert found.ended_at.place == "conditioning" and found.ended_at.state == "not decided"


def test_of_red_and_open_at_one_place_the_red_one_is_named(honest):
    both = turned(turned(honest, "A.told_share", "INCONCLUSIVE"), "A.strata_effect", "FAIL")
    ended = walk(both, FLOW).ended_at
    assert ended.state == "RED" and [text.split()[0] for text in ended.unmet] == ["strata_effect"]


def test_a_gate_that_is_not_judged_hides_no_red_place_before_or_behind(honest):
    reports = turned(without(honest, "D"), "C.stub_invalid", "FAIL", FLOW)
    found = walk(reports, FLOW)
    states = {stop.place: stop.state for stop in found.stops}
    assert states["data semantics"] == "in order"
    assert states["timing and queue"] == "in order so far"
    assert found.ended_at.place == "feasibility"
    (timing,) = [stop for stop in found.stops if stop.place == "timing and queue"]
    assert timing.waits_for == ("no D",)


def test_without_a_gate_nothing_red_is_no_whole_walk(honest):
    found = walk(without(honest, "D"), FLOW)
    assert found.ended_at is None and not found.whole
    states = {stop.place: stop.state for stop in found.stops}
    assert states["contact controller"] == "not asked"


def test_before_a_candidate_is_judged_what_concerns_everybody_is_asked(honest):
    found = walk(without(honest, "B", "C", "D"), EVERYBODY)
    assert [stop.state for stop in found.stops[:2]] == ["in order", "in order"]
    assert found.stops[2].state == "in order so far" and not found.whole


def test_who_was_stopped_below_is_not_in_order_above(honest):
    report = honest.judged["D"]
    criteria = tuple(c for c in report.criteria if c.candidate != FLOW)
    stopped = report.model_copy(update={"criteria": criteria, "candidates": {"diffusion": "PASS"}})
    found = walk(replace(honest, judged={**honest.judged, "D": stopped}), FLOW)
    assert not found.whole
    waits = [why for stop in found.stops for why in stop.waits_for]
    assert "flow does not stand at gate D: it did not pass below" in waits


def test_a_real_defect_is_found_by_the_real_gates(planted):
    def edit(root):
        evidence.edit_table(root, "audit/clocks.parquet", evidence.lags_apart)

    found = walk(planted(edit, "A"), FLOW)
    assert found.ended_at.place == "data semantics" and len(found.stops) == 1


def test_a_stop_that_somebody_overrides_says_so_and_is_still_where_to_look(honest):
    place = next(place for place in PLACES if criteria_at(place))
    gate, item = criteria_at(place)[0]
    candidate = FLOW if item.per_candidate else None
    reports = turned(honest, f"{gate}.{item.id}", "FAIL", candidate)
    entry = Overridden(
        gate=gate, criterion=item.id, candidate=candidate, comparison="<=", threshold=1.0,
        limit=2.0, by="rita", reason="r", expires="2026-12-24", verdict="FAIL", instead="PASS",
        without="FAIL",
    )  # fmt: skip
    held = reports.judged[gate].model_copy(update={"overrides": (entry,)})
    stop = walk(replace(reports, judged={**reports.judged, gate: held}), FLOW).stops[-1]
    assert (stop.place, stop.state) == (place, "RED")
    (text,) = stop.unmet
    assert "OVERRIDDEN by rita until 2026-12-24: PASS by <= 2. " in text
    assert text.endswith(item.look_at)
    assert "OVERRIDDEN" not in walk(reports, FLOW).stops[-1].unmet[0]
