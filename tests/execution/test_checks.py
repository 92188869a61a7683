"""The table of checks: each question by itself, at and beside its limit; unknown never holds."""

from dataclasses import replace
from pathlib import Path

import pytest

from genpolicy.contract.chunk import ChunkMetadata, DiscardReason
from genpolicy.errors import ConfigError
from genpolicy.execution.checks import CHECKS, Place, at, refusal, without
from genpolicy.execution.moment import FALLBACK, Chunk, ExecutorMode, Moment, View
from genpolicy.execution.nanoseconds import ChunkTimes

MS = 1_000_000
UPRIGHT = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
METADATA = ChunkMetadata(
    chunk_id="a", condition_observation_event_time_s=0.1, policy_checkpoint_hash="w",
    sampler_config_hash="s", action_start_time_s=0.2, action_period_s=0.05, valid_until_s=0.6,
    task_phase="approach", calibration_epoch="e", predecessor_chunk_id="", session_epoch=1,
    method="bc", candidate_index=0,
)  # fmt: skip
CHUNK = Chunk(
    METADATA, ChunkTimes.of(METADATA), arrival=3, rows=16, checked_rows=(0, 16), passed=True,
    hashed=True, scene={"post": (0.5, *UPRIGHT)}, measured_ns=150 * MS,
)  # fmt: skip
VIEW = View(
    phase="approach", calibration_epoch="e", newest_observation_ns=150 * MS,
    maximum_age_ns=300 * MS, latest_first_row=15, checkpoint="w", sampler="s", fallback="f",
    session_epoch=1,
    execution_horizon=8, period_ns=50 * MS, controller="m", controller_mode="m",
    divergence_limit_m=0.05, scene={"post": (0.52, *UPRIGHT)}, scene_limit_m=0.02 + 1e-12,
)  # fmt: skip
GOOD = Moment(
    now_ns=310 * MS, view=VIEW, about=CHUNK, row=2, known=False, issued=True, same_action=True,
    sequence=5, last_sequence=4, last_due_ns=250 * MS, watchdog_ns=100 * MS,
    last_accept_ns=260 * MS, follows=True,
    accepted_condition_ns=100 * MS, accepted_start_ns=200 * MS, queued_condition_ns=100 * MS,
    queued_start_ns=200 * MS, newer_start_ns=350 * MS, waiting=1, capacity=2,
    divergence_m=0.05,
)  # fmt: skip


def chunk(**changes):
    return replace(GOOD, about=replace(CHUNK, **changes))


def metadata(**changes):
    made = replace(METADATA, **changes)
    return chunk(metadata=made, times=ChunkTimes.of(made))


def view(**changes):
    return replace(GOOD, view=replace(VIEW, **changes))


def voided(reason, arrivals=0):
    return replace(GOOD, view=VIEW.voided(reason, 100 * MS + 1, arrivals))


BAD = {
    "end_of_episode": view(mode=ExecutorMode.ENDED),
    "issued": replace(GOOD, issued=False),
    "duplicate": replace(GOOD, known=True),
    "infeasible": chunk(passed=False),
    "period": view(period_ns=50 * MS + 1),
    "action_hash": chunk(hashed=False),
    "same_action": replace(GOOD, same_action=False),
    "execution_horizon": view(execution_horizon=2),
    "checked_rows": chunk(checked_rows=(3, 16)),
    "intervention": view(mode=ExecutorMode.INTERVENTION),
    "stopped": view(stopped=True),
    "commander": view(mode=ExecutorMode.FALLBACK),
    "controller_mode": view(controller="other"),
    "session_epoch": metadata(session_epoch=0),
    "checkpoint_mismatch": view(checkpoint="other"),
    "sampler_mismatch": view(sampler="other"),
    "calibration_mismatch": view(calibration_epoch="other"),
    "phase_transition": view(phase="insert"),
    "future_observation": view(newest_observation_ns=100 * MS - 1),
    "stale_observation": view(maximum_age_ns=210 * MS - 1),
    "after_phase_transition": voided(DiscardReason.PHASE_TRANSITION),
    "after_calibration_mismatch": voided(DiscardReason.CALIBRATION_MISMATCH),
    "after_force_event": voided(DiscardReason.FORCE_EVENT),
    "after_collision_event": voided(DiscardReason.COLLISION_EVENT),
    "after_observation_divergence": voided(DiscardReason.OBSERVATION_DIVERGENCE),
    "after_intervention": voided(DiscardReason.INTERVENTION),
    "after_stop": voided(DiscardReason.STOPPED),
    "after_reset": voided(DiscardReason.RESET),
    "expired": metadata(valid_until_s=0.309),
    "early": replace(GOOD, now_ns=300 * MS - 1),
    "window": replace(GOOD, now_ns=350 * MS),
    "late_chunk": view(latest_first_row=None),
    "behind_accepted": replace(GOOD, accepted_condition_ns=100 * MS + 1),
    "behind_queued": replace(GOOD, queued_start_ns=200 * MS + 1),
    "predecessor": metadata(predecessor_chunk_id="ghost"),
    "queue_overflow": replace(GOOD, waiting=2),
    "superseded": replace(GOOD, newer_start_ns=300 * MS),
    "out_of_order": replace(GOOD, last_due_ns=300 * MS),
    "sequence": replace(GOOD, last_sequence=5),
    "continuity": replace(GOOD, follows=False),
    "pace": replace(GOOD, last_accept_ns=265 * MS + 1),
    "divergence": replace(GOOD, divergence_m=0.0501),
    "scene": view(scene={"post": (0.5201, *UPRIGHT)}),
    "watchdog": replace(GOOD, last_accept_ns=210 * MS - 1),
}


def failing(moment):
    return {check.name for check in CHECKS if not check.holds(moment)}


def test_every_row_is_tried_and_all_hold_in_a_good_moment():
    assert set(BAD) == {check.name for check in CHECKS}
    assert failing(GOOD) == set()
    assert all(refusal(CHECKS, place, GOOD) is None for place in Place)


@pytest.mark.parametrize("name", BAD)
def test_the_row_alone_refuses_its_fault_and_without_it_the_fault_passes(name):
    row = next(check for check in CHECKS if check.name == name)
    assert name in failing(BAD[name]) and row.places
    rest = tuple(check for check in CHECKS if check.name != name)
    for place in row.places:
        found = refusal(CHECKS, place, BAD[name])
        assert found is not None and name in failing(BAD[name])
        assert refusal((row,), place, BAD[name]) is row
        assert row not in at(rest, place)


def test_at_the_limit_it_holds():
    assert failing(view(maximum_age_ns=210 * MS)) == set()
    assert failing(metadata(valid_until_s=0.31)) == set()
    assert failing(view(newest_observation_ns=100 * MS)) == set()
    assert failing(replace(GOOD, now_ns=350 * MS - 1, newer_start_ns=None)) == set()
    assert failing(replace(GOOD, last_accept_ns=210 * MS)) == set()
    assert failing(replace(GOOD, last_accept_ns=265 * MS)) == set()  # nine tenths of a period


def test_what_is_unknown_does_not_hold():
    unknown = Moment(now_ns=310 * MS, about=Chunk(METADATA, CHUNK.times), row=2)
    assert failing(unknown) >= {
        "issued", "duplicate", "infeasible", "action_hash", "same_action", "execution_horizon",
        "checked_rows", "future_observation", "stale_observation", "sequence", "period",
        "continuity", "late_chunk", "scene",
    }  # fmt: skip


def test_age_and_validity_are_asked_for_the_first_use():
    late = replace(GOOD, first_use_ns=401 * MS)
    assert failing(late) == {"stale_observation"}
    assert failing(replace(GOOD, first_use_ns=601 * MS)) == {"stale_observation", "expired"}


@pytest.mark.parametrize(("checked", "first_use_ms", "row"), [
    (0, None, 0), (4, None, 4), (0, 200, 0), (0, 399, 3), (0, 400, 4), (5, 400, 5), (4, 150, 4),
])  # fmt: skip
def test_a_chunk_begins_with_its_first_checked_row_or_the_one_that_is_due(
    checked, first_use_ms, row
):
    late = next(check for check in CHECKS if check.name == "late_chunk")
    first_use_ns = None if first_use_ms is None else first_use_ms * MS
    moment = replace(chunk(checked_rows=(checked, 16)), first_use_ns=first_use_ns)
    for latest in range(16):
        allowed = replace(moment, view=replace(VIEW, latest_first_row=latest))
        assert late.holds(allowed) == (row <= latest)


def test_the_fallback_has_an_identity_of_its_own():
    fallback = replace(view(mode=ExecutorMode.FALLBACK), about=replace(CHUNK, source=FALLBACK))
    assert failing(fallback) == {"checkpoint_mismatch", "sampler_mismatch"}
    own = replace(METADATA, policy_checkpoint_hash="f", sampler_config_hash="f")
    assert failing(replace(fallback, about=replace(CHUNK, source=FALLBACK, metadata=own))) == set()


def test_a_voiding_event_covers_what_was_there_and_a_later_one_covers_an_earlier():
    was_there = replace(GOOD, view=VIEW.voided(DiscardReason.FORCE_EVENT, 0, arrivals=4))
    assert failing(was_there) == {"after_force_event"}
    arrived_later = replace(GOOD, view=VIEW.voided(DiscardReason.FORCE_EVENT, 0, arrivals=3))
    assert failing(arrived_later) == set()
    both = VIEW.voided(DiscardReason.RESET, 200 * MS).voided(DiscardReason.RESET, 50 * MS)
    assert failing(replace(GOOD, view=both)) == {"after_reset"}


def test_joints_from_before_an_event_are_void_under_whatever_image():
    """It was checked from where the arm stood before, though what it saw came after."""
    for reason in (DiscardReason.INTERVENTION, DiscardReason.STOPPED, DiscardReason.RESET):
        row = f"after_{reason}".replace("stopped", "stop")
        for measured_ns, found in ((80 * MS, set()), (80 * MS - 1, {row})):
            moment = replace(chunk(measured_ns=measured_ns), view=VIEW.voided(reason, 80 * MS))
            assert failing(moment) == found
    unknown = replace(CHUNK, measured_ns=Chunk(METADATA, CHUNK.times).measured_ns)
    never = replace(GOOD, about=unknown, view=VIEW.voided(DiscardReason.RESET, -(10**15)))
    assert failing(never) == {"after_reset"}


def test_who_has_no_name_commands_nothing():
    """Neither weights nor a sampler; two that are empty are not the same."""
    for name, field in (
        ("checkpoint", "policy_checkpoint_hash"),
        ("sampler", "sampler_config_hash"),
    ):
        nobody = replace(METADATA, **{field: ""})
        moment = replace(view(**{name: ""}), about=replace(CHUNK, metadata=nobody))
        assert failing(moment) == {f"{name}_mismatch"}


def test_a_mode_of_the_controller_that_nobody_stated_does_not_hold():
    for controller, declared in (("", ""), ("", "m"), ("m", "")):
        moment = view(controller=controller, controller_mode=declared)
        assert failing(moment) == {"controller_mode"}


def test_a_mutant_lacks_the_named_rows_alone_and_an_unknown_name_makes_none():
    left = [check.name for check in without(CHECKS, "pace", "issued")]
    assert left == [check.name for check in CHECKS if check.name not in ("pace", "issued")]
    with pytest.raises(ConfigError, match=r"\['no such row'\].*names out of"):
        without(CHECKS, "pace", "no such row")


POINTS = {
    "shadow": {Place.LAYER},
    "enqueue": {Place.DOOR, Place.ARRIVAL, Place.ROOM, Place.ROWS},
    "pop": {Place.QUEUE, Place.PAST, Place.DUE, Place.NEXT},
    "accept": {Place.STUB},
}
"""Where a chunk is asked whether it may move, by the places of the table."""
ELSEWHERE = {Place.OBSERVED, Place.SUPERVISOR}
"""Of an observation and of a silence: no chunk is asked."""
DOCUMENT = Path(__file__).parents[2] / "docs" / "gate-c.md"


def asked_at(check):
    return {point for point, places in POINTS.items() if places & check.places}


def told():
    """Rows of the document that are not asked everywhere: where they are, and why not elsewhere."""
    text = DOCUMENT.read_text()
    begin = text.index("| row | " + " | ".join(POINTS) + " | why not everywhere |")
    lines = text[begin : text.index("\n\n", begin)].splitlines()[2:]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {
        name.strip("`"): ({p for p, mark in zip(POINTS, marks, strict=True) if mark}, why)
        for name, *marks, why in cells
    }


def test_places_are_points_of_a_chunk_or_ask_of_none():
    assert set().union(*POINTS.values(), ELSEWHERE) == set(Place)
    assert all(check.places <= ELSEWHERE for check in CHECKS if not asked_at(check))


def test_the_freshness_of_a_chunk_is_asked_at_all_four_points():
    everywhere = [check.name for check in CHECKS if asked_at(check) == set(POINTS)]
    assert everywhere == [
        "session_epoch", "checkpoint_mismatch", "sampler_mismatch", "calibration_mismatch",
        "phase_transition", "future_observation", "stale_observation", "expired",
    ]  # fmt: skip
    assert ", ".join(f"`{name}`" for name in everywhere) in DOCUMENT.read_text()


def test_what_is_not_asked_everywhere_says_why():
    """The exceptions from one predicate at shadow, enqueue, every pop and accept; decision 348."""
    asked = {check.name: asked_at(check) for check in CHECKS}
    exceptions = {name: points for name, points in asked.items() if points != set(POINTS)}
    assert {name: points for name, (points, _) in told().items()} == exceptions
    assert list(told()) == list(exceptions)  # in the order in which they decide
    assert all(len(why.split()) >= 2 for _, why in told().values())
