"""The gain by condition and inside the envelope: what is gained elsewhere does not count there."""

import evidence
import numpy as np
import pytest
from asked import asked, found_in, settings_of

from gates.evidence import Evidence, MissingEvidenceError
from gates.proof import judge
from gates.stress.choice import compared
from gates.stress.gains import by_condition, inside_envelope, inside_pairs, least_gain
from gates.stress.gate import promotion_e_value
from gates.stress.pairs import paired_by_condition
from genpolicy.statistics.eprocess import gain_interval, paired_e_value

TABLE = "stress/rollouts.parquet"


def won(root, condition, method, starts):
    """In one condition a method succeeds from these starts and from no other."""

    def change(frame):
        own = (frame["method"] == method) & (frame["perturbation"] == condition)
        return frame.assign(success=np.where(own, frame["start"].isin(starts), frame["success"]))

    evidence.edit_table(root, TABLE, change)


def every(number):
    return [start for start in range(evidence.STARTS) if start % number == 0]


def told(root):
    return by_condition(Evidence(root), settings_of(root, "D"), "flow")


def inside(root, **settings):
    plan = settings_of(root, "D").model_copy(update=settings)
    return inside_envelope(Evidence(root), plan, "flow")


def test_the_worst_condition_comes_first_with_the_baseline_that_gains_most_on_it(ladder):
    won(ladder, "queue_reorder", "flow", [])
    won(ladder, "queue_reorder", "bc_noise", every(1))
    won(ladder, "nominal", "flow", range(evidence.STARTS))
    won(ladder, "nominal", "act", every(2))
    text = told(ladder)
    assert text.startswith(
        f"success on {evidence.STARTS} starts in each condition, worst in queue_reorder "
        "-100 points over bc_noise, "
    )
    assert ", nominal +50 points over act" in text
    assert all(text.count(f"{name} ") == 1 for name in evidence.CONDITIONS)
    assert (
        f"; {text}; inside the envelope"
        in asked(ladder, promotion_e_value, "flow", gate="D").caveat
    )


def test_the_gain_inside_the_envelope_is_that_over_the_hardest_baseline_there(ladder):
    won(ladder, "envelope", "flow", every(2))
    won(ladder, "envelope", "act", every(8))
    for name in evidence.COMPARED:
        if name != "act":
            won(ladder, "envelope", name, [])
    found = inside(ladder)
    pairs = paired_by_condition(Evidence(ladder), settings_of(ladder, "D"), "flow", "act")
    alpha = settings_of(ladder, "D").alpha
    assert found.baseline == "act" and found.starts == evidence.STARTS
    assert found.gain == pytest.approx(0.5 - 0.125) and found.shown and not found.worse
    test = paired_e_value(pairs["envelope"], margin=0.0, alpha=alpha)
    assert found.e_value == test.e_value >= 1 / alpha
    assert found.interval == gain_interval(pairs["envelope"], alpha=alpha)
    assert 0 < found.interval[0] < found.gain < found.interval[1]


def test_a_gain_that_is_nothing_is_said_as_nothing(ladder):
    """Means of binary fractions that cancel leave 1e-17, which in points were a power of ten."""
    plan, pairs = settings_of(ladder, "D"), np.array([-0.1, -0.2, 0.3])
    assert pairs.mean() != 0.0
    inside = inside_pairs({"bc": pairs}, plan)
    assert str(inside).startswith("inside the envelope +0 points of success over bc")
    assert least_gain({"bc": pairs}, None, plan).gain == 0.0
    assert compared("flow", "act", pairs, plan).gain == 0.0


def test_what_is_gained_outside_the_envelope_alone_is_no_promotion(ladder):
    """On average the gain is far beyond the margin; inside the envelope there is none."""
    before = asked(ladder, promotion_e_value, "flow", gate="D")
    for name in ("flow", *evidence.COMPARED):
        won(ladder, "envelope", name, every(2))
    found = inside(ladder)
    assert found.gain == 0.0 and not found.shown and not found.worse
    with pytest.raises(MissingEvidenceError, match=r"none inside the envelope \(e-value 1\)"):
        asked(ladder, promotion_e_value, "flow", gate="D")
    report = judge(ladder, "D")
    (answer,) = [c for c in found_in(report, promotion_e_value.id) if c.candidate == "flow"]
    assert answer.verdict == "INCONCLUSIVE" and report.candidates["flow"] == "INCONCLUSIVE"
    assert (
        "inside the envelope +0 points of success over " in answer.caveat
        and before.value >= answer.threshold
    )


def test_a_loss_that_is_shown_inside_the_envelope_fails(ladder):
    won(ladder, "envelope", "flow", [])
    won(ladder, "envelope", "one_mode_bc", every(1))
    found = inside(ladder)
    assert found.worse and found.baseline == "one_mode_bc" and found.interval[1] < 0
    measured = asked(ladder, promotion_e_value, "flow", gate="D")
    assert measured.value == found.e_value < 1 / settings_of(ladder, "D").alpha
    assert judge(ladder, "D").candidates["flow"] == "FAIL"


def test_a_gain_that_is_small_inside_and_not_shown_is_open(ladder):
    """Two of eighty more: the interval holds losses as well."""
    for name in ("flow", *evidence.COMPARED):
        won(ladder, "envelope", name, every(4) + ([1, 2] if name == "flow" else []))
    found = inside(ladder)
    assert found.gain == pytest.approx(2 / evidence.STARTS)
    assert found.interval[0] < 0 < found.interval[1] and not found.shown and not found.worse


def test_where_not_to_be_worse_is_the_plan_no_more_is_asked_inside(ladder):
    for name in ("flow", *evidence.COMPARED):
        won(ladder, "envelope", name, every(2))
    assert not inside(ladder).shown
    assert inside(ladder, margin=-0.5).shown
    won(ladder, "envelope", "flow", [])
    assert not inside(ladder, margin=-0.1).shown


def test_a_plan_without_the_envelope_says_so_and_is_judged_by_the_average(ladder):
    conditions = tuple(name for name in evidence.CONDITIONS if name != "envelope")
    assert inside(ladder, perturbations=conditions) is None
    evidence.write_params(ladder, lambda p: p["stress"]["perturbations"].pop("envelope"))
    found = asked(ladder, promotion_e_value, "flow", gate="D")
    assert found.value >= 1 / settings_of(ladder, "D").alpha
    assert found.caveat.endswith("no condition inside the envelope of a card was planned")
