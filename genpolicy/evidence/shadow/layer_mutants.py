"""Checks of the six layers, each left out once: does its corruption show that?"""

from collections.abc import Sequence

from genpolicy.evidence.documents.shadow import LayerMutant
from genpolicy.evidence.shadow.case import Case, decide
from genpolicy.evidence.shadow.corruption import CORRUPTIONS, Corruption
from genpolicy.evidence.shadow.observations import Observation
from genpolicy.evidence.shadow.shadow import Shadow, admit, case_of
from genpolicy.execution.checks import without
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker, Rejected
from genpolicy.feasibility.checks import CHECKS, Check


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
        case
        for number, item in enumerate(observations)
        for case in [case_of(shadow, item, item.demonstrated, number=number)]
        if isinstance(admit(shadow, case), Admitted)
    ]
    return [
        _row(shadow, corruption, good, checks) for corruption in CORRUPTIONS if corruption.check
    ]


def _row(
    shadow: Shadow, corruption: Corruption, good: Sequence[Case], checks: tuple[Check, ...]
) -> LayerMutant:
    reason = corruption.applicable(shadow.checker.cell, shadow.task.obstacles)
    tried = noticed = 0
    if not reason:
        broken = [corruption.apply(case, shadow.checker) for case in good]
        cases = [case for case in broken if case is not None]
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
    shadow: Shadow, corruption: Corruption, cases: Sequence[Case], checks: tuple[Check, ...]
) -> int:
    """How many cases the check refuses by its name and a checker without it admits."""
    cell, names = shadow.checker.cell, {check.name for check in checks}
    if corruption.check not in names:
        return 0  # a row that is gone refuses nothing, by whatever name
    whole = without(checks, *names.intersection(corruption.behind))
    rest = without(whole, corruption.check)
    seeing, blind = (FeasibilityChecker(cell, checks=table) for table in (whole, rest))
    found = 0
    for case in cases:
        refused = decide(seeing, case)
        named = isinstance(refused, Rejected) and refused.reason == corruption.check
        found += named and isinstance(decide(blind, case), Admitted)
    return found
