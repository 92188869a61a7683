"""Mutants: with one check disabled, a bad action passes, and the checker must say so.

Each scenario is played twice: with every check, and then the checker must find nothing; with one
check switched off in executor, stub and supervisor alike, and then it must find something. That is
the evidence that the checker is awake, and that each check is needed.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from genpolicy.evidence.shadow.rig import Rig, passing_verdict
from genpolicy.execution.journal import write_journal
from genpolicy.execution.settings import CHECKS
from genpolicy.verification.checker import check_journal
from genpolicy.verification.report import Violation

Scenario = Callable[[Rig], None]
DECLARATION = "settings.disabled"


def run_mutants() -> list[dict[str, Any]]:
    """Play every scenario with and without its check.

    Returns:
        One entry per name in `CHECKS`: `check`, `detected` (the mutant was found and the unchanged
        executor was clean), `violations` (count of the mutant's), `rules` (which broke), and
        `violations_unchanged` (of the unchanged executor).
    """
    results = []
    for check in CHECKS:
        unchanged = play(check, disabled=frozenset())
        mutant = play(check, disabled=frozenset({check}))
        results.append({
            "check": check,
            "detected": bool(mutant) and not unchanged,
            "violations": len(mutant),
            "rules": sorted({violation.rule for violation in mutant}),
            "violations_unchanged": len(unchanged),
        })  # fmt: skip
    return results


def play(check: str, *, disabled: frozenset[str]) -> list[Violation]:
    """Violations that the checker finds in the scenario of `check`, declarations aside."""
    rig = Rig(disabled=disabled, session=check)
    SCENARIOS[check](rig)
    if check != "end_of_episode":
        rig.executor.end_episode(rig.now_s)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "journal.mcap"
        write_journal(path, [rig.journal])
        report = check_journal(path)
    return [violation for violation in report.violations if violation.rule != DECLARATION]


def _begin(rig: Rig, **changes: Any) -> None:
    """A valid (or changed) chunk of which two actions are due."""
    rig.observe()
    rig.deliver(rig.chunk(**changes))
    rig.tick(2)


def _then(event: Callable[[Rig], object]) -> Scenario:
    def scenario(rig: Rig) -> None:
        _begin(rig)
        event(rig)
        rig.tick(2)

    return scenario


def _bad(**changes: Any) -> Scenario:
    return lambda rig: _begin(rig, **changes)


def _new_epoch(rig: Rig) -> None:
    rig.epoch = "epoch-2"
    rig.observe()


def _new_phase(rig: Rig) -> None:
    rig.phase = "insert"
    rig.observe()


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


def _older_behind_newer(rig: Rig) -> None:
    _begin(rig)
    rig.observe()
    rig.deliver(rig.chunk())
    rig.tick(1)
    old = {"condition_observation_event_time_s": 0.0, "action_start_time_s": 0.0}
    rig.deliver(rig.chunk(**old, predecessor_chunk_id=""))
    rig.tick(1)


def _after_a_reset(rig: Rig) -> None:
    _begin(rig)
    rig.executor.reset(rig.now_s)
    rig.observe()
    rig.tick(2)


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


def _paused(rig: Rig) -> None:
    rig.advance(0.3)


def _diverged(rig: Rig) -> None:
    rig.observe(divergence_m=0.2)


SCENARIOS: dict[str, Scenario] = {
    "action_hash": _bad(actions_sha256="0" * 64),
    "calibration_mismatch": _then(_new_epoch),
    "checked_rows": _bad(verdict=passing_verdict(rows=(0, 1))),
    "checkpoint_mismatch": _bad(policy_checkpoint_hash="0" * 64),
    "collision_event": _then(lambda rig: rig.executor.collision_event(rig.now_s)),
    "duplicate": _same_chunk_twice,
    "end_of_episode": _after_the_end,
    "execution_horizon": _whole_chunk,
    "expired": _short_validity,
    "force_event": _then(lambda rig: rig.executor.force_event(rig.now_s)),
    "future_observation": _bad(condition_observation_event_time_s=0.04),
    "infeasible": _bad(verdict=passing_verdict(failed=2)),
    "intervention": _then(lambda rig: rig.executor.intervene(rig.now_s)),
    "observation_divergence": _then(_diverged),
    "out_of_order": _older_behind_newer,
    "phase_transition": _then(_new_phase),
    "predecessor": _bad(predecessor_chunk_id="never seen"),
    "sampler_mismatch": _bad(sampler_config_hash="0" * 64),
    "session_epoch": _after_a_reset,
    "stale_observation": _frozen_camera,
    "stopped": _then(lambda rig: rig.supervisor.emergency_stop(rig.now_s)),
    "superseded": _newer_chunk,
    "watchdog": _then(_paused),
    "window": _then(_paused),
}
