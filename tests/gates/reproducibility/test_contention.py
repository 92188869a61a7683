"""Waiting for a processor explains a ratio or does not: FAIL becomes INCONCLUSIVE, nothing else."""

import itertools

import evidence
import numpy as np
import pandas as pd
import pytest
from asked import found_in

from gates.evidence import MissingEvidenceError
from gates.proof import judge
from gates.reproducibility import timing
from gates.reproducibility.contention import (
    AGAIN,
    CONTENDED_SHARE,
    Ends,
    running,
    waited_share,
    weigh,
)
from gates.verdicts import judge_criterion

LATENCY, MODEL = "latency/latency.parquet", "latency/model.parquet"
RATIOS = {"warm": "warm_latency_ratio_upper", "cold": "cold_latency_ratio_upper"}
LIMITS = {"warm": 1.5, "cold": 2.0}  # of the evidence
ENDS = [Ends(*one) for one in itertools.combinations_with_replacement((1.0, 1.2, 1.4, 3.0), 3)]


@pytest.fixture(autouse=True)
def _believed(monkeypatch):
    """The ratio is asked here; that a model is that of its times, in `test_held`."""
    monkeypatch.setattr(timing, "require_as_timed", lambda *_, **__: None)


def verdict(wall, weighed, limit):
    return judge_criterion(wall.most, limit, "<=", weighed.interval)


@pytest.mark.parametrize("limit", [1.1, 1.3, 2.0])
@pytest.mark.parametrize("share", [None, 0.0, 0.04, 0.05, 0.9])
def test_contention_can_take_a_fail_back_and_nothing_else(limit, share):
    """Over every pair of intervals: the verdict on the wall, or INCONCLUSIVE where it was FAIL."""
    for wall, without in itertools.product(ENDS, [None, *ENDS]):
        weighed = weigh(wall, without, share=share, limit=limit)
        plain = judge_criterion(wall.most, limit, "<=", (wall.least, wall.most))
        found = verdict(wall, weighed, limit)
        excused = (
            without is not None and share is not None and share >= CONTENDED_SHARE
            and without.point <= limit
        )  # fmt: skip
        assert found == ("INCONCLUSIVE" if plain == "FAIL" and excused else plain)
        assert weighed.interval[1] == wall.most  # what must hold is the time on the wall
        assert bool(weighed.undecided) == (excused and plain != "PASS")


def table(**columns):
    rows = pd.DataFrame(
        {"source": ["measured", "measured", "declared"], "seconds": [2.0, 3.0, 9.0]}
    )
    return rows.assign(**columns)


def test_the_time_that_was_waited_is_taken_off_what_was_measured():
    found = running(table(waited_s=[0.5, 0.0, None]))
    assert list(found["seconds"]) == [1.5, 3.0, 9.0]


def test_one_term_of_which_nothing_is_known_leaves_nothing_known():
    assert running(table(waited_s=[0.5, None, None])) is None


@pytest.mark.parametrize("seconds", [np.nan, np.inf])
def test_a_term_that_took_no_number_of_seconds_is_named_as_that(seconds):
    with pytest.raises(MissingEvidenceError, match="took no number of seconds"):
        running(table(waited_s=[0.0, 0.0, None], seconds=[seconds, 3.0, 9.0]))


@pytest.mark.parametrize("waited", [2.0, 2.5, -0.1])
def test_a_term_that_waited_longer_than_it_took_is_no_evidence(waited):
    with pytest.raises(MissingEvidenceError, match="longer than it took"):
        running(table(waited_s=[waited, 0.0, None]))


def test_the_share_is_that_of_the_process_that_waited_most():
    assert waited_share(np.array([1.0, 2.0]), np.array([0.9, 1.0])) == pytest.approx(0.5)
    assert waited_share(np.array([1.0, 2.0]), np.array([1.0, 2.0])) == 0.0, "nobody waited"
    for ran in ([0.0, 1.0], [1.1, 1.0]):
        with pytest.raises(MissingEvidenceError, match="ran longer"):
            waited_share(np.array([1.0, 2.0]), np.array(ran))


def stretched(temperature, *, waited, of_run=2, factor=6.0):
    """One run of a temperature takes so many times as long; `waited`: share of what came to it."""

    def change(frame):
        own = (frame["source"] == "measured") & (frame["run"] == of_run)
        own &= frame["temperature"] == temperature
        more = frame["seconds"].where(own, 0.0) * (factor - 1.0)
        known = frame["waited_s"].fillna(0.0) + waited * more
        return frame.assign(
            seconds=frame["seconds"] + more,
            waited_s=known.where(frame["source"] == "measured") if waited is not None else np.nan,
        )

    return change


@pytest.mark.parametrize("temperature", RATIOS)
@pytest.mark.parametrize("run", [1, 2])
def test_a_busy_run_is_no_verdict_on_the_candidate(ladder, temperature, run):
    evidence.edit_table(ladder, LATENCY, stretched(temperature, waited=1.0, of_run=run))
    report = judge(ladder, "B")
    for found in found_in(report, RATIOS[temperature]):
        assert found.verdict == "INCONCLUSIVE" and found.measured > 5.0
        assert found.interval[0] < 1.1 and found.interval[1] == found.measured
        assert found.caveat.endswith(f"other programs had the processor and that may be all of it: "
                                     f"{AGAIN}")  # fmt: skip
    assert AGAIN in report.diagnosis and "If it turns out to be broken: Timing" in report.diagnosis


@pytest.mark.parametrize("temperature", RATIOS)
@pytest.mark.parametrize("waited", [0.0, 0.5], ids=["quiet", "busy"])
def test_a_run_that_is_slower_by_itself_fails_on_a_busy_machine_too(ladder, temperature, waited):
    """It sleeps, waits for a disk or computes more: half of what came to it was no queue."""
    evidence.edit_table(ladder, LATENCY, stretched(temperature, waited=waited))
    for found in found_in(judge(ladder, "B"), RATIOS[temperature]):
        assert found.verdict == "FAIL" and AGAIN not in found.caveat


@pytest.mark.parametrize("temperature", RATIOS)
def test_where_waiting_is_not_known_nothing_is_excused(ladder, temperature):
    """Not this kernel, or a policy behind the wire: one term that nobody knows is enough."""

    def unknown(frame):
        frame = stretched(temperature, waited=1.0)(frame)
        encode = (frame["component"] == "encode") & (frame["process"] == 1)
        return frame.assign(waited_s=frame["waited_s"].mask(encode, np.nan))

    evidence.edit_table(ladder, LATENCY, unknown)
    for found in found_in(judge(ladder, "B"), RATIOS[temperature]):
        assert found.verdict == "FAIL" and "for a processor is not known" in found.caveat


def test_what_passes_beside_other_programs_passes(ladder):
    """Both runs waited alike: the ratio is an upper bound, and it holds."""

    def both(frame):
        for run in (1, 2):
            frame = stretched("warm", waited=1.0, of_run=run)(frame)
        return frame

    evidence.edit_table(ladder, LATENCY, both)
    for found in found_in(judge(ladder, "B"), RATIOS["warm"]):
        assert found.verdict == "PASS" and "waiting for a processor" in found.caveat


@pytest.mark.parametrize("temperature", RATIOS)
def test_a_wait_in_one_process_alone_explains_no_ratio_of_all(ladder, temperature):
    """Three processes of a run took a multiple, and one of them waited a little of it.

    Wrong before: its interval grew wide enough to hold the limit, and the ratio was excused.
    """

    def change(frame):
        frame = stretched(temperature, waited=0.0, factor=1.2 * LIMITS[temperature])(frame)
        own = (frame["source"] == "measured") & (frame["temperature"] == temperature)
        last = frame.loc[frame["run"] == 2, "process"].max()
        alone = own & (frame["run"] == 2) & (frame["process"] == last)
        return frame.assign(waited_s=frame["waited_s"].mask(alone, 0.3 * frame["seconds"]))

    evidence.edit_table(ladder, LATENCY, change)
    for found in found_in(judge(ladder, "B"), RATIOS[temperature]):
        assert found.verdict == "FAIL" and AGAIN not in found.caveat, found


def modelled(method, *, waited, column="measured_s", factor=3.0):
    """A method's processes take (or are drawn) longer; `waited`: share of what came to it."""

    def change(frame):
        own = frame["method"] == method
        ran = column.replace("_s", "_running_s")
        more = frame[column].where(own, 0.0) * (factor - 1.0)
        return frame.assign(
            **{column: frame[column] + more, ran: frame[ran] + (1.0 - waited) * more}
        )

    return change


@pytest.mark.parametrize(("who", "column"), [("flow", "measured_s"), ("act", "drawn_s")])
@pytest.mark.parametrize(("waited", "verdict"), [(1.0, "INCONCLUSIVE"), (0.4, "FAIL")])
def test_a_model_is_not_refuted_by_other_programs(ladder, who, column, waited, verdict):
    evidence.edit_table(ladder, MODEL, modelled(who, waited=waited, column=column))
    found = next(a for a in found_in(judge(ladder, "B"), "latency_model_ratio_upper")
                 if a.candidate == "flow")  # fmt: skip
    assert found.verdict == verdict and found.caveat.startswith(f"{who}: ")
    assert (AGAIN in found.caveat) == (verdict == "INCONCLUSIVE")


def test_who_is_shown_to_be_slower_is_not_hidden_by_who_only_waited_longer(ladder):
    """One baseline waited six times as long, another was drawn twice as long: that one decides."""
    evidence.edit_table(ladder, MODEL, modelled("act", waited=1.0, column="drawn_s", factor=6.0))
    evidence.edit_table(ladder, MODEL, modelled("bc", waited=0.0, column="drawn_s", factor=2.0))
    for found in found_in(judge(ladder, "B"), "latency_model_ratio_upper"):
        assert found.verdict == "FAIL" and found.caveat.startswith("bc: ")
