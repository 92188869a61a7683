"""Mutants of clauses: each fact that a row asks about, left out of it once (`clauses`).

With the whole table the scenario must be clean; with the clause gone from executor and stub alike
the independent checker must find what went through. Of some clauses nothing goes through: they
refuse a chunk when it comes that others would refuse later, or say why rows are lost. What is
found of those is that the journal does not say it (`Trial.says`).
"""

from genpolicy.evidence.documents.shadow import ExecutionMutant
from genpolicy.evidence.shadow.clause_scenarios import TRIALS, Trial
from genpolicy.evidence.shadow.clauses import CLAUSES, Told
from genpolicy.evidence.shadow.mutants import found_in, row_of
from genpolicy.evidence.shadow.place_mutants import UNTOLD
from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.checks import CHECKS, Check, Checks, without


def clause_mutants(checks: Checks = CHECKS) -> list[ExecutionMutant]:
    """Play the scenario of every clause with the table, and with one that lacks the clause.

    Args:
        checks: The table under test; another one is for the tests.

    Returns:
        One row per clause.
    """
    return [clause_mutant(checks, name) for name in CLAUSES]


def clause_mutant(checks: Checks, name: str) -> ExecutionMutant:
    """The same of one clause."""
    trial = TRIALS[name]
    whole = without(checks, "issued", *trial.behind)
    unchanged = _found(name, trial, whole)
    found = _found(name, trial, lacking(whole, name))
    return row_of(name, found, unchanged)


def lacking(table: Checks, name: str) -> Checks:
    """The table, a row of which is told what it likes to hear of one fact."""
    row, told = name.partition(":")[0], CLAUSES[name]
    return tuple(_deaf(check, told) if check.name == row else check for check in table)


def _deaf(check: Check, told: Told) -> Check:
    return check._replace(holds=lambda m: check.holds(told(m)))


def _found(name: str, trial: Trial, table: Checks) -> list[str]:
    """Rules that are broken, and that what must be said is not."""
    rig = Rig(checks=table, session=name, **trial.changes)
    trial.scenario(rig)
    rig.executor.end_episode(rig.now_s)
    unsaid = trial.says is not None and not trial.says(rig)
    return found_in(rig) + [UNTOLD] * unsaid
