"""What a journal says of a rollout: a stop is no recovery."""

import pytest

from genpolicy.evidence.shadow.rig import EXECUTION
from genpolicy.execution.journal import Journal, write_journal
from genpolicy.execution.recovery import Recovery
from genpolicy.verification.rollouts import derived_with_recoveries


@pytest.mark.parametrize("stopped", [False, True])
@pytest.mark.parametrize("begun", [False, True])
def test_a_recovery_was_attempted_where_one_began_and_not_where_it_only_stopped(
    tmp_path, begun, stopped
):
    journal = Journal("rollout")
    recovery = Recovery(EXECUTION, journal)
    journal.add("force", 1, {"force_n": 1.0})
    if begun:
        recovery.trigger(1.0, "approach", "rejected")
    if stopped:
        recovery.stop(2.0, "force")
    write_journal(tmp_path / "journal.mcap", [journal])
    (columns,) = derived_with_recoveries(tmp_path / "journal.mcap")[0].values()
    assert columns["recovery_attempted"] == (recovery.attempts > 0) == begun
