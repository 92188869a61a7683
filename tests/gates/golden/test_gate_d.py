"""The whole report of Gate D, of even and of uneven evidence, as it was read last."""

import json

import evidence
import pandas as pd
from as_told import hold, told
from drawn import hold_pictures

from gates.proof import judge

ROLLOUTS, INVOCATIONS = "stress/rollouts.parquet", "stress/invocations.parquet"


def _number(frame):
    """A number of each row that no two conditions of a start share."""
    order = {name: place for place, name in enumerate(evidence.CONDITIONS)}
    return 7 * frame["start"] + 5 * frame["perturbation"].map(order)


def _uneven(frame):
    """Every column varies by start and condition; one candidate has a second training seed."""
    second = frame[frame["method"] == "flow"].assign(seed=1)
    frame = pd.concat([frame, second], ignore_index=True)
    n = _number(frame) + 11 * frame["seed"]
    success = frame["success"] & (n % 23 != 0)
    ended = success.map({True: "success", False: "timeout"})
    return frame.assign(
        success=success,
        outcome=ended.mask(~success & (n % 4 == 0), "collision"),
        recovery_attempted=frame["recovery_attempted"] | (n % 3 == 0),
        recovered=success & (frame["recovery_attempted"] | (n % 3 == 0)) & (n % 5 != 1),
        hold_ticks=8 + n % 13,
        fallback_ticks=8 * (n % 7),
        deadline_misses=(n % 9 == 1) * 12,
        rejections=(n % 4 == 0) * 8,
        interventions=(n % 41 == 0) * 1,
        force_peak_n=(5.0 + 0.1 * frame["start"] + 0.01 * (n % 17)) * (n % 6 != 0),
    )


def _later(frame):
    second = frame[frame["method"] == "flow"].assign(seed=1)
    frame = pd.concat([frame, second], ignore_index=True)
    n = _number(frame) + 3 * frame["invocation"] + 11 * frame["seed"]
    return frame.assign(latency_s=frame["latency_s"] + 0.001 * (n % 19))


def _power(document):
    document["rows"][0]["promote_share"] = 0.91
    document["rows"][1]["return_share"] = 0.93


def _elsewhere(root):
    for table, column, method in (
        ("stub", "stale", "flow"), ("stub", "invalid", "diffusion"),
        ("conservation", "executed", "flow"), ("counts", "count", "diffusion"),
    ):  # fmt: skip
        evidence.edit_table(
            root, f"stress/{table}.parquet",
            lambda f, c=column, m=method: f.assign(
                **{c: f[c] + (f["method"].eq(m) & f["perturbation"].eq("queue_reorder"))}
            ),
        )  # fmt: skip


def test_gate_d_of_even_evidence_says_what_it_said(ladder):
    hold("gate_d", told(judge(ladder, "D")))


def _make_uneven(ladder):
    evidence.edit_table(ladder, ROLLOUTS, _uneven)
    evidence.edit_table(ladder, INVOCATIONS, _later)
    evidence.edit_document(ladder, "stress/power.json", _power)
    evidence.edit_document(ladder, "stress/distilled.json", lambda d: {"flow": d["manicm"]})
    _elsewhere(ladder)


def test_gate_d_of_uneven_evidence_says_what_it_said(ladder):
    _make_uneven(ladder)
    found = told(judge(ladder, "D"))
    assert not json.dumps(found).count("missing"), "a number that is not measured guards nothing"
    hold("gate_d_uneven", found)


def test_gate_d_of_uneven_evidence_draws_what_it_drew(ladder):
    _make_uneven(ladder)
    hold_pictures("gate_d_drawn", "D", ladder, judge(ladder, "D"))
