"""How often the executor asks: the rate on the identity card, held against a rollout's journal."""

import numpy as np
import pytest

from genpolicy.evidence.reproducibility.identity import invocation_rate_hz


@pytest.mark.parametrize(
    ("execution_horizon", "replan_lead_rows", "rate_hz"),
    [(8, 3, 4.0), (8, 1, 20.0 / 7.0), (10, 3, 20.0 / 7.0), (8, 7, 20.0)],
)
def test_the_rate_is_the_one_of_the_rule_by_which_the_executor_asks(
    run, kit, plans, execution_horizon, replan_lead_rows, rate_hz
):
    """Of intervals between invocations the median: a chunk that is refused moves single ones."""
    horizons = kit.HORIZONS.model_copy(update={"execution_horizon": execution_horizon})
    execution = kit.EXECUTION.model_copy(update={"replan_lead_rows": replan_lead_rows})
    (rollout,) = run(kit.Replay(plans.actions), horizons=horizons, execution=execution, ticks=80)
    begun_ns = [
        event.t
        for event in rollout.journal.events()
        if event.kind == "invocation" and event.payload["stage"] == "begin"
    ]
    assert len(begun_ns) > 8
    told_hz = invocation_rate_hz(horizons, replan_lead_rows=replan_lead_rows)
    assert told_hz == pytest.approx(rate_hz)
    assert 1e9 / np.median(np.diff(begun_ns)) == pytest.approx(told_hz, rel=0.02)
