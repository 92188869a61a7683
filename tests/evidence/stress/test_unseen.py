"""A comparison that begins where a demonstration does is refused, and says which."""

import json

import pytest

from genpolicy.data.rows import EpisodeRow
from genpolicy.errors import ContractError
from genpolicy.evidence.stress.matched import matched_starts
from genpolicy.evidence.stress.unseen import EPISODES, require_unseen
from genpolicy.integrity.rows import write_rows
from genpolicy.tasks.api import load_task

TASK = load_task("tabletop_insertion")
ROOT_SEED = 13
STARTS = tuple(s.to_json() for s in matched_starts(TASK, root_seed=ROOT_SEED, count=20))


def dataset(folder, begun, split="train"):
    """A dataset whose episodes begin in these starts."""
    rows = [
        EpisodeRow(
            episode_uuid=f"episode {number}", split=split, task=TASK.name, object="", operator="",
            calibration_epoch="epoch_1", outcome="success", is_recovery=False,
            is_intervention=False, source_file="", source_sha256="", content_sha256="", rows=1,
            lead_rows=0, recorded_at_s=0.0, lead_action=(), scene_start=start,
        )
        for number, start in enumerate(begun)
    ]  # fmt: skip
    write_rows(folder / EPISODES, EpisodeRow, rows)
    return folder


def recorded(count, root_seed=ROOT_SEED):
    return [spec.start.to_json() for spec in TASK.episode_specs(root_seed, count)]


def test_where_the_ladder_records_nobody_begins_to_be_judged(tmp_path):
    require_unseen(dataset(tmp_path, recorded(256)), STARTS)


@pytest.mark.parametrize("split", ["train", "validation", "test"])
def test_tuned_on_the_starts_that_judge(tmp_path, split):
    """Demonstrations of three starts of the comparison, among others: each split is looked at."""
    begun = [*recorded(6), *STARTS[7:10], *recorded(4, root_seed=7)]
    told = r"3 of 20 starts of the comparison among its episodes: start 7 is where episode 6 begins"
    with pytest.raises(ContractError, match=told) as refused:
        require_unseen(dataset(tmp_path, begun, split), STARTS)
    assert EPISODES in str(refused.value) and "another `seed`" in str(refused.value)


def test_a_start_is_its_numbers_and_not_how_they_are_written(tmp_path):
    values = json.loads(STARTS[19])
    other = json.dumps(dict(reversed(values.items())), indent=1)
    assert other != STARTS[19]
    with pytest.raises(ContractError, match="1 of 20 starts"):
        require_unseen(dataset(tmp_path, [other]), STARTS)


def test_a_start_that_nobody_recorded_is_none(tmp_path):
    require_unseen(dataset(tmp_path, ["", *recorded(2), ""]), STARTS)


def test_another_start_by_a_hair_is_another(tmp_path):
    """What is left: whoever moves a start by nothing that matters is not seen."""
    values = json.loads(STARTS[0])
    values["tcp_x_m"] += 1e-12
    require_unseen(dataset(tmp_path, [json.dumps(values)]), STARTS)
