"""What an entry names and the task does not have is refused before anything runs."""

import pytest

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.mapped import require_mapped
from genpolicy.errors import ContractError

JOINTS = {
    "motion": "absolute", "joints": {"columns": [0, 1, 2, 3, 4, 5], "unit": "rad"},
    "gripper": {"column": 7, "open": 1.0, "open_m": 1.0},
}  # fmt: skip


@pytest.mark.parametrize(("changes", "told"), [
    ({"action": JOINTS}, "6 joints, expected 7"),
    ({"observation": {"image": {"channels": ["camera"]}}}, "'camera', expected a channel"),
])  # fmt: skip
def test_other_joints_or_channels_than_the_task_s(entry_of, task, tmp_path, changes, told):
    def policy(**fields):
        return BroughtPolicy("planted", tmp_path / "p.yaml", entry_of(**fields), "c" * 64, 0)

    seven = {**JOINTS, "joints": {"columns": list(range(7)), "unit": "deg"}}
    require_mapped([policy(), policy(action=seven)], task)
    with pytest.raises(ContractError, match=told):
        require_mapped([policy(), policy(**changes)], task)
