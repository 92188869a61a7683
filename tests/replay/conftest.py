"""A small shadow test of the default task as a ladder keeps it: journal, table, gallery, task."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from genpolicy.contract.action import GRIPPER
from genpolicy.documents.task import IDENTITY
from genpolicy.evidence.documents.gallery import GALLERY
from genpolicy.evidence.rows.shadow import CandidateRow
from genpolicy.evidence.shadow.gallery import gallery_of
from genpolicy.evidence.shadow.observations import held_out_observations
from genpolicy.evidence.shadow.shadow import Shadow, shadow_policy
from genpolicy.execution.cell import Cell
from genpolicy.execution.journal import write_journal
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.rows import write_rows
from genpolicy.replay.bodies import DrawnCell
from genpolicy.seeds import stream
from genpolicy.tasks.identity import task_identity

sys.path.insert(0, str(Path(__file__).parent))


class Answers:
    """What the operator did: with the hand too far open, into the table, with no number, as it was.

    The second one offends in the geometric layer, so that the row, the tool and what touches show.
    """

    method, checkpoint_hash, sampler_config_hash, stochastic = "flow", "w" * 64, "s" * 64, True
    prediction_horizon = 16

    def __init__(self, observations):
        self.chunks = {(o.episode_uuid, o.index): o.demonstrated for o in observations}

    def sample(self, seen, *, noise_names, candidates):
        good = np.stack([self.chunks[name[1:]] for name in noise_names])
        wide, low, none = good.copy(), good.copy(), good.copy()
        wide[:, 7:, GRIPPER] = 0.2
        low[:, :, 2] -= np.linspace(0, 0.12, low.shape[1])
        none[:, 3:, 0] = np.nan
        return SimpleNamespace(actions=np.stack([wide, low, none, good], axis=1), nfe=1)


@pytest.fixture(scope="session")
def cell(task):
    return DrawnCell.of(task)


@pytest.fixture(scope="session")
def ladder(tmp_path_factory, task, checker, kit, data):
    root = tmp_path_factory.mktemp("artifacts")
    shadow = Shadow(
        task=task, checker=checker, cell=Cell(kit.HORIZONS, kit.EXECUTION), late_rows=1, samples=4
    )
    few = held_out_observations(
        data, horizons=kit.HORIZONS, count=20, generator=stream(1, "shadow")
    )[:2]
    found = shadow_policy(shadow, Answers(few), few, seed=0)
    folder = root / "shadow"
    folder.mkdir()
    (root / "task").mkdir()
    write_journal(folder / "journal.mcap", found.sessions)
    write_rows(folder / "candidates.parquet", CandidateRow, found.candidates)
    GALLERY.write(folder, gallery_of(shadow, few, found.candidates))
    write_bytes(root / "task" / IDENTITY.file, canonical_json(task_identity(task.name)))
    return root


@pytest.fixture(scope="session")
def journal(ladder):
    return ladder / "shadow" / "journal.mcap"
