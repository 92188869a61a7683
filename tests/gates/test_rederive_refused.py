"""A refused chunk is the one that was judged, and of what is kept whole none is missing."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from gates.rederive_refused import rederive_refused
from gates.stress.rollouts import REFUSED
from genpolicy.errors import IntegrityError, RefusedError
from genpolicy.evidence.rows.stress import RefusedRow
from genpolicy.evidence.shadow.candidate_rows import numbers_sha256
from genpolicy.integrity.rows import table_of_rows, write_rows
from genpolicy.integrity.tables import write_table
from genpolicy.verification.refused import RefusedCandidates

PARAMS = {"policy": {"seeds": [0]}}
RAW, PROJECTED = (0.0, 1.0), (0.5, 1.0)


def candidate(index, first_reason="collision"):
    measures = {"raw_sha256": numbers_sha256(RAW), "projected_sha256": numbers_sha256(PROJECTED)}
    layers = {"representation": True, "kinematic": True, "geometric": not first_reason}
    return {
        "session": "flow/push/0", "chunk_id": "c", "index": index, "layers": layers,
        "first_reason": first_reason, "measures": measures if first_reason else {},
    }  # fmt: skip


def row(index, **changes):
    known = RefusedRow(
        method="flow", seed=0, perturbation="push", start=0, chunk_id="c", candidate=index,
        layer="geometric", first_reason="collision", first_row=3, layer_margin=-0.01,
        margin_unit="m", touching=("hand", "post"), raw=RAW, projected=PROJECTED,
    )  # fmt: skip
    return replace(known, **changes)


def rollout(start, outcome, duration_s=1.0):
    return {
        "method": "flow", "perturbation": "push", "start": start, "outcome": outcome,
        "success": outcome == "success", "mode": "left", "duration_s": duration_s,
        "force_peak_n": 0.0,
    }  # fmt: skip


def proved(root, rows, rollouts):
    """Hold these rows against a journal of two refused candidates and one that passed."""
    (root / REFUSED).parent.mkdir(parents=True, exist_ok=True)
    (root / "params.yaml").write_text(yaml.safe_dump(PARAMS))
    write_rows(root / REFUSED, RefusedRow, rows)
    refused = RefusedCandidates()
    labels = {"method": "flow", "perturbation": "push", "start": "0"}
    refused.read("session", {"session": "flow/push/0", "labels": labels})
    for index, why in ((0, "collision"), (1, "collision"), (2, None)):
        refused.read("candidate", candidate(index, why))
    rederive_refused(root, PARAMS, refused, rollouts)


LOST = [rollout(0, "timeout")]
"""One failure: kept whole."""
UNWATCHED = [rollout(n, "success", float(n)) for n in range(3)]
"""The first of three successes: neither the median nor the slowest."""


def test_what_was_judged_stands(tmp_path):
    proved(tmp_path, [row(0), row(1)], LOST)
    proved(tmp_path, [], UNWATCHED)


def test_a_table_without_a_column_is_refused_by_name(tmp_path, monkeypatch):
    def lacking(path, row, rows):
        write_table(path, table_of_rows(row, rows).drop_columns(["raw"]))

    monkeypatch.setitem(globals(), "write_rows", lacking)
    with pytest.raises(IntegrityError, match="raw"):
        proved(tmp_path, [row(0), row(1)], LOST)


@pytest.mark.parametrize(
    ("rows", "rollouts"),
    [
        ([row(0)], LOST),
        ([], LOST),
        ([row(0), row(1), row(2)], LOST),
        ([row(0), row(1)], UNWATCHED),
        ([row(0), row(1, raw=(0.0, np.nextafter(1.0, 2.0)))], LOST),
        ([row(0), row(1, projected=RAW)], LOST),
        ([row(0), row(1, first_reason="joint_limit")], LOST),
        ([row(0), row(1, layer="kinematic")], LOST),
        ([row(0), row(1, seed=1)], LOST),
    ],
)
def test_what_was_not_is_refused(tmp_path, rows, rollouts):
    with pytest.raises(RefusedError, match="refused"):
        proved(tmp_path, rows, rollouts)
