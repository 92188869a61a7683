"""Two causes at once, both obvious: the first red layer in the order of diagnosis is the answer."""

from collections.abc import Callable
from dataclasses import replace

from benchmarks.audit.catalogue import (
    CALIBRATION,
    CLOCK,
    HALF,
    LABELS,
    PERIOD_S,
    REPEATED,
    SUPPORT,
    VALID,
    Answer,
    Cause,
    base,
    hidden,
)
from benchmarks.audit.plan import Defect, Plan


def _pair(name: str, group: str, plan: Callable[[int, str], Plan], *answers: Answer) -> Cause:
    return Cause(
        name, group, "both obvious", (1.0,), 1.0, "the first red layer in the order of diagnosis",
        lambda seed, s, task: plan(seed, task), answers,
    )  # fmt: skip


def _late(task: str) -> Defect:
    return Defect("robot_clock", 2.0 * PERIOD_S[task])


PAIRS = (
    _pair(
        "clock + wrong labels", "data_defect: clock",
        lambda seed, task: replace(base(seed), wrong_labels=0.25, defects=(_late(task),)), CLOCK,
    ),
    _pair(
        "clock + hidden operator", "data_defect: clock",
        lambda seed, task: Plan(
            seed, shares=HALF, decided_by="operator", defects=(_late(task),)
        ), CLOCK,
    ),
    _pair(
        "clock + camera shift", "data_defect: clock",
        lambda seed, task: replace(
            base(seed), defects=(_late(task), Defect("camera_shift", 0.02))
        ), CLOCK,
    ),
    _pair(
        "camera shift + a mode that fails", "data_defect: calibration",
        lambda seed, task: Plan(
            seed, shares=HALF, failing=0.8, defects=(Defect("camera_shift", 0.02),)
        ), CALIBRATION,
    ),
    _pair(
        "stored twice + hidden object", "data_defect: duplicate",
        lambda seed, task: Plan(
            seed, shares=HALF, decided_by="object", defects=(Defect("repeat", 0.2),)
        ), REPEATED,
    ),
    _pair(
        "wrong labels + hidden operator", "label_contamination",
        lambda seed, task: Plan(seed, shares=HALF, decided_by="operator", wrong_labels=0.25),
        LABELS,
    ),
    _pair(
        "wrong labels + tremor", "label_contamination",
        lambda seed, task: Plan(seed, tremor_m=0.012, wrong_labels=0.25), LABELS,
    ),
    _pair(
        "few episodes + hidden object", "insufficient_support",
        lambda seed, task: Plan(seed, shares=HALF, decided_by="object", episodes=15), SUPPORT,
    ),
    _pair(
        "hidden object + a mode that fails", "hidden_state",
        lambda seed, task: Plan(seed, shares=HALF, decided_by="object", failing=0.8),
        hidden("object"),
    ),
    _pair(
        "3 modes + a mode that fails", "valid_modes",
        lambda seed, task: Plan(seed, shares=(0.34, 0.33, 0.33), failing=0.8), VALID,
    ),
)  # fmt: skip
