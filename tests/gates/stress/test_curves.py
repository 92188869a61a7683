"""Success against severity: what is read where it halves, and that nothing is judged by it."""

import math

import evidence
import numpy as np
import pytest

from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.figures import draw_all
from gates.pages.page import gate_page
from gates.pages.tables_severity import CURVE, HALF
from gates.proof import judge
from gates.stress.curves import _half, curves, halved
from gates.stress.rollouts import CURVES, ROLLOUTS
from genpolicy.evidence.rows.stress import RolloutRow, SeverityRow
from genpolicy.integrity.tables import read_table

GRADES = (0.04, 0.16)


@pytest.mark.parametrize(
    ("shares", "at"),
    [
        ([1.0, 0.5, 0.0], 1.0),
        ([1.0, 0.75, 0.25], 1.5),
        ([0.8, 0.8, 0.4], 2.0),
        ([0.8, 0.2, 0.9], 2.0 / 3.0),  # the first crossing counts
        ([1.0, 0.9, 0.6], math.inf),
        ([1.0, 1.0, 1.0], math.inf),
    ],
)
def test_where_it_halves_by_hand(shares, at):
    assert halved([0.0, 1.0, 2.0], shares) == pytest.approx(at)


def test_what_never_succeeds_halves_nowhere():
    assert math.isnan(halved([0.0, 1.0], [0.0, 0.0]))


def harder(root, *, succeed):
    """Run `camera_delay` at two more sizes; which starts succeed there, by size."""
    condition = next(name for name in evidence.CONDITIONS if name == "camera_delay")
    rows = read_table(root / ROLLOUTS).to_pylist()
    added = []
    for size in GRADES:
        for row in rows:
            if row["perturbation"] == condition:
                won = row["start"] in succeed[size]
                added.append(
                    {**row, "perturbation": f"{condition}@{size:g}", "success": won,
                     "outcome": "success" if won else "timeout"}
                )  # fmt: skip
    evidence.table(root, ROLLOUTS.removeprefix("artifacts/"), RolloutRow, rows + added)
    sizes = [
        {"perturbation": name, "of": condition, "field": "magnitude_s", "severity": size}
        for name, size in (
            (f"{condition}@0.04", 0.04), (condition, 0.08), (f"{condition}@0.16", 0.16),
        )
    ]  # fmt: skip
    evidence.table(root, CURVES.removeprefix("artifacts/"), SeverityRow, sizes)
    evidence.record(root)


def test_a_curve_has_nominal_and_every_size(ladder):
    harder(ladder, succeed={0.04: range(10_000), 0.16: ()})
    found = curves(Evidence(ladder), ["flow"], confidence=0.95, root_seed=3)
    (curve,) = found
    assert [point.severity for point in curve.points] == [0.0, 0.04, 0.08, 0.16]
    assert [point.judged for point in curve.points] == [False, False, True, False]
    assert curve.points[-1].share == 0.0 and curve.points[1].share == 1.0
    assert all(point.lower <= point.share <= point.upper for point in curve.points)
    half, low, high = curve.half
    assert 0.08 < half < 0.16 and low <= half <= high
    assert curves(Evidence(ladder), ["flow"], confidence=0.95, root_seed=3) == found
    assert curves(Evidence(ladder), ["nobody"], confidence=0.95, root_seed=3) == []


def test_a_field_of_which_nobody_knows_what_is_none_has_no_curve(ladder):
    sizes = [
        {"perturbation": name, "of": "camera_delay", "field": "speed_limit_m_s", "severity": size}
        for name, size in (("camera_delay", 0.08), ("camera_delay@0.16", 0.16))
    ]
    evidence.table(ladder, CURVES.removeprefix("artifacts/"), SeverityRow, sizes)
    with pytest.raises(MissingEvidenceError, match="which size is none"):
        curves(Evidence(ladder), ["flow"], confidence=0.95, root_seed=3)


def test_beyond_what_was_run(ladder):
    harder(ladder, succeed={0.04: range(10_000), 0.16: range(10_000)})
    (curve,) = curves(Evidence(ladder), ["flow"], confidence=0.95, root_seed=3)
    assert curve.half == (math.inf,) * 3
    (found,) = draw_all((HALF,), Evidence(ladder), judge(ladder, "D"))
    row = next(line for line in found.listed if line[1] == "flow")
    assert row[3] == "beyond what was run" and "0.08 (judged)" in row[2]


def test_nothing_is_judged_by_a_size_that_is_not_the_judged_one(ladder):
    """All fail at four times the delay: no criterion, no promotion and no figure moves."""
    before = judge(ladder, "D")
    shown = gate_page(ladder, before)
    harder(ladder, succeed={0.04: (), 0.16: ()})
    after = judge(ladder, "D")
    assert after.verdict == before.verdict and after.candidates == before.candidates
    measured = {(c.id, c.candidate): (c.measured, c.verdict) for c in before.criteria}
    assert {(c.id, c.candidate): (c.measured, c.verdict) for c in after.criteria} == measured
    assert CURVE.title not in shown and CURVE.title in gate_page(ladder, after)


def test_the_interval_covers_where_it_truly_halves():
    """Golden by simulation: 60 starts, success 1, 0.8, 0.3 at sizes 0, 1, 2: half at 1.6."""
    rng = np.random.default_rng(5)
    covered = 0
    for _ in range(60):
        shares = (rng.random((60, 1)) < np.array([1.0, 0.8, 0.3])).astype(float)
        point, low, high = _half(
            [0.0, 1.0, 2.0], shares, confidence=0.95, draws=np.random.default_rng(1)
        )
        assert low <= point <= high
        covered += low <= 1.6 <= high
    assert covered >= 51  # 57 expected; four standard deviations below
