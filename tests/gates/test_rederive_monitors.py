"""What Gate D prints of the monitors follows from scores and journals, or is refused."""

import shutil
from dataclasses import replace

import pytest
from _probed import LIMIT_S, ROOT_SEED, SECTION, make_bench, write_probed

from gates import rederive as module
from gates import rederive_monitors as own
from gates.rederive_monitors import rederive_monitors
from gates.stress.monitors import ALARMS, MONITORS, THRESHOLDS
from genpolicy.errors import RefusedError
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.rows.monitors import (
    MonitorAlarmRow,
    MonitorScoreRow,
    MonitorThresholdRow,
)
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.integrity.rows import read_rows, write_rows

SCORES, ROLLOUTS = f"{MONITORS}/scores.parquet", f"{MONITORS}/rollouts.parquet"


@pytest.fixture(scope="module")
def params(kit):
    stress = {**kit.PARAMS["stress"], "episode_limit_s": LIMIT_S}
    changes = {"monitors": SECTION, "seed": ROOT_SEED, "stress": stress}
    return {**kit.PARAMS, **changes, "task": {"name": "tabletop_insertion"}}


@pytest.fixture(scope="module")
def written(fleet, dataset, kit, task, tmp_path_factory):
    root = tmp_path_factory.mktemp("ladder")
    bench = make_bench(fleet, dataset, kit, tmp_path_factory.mktemp("made"))
    (root / MONITORS).mkdir(parents=True)
    write_probed(root / MONITORS, bench, task)
    return root


@pytest.fixture
def root(written, tmp_path):
    return shutil.copytree(written, tmp_path / "copy")


def change(root, path, row, how):
    """Write a table again with its first row changed."""
    first, *others = read_rows(root / path, row)
    write_rows(root / path, row, [*how(first), *others])


def refused(root, params, match):
    with pytest.raises(RefusedError, match=match):
        rederive_monitors(root, params, module._held_to(params))


def test_what_the_stage_wrote_is_proved(root, params):
    rederive_monitors(root, params, module._held_to(params))


def test_the_commands_of_every_journal_are_played_again(root, params, monkeypatch):
    asked = []
    monkeypatch.setattr(own, "rederive_probed_outcomes", lambda *given: asked.append(given))
    rederive_monitors(root, params, module._held_to(params))
    assert asked == [(params, sorted((root / MONITORS / "journals").glob("*.mcap")))]


def test_nobody_comes_to_a_rollout_of_the_monitors(root, params, monkeypatch):
    found = lambda path, plan: iter([f"{path.name} had {plan}"])  # noqa: E731
    monkeypatch.setattr(own, "attended_otherwise", found)
    refused(root, params, r"\.mcap had None, required nobody who comes")


def test_nothing_written_is_nothing_to_prove(tmp_path, params):
    rederive_monitors(tmp_path, params, module._held_to(params))


@pytest.mark.parametrize(
    ("path", "row", "how", "match"),
    [
        (THRESHOLDS, MonitorThresholdRow, lambda r: [replace(r, threshold=0.1)], "threshold"),
        (THRESHOLDS, MonitorThresholdRow, lambda r: [replace(r, episodes=40)], "episodes"),
        (THRESHOLDS, MonitorThresholdRow, lambda r: [], "only in scores.parquet"),
        (ALARMS, MonitorAlarmRow, lambda r: [replace(r, alarm=not r.alarm)], "alarm"),
        (ALARMS, MonitorAlarmRow, lambda r: [replace(r, success=True)], "success"),
        (ALARMS, MonitorAlarmRow, lambda r: [], "only in scores.parquet"),
        (SCORES, MonitorScoreRow, lambda r: [replace(r, phase="retreat")], "alarm"),
        # The first sets thresholds: one success more or less is an episode more or less.
        (ROLLOUTS, RolloutRow, lambda r: [replace(r, success=not r.success)], "episodes"),
        (ROLLOUTS, RolloutRow, lambda r: [], "only in a journal"),
    ],
)
def test_a_changed_row_is_refused(root, params, path, row, how, match):
    if path == SCORES:  # of an episode that is judged; the first set thresholds
        rows = read_rows(root / path, row)
        place = next(n for n, one in enumerate(rows) if one.condition == "judged")
        write_rows(root / path, row, [*rows[:place], *how(rows[place]), *rows[place + 1 :]])
    else:
        change(root, path, row, how)
    refused(root, params, match)


def test_another_success_of_a_judged_rollout_is_refused(root, params):
    rows = read_rows(root / ROLLOUTS, RolloutRow)
    place = next(n for n, one in enumerate(rows) if one.perturbation == "judged")
    other = replace(rows[place], success=not rows[place].success)
    write_rows(root / ROLLOUTS, RolloutRow, [*rows[:place], other, *rows[place + 1 :]])
    refused(root, params, "success")


def test_other_starts_than_planned_are_refused(root, params):
    refused(root, {**params, "seed": ROOT_SEED + 1}, "as planned")


def test_another_finding_of_the_checker_is_refused(root, params):
    folder = root / MONITORS
    stated = CHECKER.read(folder)
    (folder / CHECKER.file).unlink()
    CHECKER.write(folder, replace(stated, checked_actions=1))
    refused(root, params, "checked_actions")


def test_another_alpha_than_was_asked_is_refused(root, params):
    section = {**SECTION, "alpha": 0.3}
    refused(root, {**params, "monitors": section}, "alpha|rank")
