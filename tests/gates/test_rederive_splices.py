"""Splices that a table states against those that journals give."""

import pytest

from gates.rederive_splices import TABLE, rederive_splices
from gates.stress.rollouts import STRESS
from genpolicy.errors import RefusedError
from genpolicy.evidence.rows.stress import SpliceRow
from genpolicy.integrity.rows import write_rows

PARAMS = {"policy": {"seeds": [3]}}
ROW = {
    "method": "flow", "perturbation": "nominal", "start": 1, "rule": "replace", "invocation": 2,
    "parents": 0, "raw_jump_m": 0.02, "raw_jerk_m_s3": 12.0, "jump_m": 0.01, "jerk_m_s3": None,
}  # fmt: skip


@pytest.fixture
def stand(tmp_path):
    """Ask of one derived row, with some columns of the stated one changed."""

    def ask(derived=(ROW,), *, seed=3, **changes):
        (tmp_path / STRESS).mkdir(parents=True, exist_ok=True)
        row = SpliceRow(**{**ROW, **changes}, seed=seed)
        write_rows(tmp_path / STRESS / TABLE, SpliceRow, [row])
        rederive_splices(tmp_path, PARAMS, derived)

    return ask


def test_true_ones_stand(stand):
    stand()


@pytest.mark.parametrize("changes", [{"jump_m": 0.01 + 5e-10}, {"raw_jerk_m_s3": 12.000_005}])
def test_rounding_stands(stand, changes):
    stand(**changes)


@pytest.mark.parametrize(
    ("column", "value"),
    [("rule", "bidirectional"), ("parents", 1), ("raw_jump_m", 0.020_001), ("jump_m", 0.009),
     ("raw_jerk_m_s3", 12.1), ("raw_jerk_m_s3", None), ("jerk_m_s3", 0.0), ("seed", 4)],
)  # fmt: skip
def test_a_forged_cell_is_refused_by_name(stand, column, value):
    with pytest.raises(RefusedError, match=f"splice flow/nominal/1/2: {column} is {value!r}"):
        stand(**{column: value})


def test_a_chunk_that_is_left_out_or_made_up_is_refused(stand):
    with pytest.raises(RefusedError, match="splice flow/nominal/1/2 is without a journal"):
        stand(())
    with pytest.raises(RefusedError, match="splice flow/nominal/1/5 is only in a journal"):
        stand((ROW, {**ROW, "invocation": 5}))
