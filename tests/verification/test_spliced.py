"""How chunks begin, from events alone."""

import numpy as np
import pytest

from genpolicy.tasks.api import load_task
from genpolicy.verification.spliced import Spliced

PERIOD_S, HOME_RAD = 0.05, (0.0, -0.3, 0.0, -2.0, 0.0, 1.8, 0.7)


def text(values):
    return np.asarray(values, dtype="<f8").tobytes().hex()


def rows_at(x_m, first=0):
    """Rows of ten numbers that have only an x."""
    rows = np.zeros((first + len(x_m), 10))
    rows[first:, 0] = x_m
    return rows


def session(**labels):
    told = {"method": "flow", "perturbation": "nominal", "start": "1", **labels}
    return "session", {"session": "s", "labels": told, "period_ns": 50_000_000}


def begun(name):
    return "invocation", {"session": "s", "stage": "begin", "id": name, "detail": "0.1"}


def enqueue(name, rows, *, first=0, told=0.0, before=(), raw=None, motion=True, source="policy"):
    ground = {
        "joints": 7, "q_before_rad": text(before), "last_action": text(rows_at([told])[0]),
    }  # fmt: skip
    return "enqueue", {
        "session": "s", "source": source, "chunk_id": name, "rows": len(rows),
        "checked_rows": [first, len(rows)], "actions": text(rows),
        "raw": "" if raw is None else text(raw), "motion": ground if motion else None,
    }  # fmt: skip


@pytest.fixture(scope="module")
def scene():
    return load_task("tabletop_insertion").scene_path


def rows(scene, *events):
    spliced = Spliced(scene)
    for kind, message in events:
        spliced.read(kind, message)
    return spliced.rows


def test_a_jerk_needs_four_points_and_is_the_third_difference(scene):
    """0, 1, 3, 7 mm: steps 1, 2, 4; their steps 1, 2; theirs 1 mm over 0.05 s cubed: 8 m/s^3."""
    (row,) = rows(scene, session(), begun("a"), enqueue("a", rows_at([0.001, 0.003, 0.007, 9.0])))
    assert row == {
        "method": "flow", "perturbation": "nominal", "start": 1, "rule": "replace",
        "invocation": 0, "parents": 0, "raw_jump_m": pytest.approx(0.001),
        "raw_jerk_m_s3": pytest.approx(8.0), "jump_m": pytest.approx(0.001),
        "jerk_m_s3": pytest.approx(8.0),
    }  # fmt: skip
    (short,) = rows(scene, session(), begun("a"), enqueue("a", rows_at([0.001, 0.003])))
    assert short["jerk_m_s3"] is None and short["jump_m"] == pytest.approx(0.001)


def test_commands_before_are_where_the_arm_has_its_tool(scene):
    """Two equal ones before the last, which is there too: whatever follows begins from rest."""
    (still,) = rows(scene, session(), begun("a"), enqueue("a", rows_at([0.0]), before=HOME_RAD * 2))
    (near,) = rows(
        scene, session(), begun("a"),
        enqueue("a", rows_at([0.0]), before=(*HOME_RAD, *(HOME_RAD[:-1]), 0.9)),
    )  # fmt: skip
    # The last joint turns about the tool's own axis, so that the tool stays where it is.
    assert near["jerk_m_s3"] == pytest.approx(still["jerk_m_s3"], rel=1e-9) and still["jerk_m_s3"]
    (moved,) = rows(
        scene, session(), begun("a"),
        enqueue("a", rows_at([0.0]), before=(*HOME_RAD, 0.4, *HOME_RAD[1:])),
    )  # fmt: skip
    assert moved["jerk_m_s3"] != pytest.approx(still["jerk_m_s3"], rel=1e-3)
    (three,) = rows(
        scene,
        session(),
        begun("a"),
        enqueue("a", rows_at([0.0]), before=(0.4, *HOME_RAD[1:], *HOME_RAD * 2)),
    )
    assert three == still


def test_only_rows_that_are_due_count_and_raw_ones_apart(scene):
    actions, drawn = rows_at([0.001, 0.002, 0.003], first=2), rows_at([0.005, 0.0, 0.0], first=2)
    (row,) = rows(scene, session(), begun("a"), enqueue("a", actions, first=2, raw=drawn))
    assert row["jump_m"] == pytest.approx(0.001) and row["raw_jump_m"] == pytest.approx(0.005)
    assert row["jerk_m_s3"] == pytest.approx(0.0, abs=1e-9) and row["raw_jerk_m_s3"] > 1.0


def test_a_chunk_that_joins_others_is_known_by_its_invocation(scene):
    made = {
        "session": "s", "chunk_id": "b/blend", "invocation": "b", "parents": {"a": [0, 3], "x": []},
    }  # fmt: skip
    first, second = rows(
        scene, session(joining="ensemble_oldest"), begun("a"), begun("b"),
        enqueue("a", rows_at([0.0])), ("joined", made), enqueue("b/blend", rows_at([0.0])),
    )  # fmt: skip
    assert [first["invocation"], first["parents"]] == [0, 0]
    assert [second["invocation"], second["parents"]] == [1, 2]
    assert first["rule"] == second["rule"] == "ensemble_oldest"


def test_what_is_no_chunk_of_the_policy_or_was_held_against_nothing_has_no_row(scene):
    assert rows(
        scene, session(), begun("a"), enqueue("a", rows_at([0.0]), motion=False),
        enqueue("f", rows_at([0.0]), source="fallback"),
        ("invocation", {"session": "s", "stage": "end", "id": "a", "detail": ""}),
    ) == []  # fmt: skip


def test_sessions_of_another_journal_are_others(scene):
    spliced = Spliced(scene)
    for name in ("first", "second"):
        spliced.forget()
        for kind, message in (session(), begun(name), enqueue(name, rows_at([0.0]))):
            spliced.read(kind, message)
    assert [row["invocation"] for row in spliced.rows] == [0, 0]
