"""Mutants: with one row taken from the table of checks, the independent checker must say so.

Each scenario is played twice: with the whole table, and then the checker must find nothing; with
the tuple minus one row in executor, stub and supervisor alike, and then it must find something.
That is the evidence that the checker is awake, and that each check is needed. What executor and
stub both ask is played twice more, with one of them blind: the other alone must let no more
actions through, or the second look is none. The chunks are imitations, so both tables are without
`issued`, but where that row itself is taken away.
"""

import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from genpolicy.evidence.documents.shadow import EXECUTION, ExecutionMutant
from genpolicy.evidence.shadow import voiding
from genpolicy.evidence.shadow.on_the_way import ASIDE_M
from genpolicy.evidence.shadow.places import both_ask
from genpolicy.evidence.shadow.rig import IMITATED, ROWS, Rig, passing_verdict
from genpolicy.execution.checks import CHECKS, Check, Checks, without
from genpolicy.execution.journal import write_journal
from genpolicy.execution.moment import POLICY
from genpolicy.verification.checker import check_journal
from genpolicy.verification.report import Violation

Scenario = Callable[[Rig], None]
DECLARATION = "settings.checks"


def run_mutants() -> list[ExecutionMutant]:
    """Play every scenario with and without its check.

    Returns:
        One per row of `CHECKS`.
    """
    results = []
    for check in CHECKS:
        table = IMITATED if check in IMITATED else CHECKS
        unchanged = play(check.name, table)
        mutant = play(check.name, without(table, check.name))
        slipped = slipped_by(check, table)
        results.append(row_of(check.name, rules_of(mutant), rules_of(unchanged), slipped))
    return results


def row_of(
    check: str, found: Sequence[str], unchanged: Sequence[str], slipped: int = 0
) -> ExecutionMutant:
    """What a mutant showed: it is detected if it alone broke rules, and nothing slipped.

    Args:
        check: Its name.
        found: Rules that the mutant broke, each as often as it did.
        unchanged: The same of the unchanged executor.
        slipped: Actions that one of two who both ask let through.
    """
    return ExecutionMutant(
        check=check,
        layer=EXECUTION,
        detected=bool(found) and not unchanged and not slipped,
        violations=len(found),
        rules=sorted(set(found)),
        violations_unchanged=len(unchanged),
        slipped=slipped,
    )


def rules_of(violations: Iterable[Violation]) -> list[str]:
    """The rules of violations, in their order."""
    return [violation.rule for violation in violations]


def slipped_by(check: Check, table: Checks) -> int:
    """Actions that one of the two lets through where the other is blind to a check of both.

    Beyond those that pass both; 0 for a check that one of them asks alone.
    """
    if not both_ask(check.name):
        return 0
    blind = without(table, check.name)
    by_both = _played(check.name, table).stub.accepted
    alone = (
        _played(check.name, blind, stub_checks=table),
        _played(check.name, table, stub_checks=blind),
    )
    return sum(max(0, rig.stub.accepted - by_both) for rig in alone)


def _played(check: str, checks: Checks, *, stub_checks: Checks | None = None) -> Rig:
    rig = Rig(checks=checks, stub_checks=stub_checks, session=check)
    SCENARIOS[check](rig)
    if check != "end_of_episode":
        rig.executor.end_episode(rig.now_s)
    return rig


def play(check: str, checks: Checks) -> list[Violation]:
    """Violations that the checker finds in the scenario of `check`, declarations aside."""
    return violations_in(_played(check, checks))


def violations_in(rig: Rig) -> list[Violation]:
    """Violations that the checker finds in the journal of a rig, declarations aside."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "journal.mcap"
        write_journal(path, [rig.journal])
        report = check_journal(path)
    return [violation for violation in report.violations if violation.rule != DECLARATION]


def found_in(rig: Rig, aside: frozenset[str] = frozenset()) -> list[str]:
    """Rules that the checker finds broken in the journal of a rig, but for those put aside."""
    return [rule for rule in rules_of(violations_in(rig)) if rule not in aside]


def _begin(rig: Rig, **changes: Any) -> None:
    """A valid (or changed) chunk of which two actions are due."""
    rig.run(2, **changes)


def _then(event: Callable[[Rig], object]) -> Scenario:
    def scenario(rig: Rig) -> None:
        _begin(rig)
        event(rig)
        rig.tick(2)

    return scenario


def _bad(**changes: Any) -> Scenario:
    return lambda rig: _begin(rig, **changes)


def _begun_before(event: Callable[[Rig], object]) -> Scenario:
    """A new chunk after the event, made from an observation before it."""

    def scenario(rig: Rig) -> None:
        _begin(rig)
        event(rig)
        rig.run(2, condition_observation_event_time_s=0.0, predecessor_chunk_id="")

    return scenario


def _new_chunk_while_stopped(rig: Rig) -> None:
    _begin(rig)
    rig.supervisor.emergency_stop(rig.now_s)
    rig.run(2, predecessor_chunk_id="")


def _new_chunk_under_a_person(rig: Rig) -> None:
    _begin(rig)
    rig.executor.intervene(rig.now_s)
    rig.run(2, predecessor_chunk_id="")


def _new_chunk_in_another_mode(rig: Rig) -> None:
    _begin(rig)
    rig.executor.controller(rig.now_s, "joint_position")
    rig.run(2, predecessor_chunk_id="")


def _same_chunk_twice(rig: Rig) -> None:
    rig.observe()
    chunk = rig.chunk()
    rig.deliver(chunk)
    rig.tick(2)
    rig.deliver(chunk)
    rig.tick(2)


def _after_the_end(rig: Rig) -> None:
    rig.observe()
    rig.executor.end_episode(rig.now_s)
    rig.deliver(rig.chunk())
    rig.tick(1)


def _whole_chunk(rig: Rig) -> None:
    _begin(rig)
    rig.tick(9)


def _short_validity(rig: Rig) -> None:
    _begin(rig, valid_until_s=rig.now_s + 0.06)
    rig.tick(2)


def _starts_later(rig: Rig) -> None:
    _begin(rig, action_start_time_s=rig.now_s + 0.2)


def _older_behind_accepted(rig: Rig) -> None:
    rig.observe()
    rig.tick(2)
    rig.observe()
    rig.deliver(rig.chunk(verdict=passing_verdict(rows=(0, 1))))
    rig.tick(1)
    old = {"condition_observation_event_time_s": 0.0, "action_start_time_s": 0.0}
    verdict = passing_verdict(rows=(3, ROWS))  # the row that is due now
    rig.deliver(rig.chunk(**old, verdict=verdict, predecessor_chunk_id=""))
    rig.tick(1)


def _older_behind_queued(rig: Rig) -> None:
    rig.observe()
    rig.tick(2)
    rig.observe()
    rig.deliver(rig.chunk(action_start_time_s=rig.now_s + 0.2))
    old = {"condition_observation_event_time_s": 0.0, "action_start_time_s": rig.now_s + 0.3}
    rig.deliver(rig.chunk(**old, predecessor_chunk_id=""))
    rig.tick(2)


def _late_in_contact(rig: Rig) -> None:
    """It was checked for the row that is due now, one behind the last at which it may begin."""
    rig.phase = "insert"
    rig.observe()
    rig.advance(0.2)
    first = {"condition_observation_event_time_s": 0.0, "action_start_time_s": 0.0}
    rig.deliver(rig.chunk(**first, verdict=passing_verdict(rows=(4, ROWS))))
    rig.tick(2)


def _three_in_a_row(rig: Rig) -> None:
    """One chunk more than may wait, each of which begins behind the one before."""
    rig.observe()
    for place in range(1, rig.cell.execution.queue_capacity + 2):
        rig.deliver(rig.chunk(action_start_time_s=rig.now_s + 0.1 * place))
    rig.tick(1)


def _one_window_twice(rig: Rig) -> None:
    _begin(rig)
    rig.now_ns -= 2_000_000  # still in the window of the action accepted last
    rig.observe()
    rig.deliver(rig.chunk(action_start_time_s=0.05))
    rig.tick(1)


def _frozen_camera(rig: Rig) -> None:
    rig.observe()
    rig.advance(0.7)
    rig.deliver(rig.chunk(condition_observation_event_time_s=0.0))
    rig.tick(1)


def _newer_chunk(rig: Rig) -> None:
    _begin(rig)
    rig.observe()
    rig.deliver(rig.chunk())
    rig.tick(2)


def _a_row_left_out(rig: Rig) -> None:
    _begin(rig)
    rig.advance(0.05)
    rig.tick(1)


def _late_and_then(next_ms: int) -> Scenario:
    """A command 40 ms late in its window of 50, and a tick so many ms behind its begin."""

    def scenario(rig: Rig) -> None:
        rig.observe()
        rig.deliver(rig.chunk())
        rig.advance(0.04)
        rig.tick(1)
        rig.now_ns = next_ms * 1_000_000
        rig.tick(1)

    return scenario


def _a_body_moves(rig: Rig) -> None:
    """A chunk is checked with a post that is then seen elsewhere."""
    rig.see(post=0.5)
    _begin(rig)
    rig.see(post=0.5 + ASIDE_M + rig.cell.execution.maximum_scene_shift_m)
    rig.tick(2)


def _offered(*, sequence: int, altered: bool) -> Scenario:
    """The second row comes to the stub past the executor."""

    def scenario(rig: Rig) -> None:
        rig.observe()
        chunk = rig.chunk()
        rig.deliver(chunk)
        rig.tick(1)
        action = chunk.actions[1] + (1.0 if altered else 0.0)
        rig.stub.offer(
            cast(Any, chunk), action, row=1, source=POLICY, arrival=0, sequence=sequence,
            now_ns=rig.now_ns,
        )  # fmt: skip

    return scenario


SCENARIOS: dict[str, Scenario] = {
    "action_hash": _bad(actions_sha256="0" * 64),
    "after_calibration_mismatch": _begun_before(voiding.new_epoch),
    "after_collision_event": _then(voiding.collided),
    "after_force_event": _then(voiding.felt),
    "after_intervention": _begun_before(voiding.a_person_takes_over_and_hands_back),
    "after_observation_divergence": _then(voiding.diverged),
    "after_phase_transition": _begun_before(voiding.new_phase),
    "after_reset": _begun_before(voiding.reset),
    "after_stop": _begun_before(voiding.stop_and_reset),
    "behind_accepted": _older_behind_accepted,
    "behind_queued": _older_behind_queued,
    "calibration_mismatch": _bad(calibration_epoch="epoch-2"),
    "checked_rows": _bad(verdict=passing_verdict(rows=(0, 1))),
    "checkpoint_mismatch": _bad(policy_checkpoint_hash="0" * 64),
    "controller_mode": _new_chunk_in_another_mode,
    "commander": _then(lambda rig: rig.executor.begin_fallback(rig.now_s)),
    "duplicate": _same_chunk_twice,
    "divergence": _then(voiding.diverged),
    "early": _starts_later,
    "end_of_episode": _after_the_end,
    "execution_horizon": _whole_chunk,
    "expired": _short_validity,
    "future_observation": _bad(condition_observation_event_time_s=0.04),
    "infeasible": _bad(verdict=passing_verdict(failed=2)),
    "intervention": _new_chunk_under_a_person,
    "late_chunk": _late_in_contact,
    "out_of_order": _one_window_twice,
    "pace": _late_and_then(50),
    "period": _bad(action_period_s=0.1),
    "issued": _bad(verdict=replace(passing_verdict(), q_rad=cast(Any, None))),
    "phase_transition": _bad(task_phase="insert"),
    "predecessor": _bad(predecessor_chunk_id="never seen"),
    "scene": _a_body_moves,
    "same_action": _offered(sequence=2, altered=True),
    "queue_overflow": _three_in_a_row,
    "sampler_mismatch": _bad(sampler_config_hash="0" * 64),
    "continuity": _a_row_left_out,
    "sequence": _offered(sequence=1, altered=False),
    "session_epoch": _bad(session_epoch=7),
    "stale_observation": _frozen_camera,
    "stopped": _new_chunk_while_stopped,
    "superseded": _newer_chunk,
    "watchdog": _then(lambda rig: rig.advance(0.3)),
    "window": _late_and_then(100),
}
