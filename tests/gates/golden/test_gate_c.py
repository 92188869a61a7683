"""The whole report of Gate C, of even and of uneven evidence, as it was read last."""

import evidence
from as_told import hold, told
from drawn import hold_pictures
from editing import cells

from gates.proof import judge

SHADOW = "shadow/"


def _uneven(frame):
    """Episodes of one or two observations, refusals in two layers, moves of either sign."""
    n = 4 * frame["observation"] + frame["candidate"] + 3 * (frame["method"] == "flow")
    held = frame["fixture"] == "held_out"
    two = frame["fixture"] == "two_modes"
    right, left = frame["mode"] == "right", frame["mode"] == "left"
    off = held & (n % 23 == 0) | two & (right & (n % 9 == 0) | left & (n % 31 == 0))
    unknown = held & (n % 53 == 1)
    sign = 1 - 2 * (n % 2)
    episode = frame["observation"].where(frame["observation"] < 76, 0)
    return frame.assign(
        situation=[f"e{e}:{o}" for e, o in zip(episode, frame["observation"], strict=True)],
        mode=frame["mode"].mask(two & (n % 29 == 0), "unassigned"),
        geometric=frame["geometric"].mask(off, False),
        outcome=frame["outcome"].mask(off, "failed").mask(unknown, "unknown"),
        first_reason=frame["first_reason"].mask(off, "scene_collision").mask(
            ~held & ~two & (frame["observation"] == 2) & (frame["fixture"] == "collision"), ""
        ),
        position_change_m=frame["position_change_m"].mask(held, sign * 0.0001 * (n % 37)),
        boundary_jerk_m_s3=frame["boundary_jerk_m_s3"].mask(held, sign * (50.0 + n % 41)),
    )  # fmt: skip


def _arrived(frame):
    """Of each fixture another number; of the incidents on the way none more."""
    place = {name: number for number, name in enumerate(evidence.PLAYED)}
    n = frame["fixture"].map(place).fillna(0).astype(int)
    flow = frame["method"] == "flow"
    return frame.assign(
        delivered=frame["delivered"] - 3 * n,
        arrivals=frame["arrivals"] + n,
        stale=(flow & (frame["fixture"] == "held_out")) * 1,
        invalid=(flow & (frame["fixture"] == "collision")) * 2,
    )


def _watchers(root):
    found = evidence.checked("journal.mcap", 1000)
    own = {key: value for key, value in evidence.VIOLATION.items() if key != "journal"}
    found["journals"]["journal.mcap"]["violations"] = [own, own]
    evidence.edit_document(root, "shadow/checker.json", lambda _: found)

    def mutants(rows):
        rows[0]["detected"] = False
        lacking = next(row for row in rows if row["check"] == "scene_collision")
        lacking.update(detected=False, tried=0, not_applicable="no post")

    evidence.edit_document(root, "shadow/mutants.json", mutants)


def test_gate_c_of_even_evidence_says_what_it_said(ladder):
    hold("gate_c", told(judge(ladder, "C")))


def _make_uneven(ladder):
    flow = lambda f: f["method"] == "flow"  # noqa: E731
    evidence.edit_table(ladder, SHADOW + "candidates.parquet", _uneven)
    evidence.edit_table(ladder, SHADOW + "stub.parquet", _arrived)
    evidence.edit_table(
        ladder, SHADOW + "counts.parquet",
        cells("executed", 81, where=lambda f: flow(f) & (f["fixture"] == "held_out")),
    )  # fmt: skip
    evidence.edit_table(
        ladder, SHADOW + "counts.parquet",
        cells("count", 11, where=lambda f: flow(f) & (f["fixture"] == "reset_on_the_way")),
    )  # fmt: skip
    _watchers(ladder)


def test_gate_c_of_uneven_evidence_says_what_it_said(ladder):
    _make_uneven(ladder)
    report = judge(ladder, "C")
    assert all(c.measured is not None for c in report.criteria)
    hold("gate_c_uneven", told(report))


def test_gate_c_of_uneven_evidence_draws_what_it_drew(ladder):
    _make_uneven(ladder)
    hold_pictures("gate_c_drawn", "C", ladder, judge(ladder, "C"))
