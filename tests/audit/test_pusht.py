"""PushT: real demonstrations without clock, operator, epoch or outcome.

No start is repeated, so few stand near each other. By what predicts the action more can be
compared: some episodes go either way about the block, in too few situations to say that it lasts.
"""

from pathlib import Path

import pytest

from gates.cause import CauseName, cause_of, default_limits
from genpolicy.audit.evidence import write_evidence
from genpolicy.audit.run import audit
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.view import from_dataset
from genpolicy.data.contract import SplitRule
from genpolicy.data.dataset import load_dataset
from genpolicy.data.formats.collect import import_source
from genpolicy.data.formats.zarr_buffer import PUSHT, open_source
from genpolicy.integrity.tables import read_table

BUFFER = Path(__file__).parents[3] / "shared/data/pusht_v7/pusht_cchi_v7_replay.zarr"
SETTINGS = AuditSettings(
    position_channel="agent_position_px", reference_channel=None,
    context_channels=["block_position_px", "block_angle"], ignored_channels=[],
    minimum_separation_m=30.0, metre=1000.0, radius=3.0, permutations=199, query_stride=4,
)  # fmt: skip

pytestmark = pytest.mark.skipif(not BUFFER.exists(), reason="the PushT replay buffer is not here")


def test_pusht_has_too_little_support_to_claim_modes(tmp_path):
    import_source(open_source(BUFFER), PUSHT, out=tmp_path / "dataset", split=SplitRule())
    data = from_dataset(
        load_dataset(tmp_path / "dataset"), contract=PUSHT.observation, settings=SETTINGS,
        period_s=0.1,
    )  # fmt: skip
    result = audit(data, SETTINGS, admissible=None, replay=None, root_seed=1)
    local, learned = result.sides
    assert local.analysed < 0.2 * local.queries
    assert learned.two_mode_episodes > 0.2 * learned.analysed_episodes
    assert learned.persistent < 30
    (clock,) = result.semantics.clocks
    assert 1.0 < clock.lag_rows < 4.0  # the agent trails its target by some tenths of a second
    assert abs(clock.offset_after_s) < 0.02
    folder = tmp_path / "evidence"
    folder.mkdir()
    write_evidence(result, folder, settings=SETTINGS)
    cause = cause_of(folder, default_limits())
    assert (cause.name, cause.kind) == (CauseName.INSUFFICIENT_SUPPORT, "persistence")
    recorded = {
        row["variable"]: row["recorded"]
        for row in read_table(folder / "strata.parquet").to_pylist()
    }
    for name in ("operator", "object", "calibration_epoch"):
        assert recorded.get(name) in (False, None)
    assert read_table(folder / "replay.parquet").num_rows == 0
