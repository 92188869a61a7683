"""The eleven groups: complete, or refused with all that is missing."""

import pytest

from gates.package.groups import GROUPS, PROBED, contents
from genpolicy.errors import BadInputError, IntegrityError
from genpolicy.integrity.tables import read_table, write_table


def test_there_are_the_chapters_eleven_in_its_order():
    assert [group.number for group in GROUPS] == list(range(1, 12))
    assert len({group.title for group in GROUPS}) == 11


def test_a_judged_candidate_has_all(whole):
    found = contents(whole, "flow", brought=False)
    assert set(found) == set(range(1, 12)) and all(found.values())


def test_everything_that_is_missing_is_named_at_once(whole):
    (whole / "limits.yaml").unlink()
    (whole / "artifacts/stress/journals/flow__nominal.mcap").unlink()
    with pytest.raises(BadInputError) as caught:
        contents(whole, "flow", brought=False)
    said = str(caught.value)
    assert "5 (horizons" in said and "limits.yaml" in said
    assert "10 (fallback" in said and "flow__*.mcap" in said
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(
    "table",
    [
        "artifacts/latency/latency.parquet",
        "artifacts/reload/samples.parquet",
        "artifacts/reload/variations.parquet",
        "artifacts/shadow/candidates.parquet",
        "artifacts/stress/rollouts.parquet",
    ],
)
def test_a_table_without_a_row_of_it_is_not_complete(whole, table):
    path = whole / table
    rows = read_table(path)
    write_table(path, rows.filter([name != "flow" for name in rows.column("method").to_pylist()]))
    with pytest.raises(BadInputError, match=f"nothing of it in {table}"):
        contents(whole, "flow", brought=False)


def test_whose_probes_were_not_run_says_so_and_is_complete(whole):
    """The stage writes its tables whether or not a probe is planned."""
    group = GROUPS[9]
    assert set(PROBED) <= set(contents(whole, "flow", brought=False)[10])
    assert group.lacks(whole, "flow") == ""
    path = whole / PROBED[0]
    rows = read_table(path)
    write_table(path, rows.filter([name != "flow" for name in rows.column("method").to_pylist()]))
    assert group.lacks(whole, "flow") == (
        "out-of-distribution probes: none was run of this candidate"
    )
    assert contents(whole, "flow", brought=False)[10]
    assert {other.lacks(whole, "flow") for other in GROUPS if other is not group} == {""}


def test_a_policy_that_was_brought_needs_its_entry_and_no_training(whole):
    with pytest.raises(BadInputError, match=r"nothing of it in artifacts/candidates"):
        contents(whole, "flow", brought=True)


def test_a_table_of_another_form_is_told(whole):
    path = whole / "artifacts/stress/rollouts.parquet"
    write_table(path, read_table(path).drop_columns(["method"]))
    with pytest.raises(IntegrityError, match="without the column `method`"):
        contents(whole, "flow", brought=False)


def test_nobody_has_a_bundle_who_is_in_no_table(whole):
    with pytest.raises(BadInputError, match="nothing of it in artifacts/reload/identity"):
        contents(whole, "nobody", brought=False)
