"""The table of checks: complete, in order, and the only way to leave one out."""

from dataclasses import replace

import numpy as np
import pytest

from genpolicy.errors import ConfigError
from genpolicy.execution.checks import without
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.batch import Margins
from genpolicy.feasibility.checks import CHECKS
from genpolicy.feasibility.settings import LAYERS


def test_names_are_unique_and_layers_in_order():
    names = [check.name for check in CHECKS]
    assert len(set(names)) == len(names) == 40
    assert list(dict.fromkeys(check.layer for check in CHECKS)) == list(LAYERS)
    assert sorted(CHECKS, key=lambda check: LAYERS.index(check.layer)) == list(CHECKS)


def test_every_limit_has_a_size(cell):
    assert all(check.scale(cell) > 0 for check in CHECKS)


def test_a_mutant_is_the_table_minus_a_row():
    assert without(CHECKS) == CHECKS
    rest = without(CHECKS, "expired", "shape")
    assert [c.name for c in CHECKS if c not in rest] == ["shape", "expired"]
    with pytest.raises(ConfigError, match="no_such_check"):
        without(CHECKS, "no_such_check")
    with pytest.raises(ConfigError, match="expired"):
        without(rest, "expired")


@pytest.mark.parametrize(
    "table", [(), (CHECKS[0], CHECKS[0]), (replace(CHECKS[0], layer="seventh"),)]
)
def test_what_is_no_table_is_a_configuration_error(cell, table):
    with pytest.raises(ConfigError, match="the table of checks"):
        FeasibilityChecker(cell, checks=table)


def test_a_checker_cannot_be_told_to_leave_one_out(cell):
    checker = FeasibilityChecker(cell)
    assert checker.checks == CHECKS
    assert not [name for name in vars(checker) if "disabled" in name]
    with pytest.raises(TypeError):
        FeasibilityChecker(cell, disabled_checks=frozenset({"expired"}))


def refuse_all(batch, cell):
    return Margins({"never": np.full(len(batch), -1.0)})


def test_a_new_row_decides_like_any_other(cell, kit, checker):
    """A check of one's own: one row, and the verdict gives its name as the reason."""
    mine = replace(CHECKS[0], name="never", measure=refuse_all)
    verdict = kit.judge(
        FeasibilityChecker(cell, checks=(*CHECKS, mine)),
        kit.line(kit.START, kit.SIDE),
        kit.context(checker, kit.START),
    )
    assert (verdict.first_layer, verdict.first_reason) == ("representation", "never")
