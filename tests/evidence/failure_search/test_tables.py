"""Every rollout that was asked for is a row and a session, every failure a file that runs again."""

from dataclasses import replace

import pytest
from _searched import CONDITIONS, EVALUATIONS, write_searched

from genpolicy.errors import BadInputError
from genpolicy.evidence.documents.failures import FAILURE
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.failure_search.tables import (
    ROLLOUTS,
    SEARCHED_TABLE,
    run_again,
    search_of,
    write_searches,
)
from genpolicy.evidence.rows.failures import FAILURES, SearchedRow, failure_name
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.evidence.stress.matched import matched_starts
from genpolicy.execution.journal import read_journal
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.rows import read_rows


def contents(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture
def rows(written):
    return read_rows(written[0] / SEARCHED_TABLE, SearchedRow)


def test_all_that_was_asked_for_is_there_and_nothing_else(written, rows):
    folder, searches = written
    keys = [(row.method, row.of, row.start) for row in rows]
    assert keys == [("flow", name, n) for name in CONDITIONS for n in range(EVALUATIONS)]
    ran = read_rows(folder / ROLLOUTS, RolloutRow)
    assert [(r.perturbation, r.start, r.start_sha256, r.outcome) for r in ran] == [
        (r.perturbation, r.start, r.start_sha256, r.outcome) for r in rows
    ]
    for searching in searches:
        sessions = list(read_journal(searching.shard.journal))
        name = searching.condition.name
        assert sessions == [f"flow/{name}/{n}" for n in range(EVALUATIONS)]
    assert not CHECKER.read(folder).violations
    assert {row.severity for row in rows if row.of == "nominal"} == {None}
    assert all(0 < row.severity <= 0.08 for row in rows if row.of == "camera_delay")


def test_each_failure_has_a_file_and_no_success_has(written, rows):
    wanted = {failure_name(row) for row in rows if row.failed}
    assert wanted, "a flow that learned for a moment fails"
    assert {path.name for path in (written[0] / FAILURES).iterdir()} == wanted


def test_starts_are_of_no_stream_that_judges(bench, rows, task):
    judged = {s.to_json() for s in matched_starts(task, root_seed=5, count=200)}
    assert {row.scene_start for row in rows}.isdisjoint(judged)
    assert not {row.perturbation for row in rows} & set(CONDITIONS), "names of all other draws"


def test_the_same_again_gives_the_same_bytes_with_two_workers(written, bench, kit, tmp_path):
    write_searched(tmp_path / "again", bench, kit, workers=2)
    assert contents(tmp_path / "again") == contents(written[0])


def test_a_failure_runs_again_alone_to_the_last_event(written):
    folder, searches = written
    for path in sorted((folder / FAILURES).iterdir())[-2:]:
        failure = FAILURE.parse(read_json(path), where=path.name)
        searching = search_of(searches, failure)
        assert run_again(searching, failure) == failure
    other = replace(failure, number=failure.number + 1)
    assert run_again(searching, other).events_sha256 != failure.events_sha256


@pytest.mark.parametrize("change", [{"root_seed": 6}, {"checkpoint": "0" * 64}, {"method": "x"},
                                    {"perturbation": "camera_delay"}])  # fmt: skip
def test_a_failure_of_elsewhere_is_refused(written, change):
    folder, searches = written
    path = sorted((folder / FAILURES).iterdir())[0]
    failure = FAILURE.parse(read_json(path), where=path.name)
    with pytest.raises(BadInputError, match="of identity"):
        search_of(searches, replace(failure, **change))


def test_nobody_looking_writes_tables_without_a_row(tmp_path):
    write_searches(tmp_path, [], workers=1, scheduler="local")
    assert read_rows(tmp_path / SEARCHED_TABLE, SearchedRow) == []
    assert read_rows(tmp_path / ROLLOUTS, RolloutRow) == []
