from dataclasses import replace
from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from genpolicy.tasks.tabletop_insertion.phases import Measured, PhaseLogic

HOLE = np.array([0.65, 0.0])
ARROWS = {
    "approach": {"approach", "align", "insert", "recover", "retreat"},
    "align": {"approach", "align", "insert", "recover", "retreat"},
    "insert": {"insert", "release", "align", "approach", "retreat"},
    "release": {"release", "insert", "align", "approach", "retreat"},
    "retreat": {"retreat"},
    "recover": {"recover", "approach", "align", "insert", "retreat"},
}


def measured(x, y, z, **changes):
    base = Measured(
        tcp_m=np.array([x, y, z]),
        hole_xy_m=HOLE,
        gripper_opening_m=0.01,
        holding=True,
        deviation_m=0.0,
        recovery_requested=False,
    )
    return replace(base, **changes)


states = st.builds(
    lambda x, y, z, deviation, requested: measured(
        x, y, z, deviation_m=deviation, recovery_requested=requested
    ),
    st.floats(0.3, 0.72),
    st.floats(-0.22, 0.22),
    st.floats(0.06, 0.24),
    st.floats(0.0, 0.03),
    st.booleans(),
)


@given(st.lists(states, min_size=1, max_size=30), st.integers(0, 30))
def test_the_phase_only_moves_along_the_arrows(sequence, dropped_at):
    logic = PhaseLogic()
    for index, state in enumerate(sequence):
        before = logic.phase
        held = replace(state, holding=index < dropped_at)
        after = logic.update(held, period_s=0.05)
        assert after in ARROWS[before]
        if before in ("insert", "release"):
            assert after != "recover"


def test_a_good_episode_passes_every_phase_in_order():
    logic = PhaseLogic()
    seen = [
        logic.update(state, period_s=0.05)
        for state in (
            measured(0.38, 0.0, 0.15),
            measured(0.50, 0.13, 0.15),
            measured(0.60, 0.05, 0.15),
            measured(0.65, 0.0, 0.144),
            measured(0.65, 0.0, 0.10),
            measured(0.65, 0.0, 0.075),
            measured(0.65, 0.0, 0.075, gripper_opening_m=0.025, holding=False),
            measured(0.65, 0.0, 0.075, gripper_opening_m=0.04, holding=False),
        )
    ]
    assert seen == [
        "approach", "approach", "align", "insert", "insert", "release", "release", "retreat",
    ]  # fmt: skip


def test_noise_at_a_border_makes_no_phase_flicker():
    logic = PhaseLogic()
    rng = np.random.Generator(np.random.Philox(5))
    phases = []
    for _ in range(200):
        noise = 0.002 * rng.standard_normal(3)
        phases.append(
            logic.update(measured(*(np.array([0.65, 0.0, 0.145]) + noise)), period_s=0.05)
        )
    changes = sum(a != b for a, b in pairwise(phases))
    assert changes <= 2


def test_a_measured_deviation_starts_recovery_and_ends_it_not_before_its_time():
    logic = PhaseLogic()
    assert logic.update(measured(0.5, 0.13, 0.15, deviation_m=0.02), period_s=0.05) == "recover"
    phases = [logic.update(measured(0.5, 0.13, 0.15), period_s=0.05) for _ in range(6)]
    assert phases[:3] == ["recover"] * 3
    assert phases[-1] == "approach"
