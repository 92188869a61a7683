"""Checks of the six layers, each left out once: does its corruption show that?

A chunk that the missing check let through is executed, and the independent checker, which moves
the arm by its own geometry, must find its own rule broken in the journal: a proof of the motion
that proves nothing would otherwise be seen by nobody.
"""

from collections.abc import Sequence

from genpolicy.evidence.documents.shadow import LayerMutant
from genpolicy.evidence.shadow.case import Case, decide
from genpolicy.evidence.shadow.corruption import CORRUPTIONS, Corruption
from genpolicy.evidence.shadow.observations import Observation
from genpolicy.evidence.shadow.session import Judged, play
from genpolicy.evidence.shadow.shadow import Shadow, admit, case_of
from genpolicy.execution.checks import without
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker, Rejected
from genpolicy.feasibility.checks import CHECKS, Check
from genpolicy.feasibility.figures import expected_motion
from genpolicy.verification.checker import check_messages

RULES = {
    "gripper_range": "P6.gripper",
    "projection_too_large": "P6.projection",
    "workspace": "P6.workspace",
    "unreachable": "P6.pose",
    "start_pose": "P6.commands",
    "joint_position": "P6.joint_limit",
    "scene_collision": "P6.collision",
    "self_collision": "P6.collision",
    "joint_velocity": "P6.joint_speed",
    "joint_acceleration": "P6.joint_acceleration",
    "joint_jerk": "P6.joint_jerk",
    "joint_torque": "P6.torque",
    "payload_torque": "P6.payload",
    "contact_surface": "P6.surface",
    "contact_force": "P6.force",
    "measured_velocity": "P6.measured_speed",
    "measured_acceleration": "P6.measured_acceleration",
    "state_age": "P6.state_age",
    "tcp_speed": "P6.tcp_speed",
    "tcp_turn": "P6.tcp_turn",
    "approach_direction": "P6.approach",
    "contact_speed": "P6.contact_speed",
    "gripper_opening": "P6.release",
    "singular": "P6.singular",
    "branch_jump": "P6.branch",
    "swept_collision": "P6.sweep",
    "measured_collision": "P6.measured_sweep",
}
"""Which rule of the independent checker stands behind a check of a layer, where one does."""
BESIDE = {"start_pose": "P5.joints"}
"""A second one, where what a check asks once is asked of commanded and measured joints apart."""

Broken = tuple[Observation, Case]


def missing_checks_evidence(
    shadow: Shadow, observations: Sequence[Observation], *, checks: tuple[Check, ...] = CHECKS
) -> list[LayerMutant]:
    """For each check: is its fixture refused with it, for its reason, and admitted without it?

    Args:
        shadow: The shadow test, with all checks.
        observations: Held-out moments; what the operator did is the good chunk.
        checks: The table that a mutant is made of; another one is for the tests.

    Returns:
        Rows of `mutants.json`, one per fixture of a check.
    """
    good = [
        (item, case)
        for number, item in enumerate(observations)
        for case in [case_of(shadow, item, item.demonstrated, number=number)]
        if isinstance(admit(shadow, case), Admitted)
    ]
    return [
        _row(shadow, corruption, good, checks) for corruption in CORRUPTIONS if corruption.check
    ]


def _row(
    shadow: Shadow, corruption: Corruption, good: Sequence[Broken], checks: tuple[Check, ...]
) -> LayerMutant:
    reason = corruption.applicable(shadow.checker.cell, shadow.task.obstacles)
    tried = noticed = 0
    if not reason:
        broken = [(item, corruption.apply(case, shadow.checker)) for item, case in good]
        cases = [(item, case) for item, case in broken if case is not None]
        tried = len(cases)
        noticed = _noticed(shadow, corruption, cases, checks)
    return LayerMutant(
        check=corruption.check,
        layer=corruption.layer,
        fixture=corruption.name,
        behind=list(corruption.behind),
        detected=noticed > 0,
        tried=tried,
        violations=noticed,
        not_applicable=reason,
    )


def _noticed(
    shadow: Shadow, corruption: Corruption, cases: Sequence[Broken], checks: tuple[Check, ...]
) -> int:
    """How many cases the check refuses by its name, and nobody but the checker without it."""
    cell, names = shadow.checker.cell, {check.name for check in checks}
    if corruption.check not in names:
        return 0  # a row that is gone refuses nothing, by whatever name
    whole = without(checks, *names.intersection(corruption.behind))
    rest = without(whole, corruption.check)
    seeing, blind = (FeasibilityChecker(cell, checks=table) for table in (whole, rest))
    found = 0
    for item, case in cases:
        refused, passed = decide(seeing, case), decide(blind, case)
        named = isinstance(refused, Rejected) and refused.reason == corruption.check
        if named and isinstance(passed, Admitted):
            found += _is_proved(shadow, corruption, item, (case, passed))
    return found


def _is_proved(shadow: Shadow, corruption: Corruption, item: Observation, judged: Judged) -> bool:
    """Whether the independent checker objects to the executed chunk, by the check's own rules."""
    rule = RULES.get(corruption.check)
    if rule is None:
        return True
    journal = play(shadow.cell, item, [judged], fixture=corruption.name, number=0).journal
    told = (
        (e.kind, {"session": e.session, "n": e.n, "t": e.t, **e.payload})
        for e in journal.events()
    )  # fmt: skip
    report = check_messages(told, None, expected_motion(shadow.checker.cell))
    asked = {rule, BESIDE.get(corruption.check, rule)}
    return asked <= {violation.rule for violation in report.violations}
