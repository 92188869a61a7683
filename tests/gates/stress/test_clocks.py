"""What Gate D says of the two clocks: alike, different, or neither; and what it does not judge."""

import evidence
import pytest

from gates.doubts import doubts_of
from gates.evidence import Evidence
from gates.pages import tables_clocks
from gates.proof import judge
from gates.settings import read_params, read_settings
from gates.stress import clocks
from gates.stress.clocks import AGREE, DIFFER, UNSEEN, UNTOLD, compared
from gates.stress.rollouts import StressSettings

INVOCATIONS, AGES = "wall_clock/invocations.parquet", "wall_clock/ages.parquet"


def of(root, candidate="flow"):
    settings = read_settings(read_params(root), "gate_d", StressSettings)
    return compared(Evidence(root), settings, candidate)


def on_the_wall(frame, column, value, *, share=1.0):
    """The column of some of flow's rows by the wall clock."""
    rows = (frame["method"] == "flow") & (frame["clock"] == "wall")
    rows &= frame["episode"] < f"held_out_{round(48 * share):02}"
    return frame.assign(**{column: frame[column].mask(rows, value)})


def test_clocks_that_did_the_same_agree(ladder):
    found = of(ladder)
    assert (found.answer, found.episodes) == (AGREE, 48)
    assert {item.name for item in found.differences} == {
        "age_distance", "deadline_misses", "discards", "replacements"
    }  # fmt: skip


def test_every_second_deadline_missed_by_the_wall_clock_alone_differs(ladder):
    found = of(ladder, "diffusion")
    assert found.answer == DIFFER
    misses = next(item for item in found.differences if item.name == "deadline_misses")
    assert (misses.wall, misses.virtual, misses.outside) == (0.5, 0.0, True)
    assert "discards as expired" in found.why


@pytest.mark.parametrize(
    ("path", "column", "value"),
    [(INVOCATIONS, "missed", True), (INVOCATIONS, "discarded_by", "infeasible"),
     (INVOCATIONS, "replaced", False), (AGES, "age_s", 0.25)],
)  # fmt: skip
def test_each_kind_of_difference_is_seen(ladder, path, column, value):
    evidence.edit_table(ladder, path, lambda f: on_the_wall(f, column, value, share=0.5))
    assert of(ladder).answer == DIFFER


def test_a_tenth_of_the_episodes_is_neither_shown_alike_nor_different(ladder):
    evidence.edit_table(ladder, INVOCATIONS, lambda f: on_the_wall(f, "missed", True, share=0.1))
    assert of(ladder).answer == UNTOLD


def test_a_tick_that_is_late_by_less_than_half_a_period_is_that_tick(ladder):
    def late(frame):
        rows = frame["clock"] == "wall"
        return frame.assign(age_s=frame["age_s"] + rows * 0.02)

    evidence.edit_table(ladder, AGES, late)
    assert of(ladder).answer == AGREE


def test_the_first_invocation_of_a_window_and_the_last_are_compared_with_nothing(ladder):
    def first(frame):
        rows = (frame["clock"] == "wall") & (frame["invocation"] == 0)
        return frame.assign(missed=frame["missed"] | rows)

    evidence.edit_table(ladder, INVOCATIONS, first)
    assert of(ladder).answer == AGREE

    def last(frame):
        rows = (frame["clock"] == "wall") & (frame["invocation"] == 2)
        return frame.assign(missed=frame["missed"] | rows, in_time=frame["in_time"] & ~rows)

    evidence.edit_table(ladder, INVOCATIONS, last)
    assert of(ladder).answer == AGREE


def test_few_episodes_cannot_tell(ladder):
    evidence.edit_table(ladder, INVOCATIONS, lambda f: f[f["episode"] < "held_out_15"])
    found = of(ladder)
    assert (found.answer, found.episodes) == (UNTOLD, 15) and "too few episodes" in found.why


@pytest.mark.parametrize("clock", ["wall", "virtual"])
def test_an_episode_that_one_clock_alone_ran_is_compared_with_nothing(ladder, clock):
    def less(frame):
        return frame[(frame["clock"] != clock) | (frame["episode"] < "held_out_40")]

    evidence.edit_table(ladder, INVOCATIONS, less)
    assert of(ladder).episodes == 40


def test_without_a_tolerance_nothing_agrees(ladder):
    evidence.write_params(ladder, lambda p: p["gate_d"].pop("tolerances"))
    assert of(ladder).answer == UNTOLD and "tolerance none fixed" in of(ladder).why


def test_a_rule_that_the_checker_finds_broken_is_a_difference(ladder):
    def broken(document):
        document["journals"]["flow__wall.mcap"]["violations"] = [
            {"session": "s", "event": 7, "rule": "P2.watchdog", "text": "Silent."}
        ]

    evidence.edit_document(ladder, "wall_clock/checker.json", broken)
    assert of(ladder).answer == DIFFER and "1 rules broken" in of(ladder).why


def test_one_clock_that_accepted_nothing_cannot_be_told(ladder):
    evidence.edit_table(
        ladder, AGES, lambda f: f[~((f["method"] == "flow") & (f["clock"] == "wall"))]
    )
    assert of(ladder).answer == UNTOLD


@pytest.mark.parametrize("missing", ["invocations.parquet", "ages.parquet", "checker.json"])
def test_what_nobody_measured_was_not_looked_at_and_the_gate_says_so(ladder, missing):
    evidence.replace(ladder, f"wall_clock/{missing}", None)
    report = judge(ladder, "D")
    assert of(ladder).answer == UNSEEN
    texts = [doubt.text for doubt in doubts_of(report) if "not looked at" in doubt.text]
    assert [text.partition(":")[0] for text in texts] == ["diffusion", "flow"]


def test_it_is_said_and_judged_by_nobody(ladder):
    report = judge(ladder, "D")
    said = [text for text in report.caveats if "wall clock" in text]
    assert [text.partition(" (")[0] for text in said] == [
        "diffusion: the virtual clock and the wall clock differ",
        "flow: the virtual clock and the wall clock agree",
    ]
    assert report.candidates["diffusion"] == "PASS"
    assert not [c for c in report.criteria if "clock" in c.id]
    assert {clocks.INVOCATIONS, clocks.AGES} <= set(report.materials)


@pytest.mark.parametrize(("clocks_without", "said"), [(["wall"], 0), (["wall", "virtual"], 1)])
def test_where_no_chunk_took_over_from_another_it_is_said(clocks_without, said, ladder):
    def alone(frame):
        rows = (frame["method"] == "flow") & frame["clock"].isin(clocks_without)
        return frame.assign(replaced=frame["replaced"] & ~rows)

    evidence.edit_table(ladder, INVOCATIONS, alone)
    texts = [text for text in judge(ladder, "D").caveats if "wall clock" in text]
    assert all(clocks.LEAVES in text for text in texts)
    assert [clocks.ALONE in text for text in texts] == [False, bool(said)]


def test_the_page_has_every_number(ladder):
    report = judge(ladder, "D")
    heads, *lines = tables_clocks.CLOCKS.read(Evidence(ladder), report)
    assert len({len(line) for line in (heads, *lines)}) == 1
    whole = {line[0]: line[6:] for line in lines if line[1] == "all of these"}
    assert whole == {"diffusion": ("differ", "48"), "flow": ("agree", "48")}
    missed = next(line for line in lines if line[:2] == ("diffusion", "missed deadlines"))
    assert missed[2:4] == ("50 %", "0 %") and missed[5:7] == ("+10 points", "outside")
    ticks = tables_clocks.CLOCKS.folded[0].read(Evidence(ladder), report)
    assert ticks[1] == ("diffusion", str(48 * 16), "2", "4")


def test_an_age_that_is_no_number_is_said_and_stops_no_gate(ladder):
    evidence.edit_table(ladder, AGES, lambda f: on_the_wall(f, "age_s", float("nan"), share=0.1))
    found = of(ladder)
    assert found.answer == UNSEEN and "age_s" in found.why
    judge(ladder, "D")
