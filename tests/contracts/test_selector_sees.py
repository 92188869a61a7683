"""A selector that could see the future, the task or whoever judges is refused by its imports."""

import copy

import pytest
from importlinter.api import read_configuration
from importlinter.contracts.forbidden import ForbiddenContract

from tests.contracts.dependencies import ROOT, graph

NAME = "the selector sees its candidates: no future, no task, no evaluator"
SELECTOR = "genpolicy.candidates.selector"


@pytest.fixture(scope="module")
def contract():
    said = read_configuration(str(ROOT / "pyproject.toml"))
    (own,) = [entry for entry in said["contracts_options"] if entry["name"] == NAME]
    return ForbiddenContract(NAME, said["session_options"], own)


def kept(contract, *planted):
    seen = copy.deepcopy(graph())
    for importer, imported in planted:
        seen.add_import(importer=importer, imported=imported)
    return contract.check(seen, verbose=False).kept


def test_the_selectors_of_this_code_see_their_candidates(contract):
    assert kept(contract)
    assert {"genpolicy.candidates.joining", "genpolicy.candidates.votes", SELECTOR} == {
        str(module.expression) for module in contract.source_modules
    }


@pytest.mark.parametrize(
    "seen",
    [
        "genpolicy.data.dataset",  # what was recorded next
        "genpolicy.evidence.need.held_out",  # which modes there are
        "genpolicy.evidence.stress.state",  # where the simulation stands
        "genpolicy.feasibility.checker",  # what the layers will say
        "genpolicy.verification.report",  # the independent checker
        "genpolicy.tasks.api",  # the task, its success among it
        "gates.verdicts",  # who judges
    ],
)
def test_one_that_sees_more_breaks_the_contract(contract, seen):
    assert not kept(contract, (SELECTOR, seen))


def test_one_that_sees_it_through_another_breaks_it_too(contract):
    between = "genpolicy.candidates.conformance.recorded_starts"
    assert not kept(contract, ("genpolicy.candidates.votes", between))
