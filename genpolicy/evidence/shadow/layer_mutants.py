"""Checks of the six layers, each left out once: does its corruption show that?"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from genpolicy.evidence.shadow.corruption import CORRUPTIONS
from genpolicy.evidence.shadow.observations import Observation
from genpolicy.evidence.shadow.shadow import Shadow, admit, case_of
from genpolicy.feasibility.admission import Admitted, FeasibilityChecker, Rejected


def missing_checks_evidence(
    shadow: Shadow,
    observations: list[Observation],
    *,
    without: Mapping[tuple[str, ...], FeasibilityChecker],
) -> list[dict[str, Any]]:
    """For each check: is a corrupted demonstration refused with it, and admitted without it?

    Args:
        shadow: The shadow test, with all checks.
        observations: Held-out moments; what the operator did is the good chunk.
        without: A checker for each group of checks, made without them.

    Returns:
        Rows of `mutants.json`: check, layer, detected, and how many cases showed it.
    """
    rows = []
    for corruption in CORRUPTIONS:
        if not corruption.checks:
            continue
        mutant = replace(shadow, checker=without[corruption.checks])
        tried = noticed = 0
        for number, item in enumerate(observations):
            good = case_of(shadow, item, item.demonstrated, number=number)
            bad = corruption.apply(good, shadow.checker)
            if bad is None or not isinstance(admit(shadow, good), Admitted):
                continue
            tried += 1
            refused = isinstance(admit(shadow, bad), Rejected)
            noticed += refused and isinstance(admit(mutant, bad), Admitted)
        rows.append(
            {
                "check": "+".join(corruption.checks),
                "fixture": corruption.name,
                "layer": corruption.layer,
                "detected": noticed > 0,
                "violations": noticed,
                "tried": tried,
            }
        )
    return rows
