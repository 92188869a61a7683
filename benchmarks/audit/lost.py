"""Causes of sensors that stop or lose frames, and of objects that move.

An object that moves and is seen to move is no fault. One that moves after the camera has looked
once is: what was recorded is not where it was.
"""

from dataclasses import replace

from benchmarks.audit.catalogue import (
    CALIBRATION,
    FROZEN,
    GAPS,
    HALF,
    SUPPORT,
    UNIMODAL,
    VALID,
    Cause,
    base,
    fault,
    hidden,
)
from benchmarks.audit.plan import Defect, Plan

FEW = "the limit of faulty episodes, two at least"
OLD = "the limit of a stretch that shows the same, in whole rows"
FROZEN_S = 2.0

LOST = (
    fault(
        "dropped rows", "data_defect: gaps", "share of rows", (0.002, 0.01, 0.05, 0.2), 0.01,
        "the limit of rows that follow a gap",
        lambda s: Defect("drop", s, "all"), GAPS,
    ),
    fault(
        "dropped camera frames", "data_defect: gaps", "share of frames",
        (0.02, 0.05, 0.11, 0.15, 0.3), 0.11,
        "two lost in a row make a gap: its square is just above the limit of such rows",
        lambda s: Defect("drop_camera", s, "all"), GAPS,
    ),
    fault(
        "frozen position", "data_defect: frozen", "share of episodes", (0.01, 0.02, 0.1, 0.3), 0.02,
        FEW, lambda s: Defect("freeze", FROZEN_S, "some", s), FROZEN,
    ),
    fault(
        "frozen camera", "data_defect: frozen", "share of episodes", (0.01, 0.02, 0.1, 0.3), 0.02,
        FEW, lambda s: Defect("freeze_camera", FROZEN_S, "some", s), FROZEN,
    ),
    fault(
        "frozen camera, how long", "data_defect: frozen", "s", (0.1, 0.2, 0.4, 0.8, 2.0), 0.4, OLD,
        lambda s: Defect("freeze_camera", s, "some", 0.2), FROZEN,
    ),
    Cause(
        "frozen camera of one mode", "data_defect: frozen", "share of its episodes",
        (0.02, 0.04, 0.2, 0.6), 0.04, "2 % of all episodes, the limit of faulty ones",
        lambda seed, s, task: Plan(
            seed, shares=HALF, defects=(Defect("freeze_camera", FROZEN_S, "mode", s),)
        ), (FROZEN,), (VALID,),
    ),
    Cause(
        "object moves, camera freezes", "data_defect: frozen", "share of episodes",
        (0.01, 0.02, 0.1, 0.3), 0.02, FEW,
        lambda seed, s, task: replace(
            base(seed), object_move_m=0.01, defects=(Defect("freeze_camera", FROZEN_S, "some", s),)
        ), (FROZEN,), (VALID, UNIMODAL, SUPPORT),
    ),
)  # fmt: skip

MOVING = (
    Cause(
        "object moves, seen", "unimodal", "furthest move, mm", (5, 10, 20), 0,
        "what the policy sees is no cause, wherever it goes",
        lambda seed, s, task: Plan(seed, object_move_m=s * 1e-3), (UNIMODAL,),
    ),
    Cause(
        "object moves, seen, 2 valid modes", "valid_modes", "furthest move, mm", (5, 10, 20), 0,
        "the modes are there, wherever the object goes",
        lambda seed, s, task: Plan(seed, shares=HALF, object_move_m=s * 1e-3), (VALID,),
    ),
    Cause(
        "object jumps, unseen", "data_defect: calibration", "mm to one of two sides",
        (1, 3, 10, 30), 3, "the limit of a calibration's residual",
        lambda seed, s, task: replace(
            base(seed), object_move_m=s * 1e-3, object_jumps=True,
            defects=(Defect("latch", 1.0, "all"),),
        ), (CALIBRATION, hidden("unrecorded")), (VALID, UNIMODAL, SUPPORT),
    ),
)  # fmt: skip
