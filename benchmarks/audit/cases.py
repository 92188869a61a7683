"""The catalogue: every cause alone, from invisible to obvious.

Each has a smallest strength from which the audit is expected to name it: the limit that it is held
against, no more. Below, a data set is still run, and what was said of it is shown.
"""

from dataclasses import replace

from benchmarks.audit.actions import ACTIONS
from benchmarks.audit.catalogue import (
    CALIBRATION,
    CLOCK,
    EPOCH,
    FRAME,
    GLUED,
    HALF,
    LABELS,
    NOISE,
    ONE_VALID,
    ORDER,
    PERIOD_S,
    REPEATED,
    SUPPORT,
    UNIMODAL,
    UNIT,
    VALID,
    Answer,
    Cause,
    base,
    fault,
    hidden,
)
from benchmarks.audit.lost import FEW, LOST, MOVING
from benchmarks.audit.pairs import PAIRS
from benchmarks.audit.plan import Defect, Plan


def _skew(count: int, smallest: float) -> tuple[float, ...]:
    """Shares of modes of which all but the first have the smallest."""
    return (1.0 - (count - 1) * smallest, *(smallest,) * (count - 1))


def _modes(count: int, contexts: int) -> Cause:
    even = 1.0 / count
    context = f", {contexts} contexts" if contexts > 1 else ""
    return Cause(
        f"{count} valid modes{context}", "valid_modes", "share of the smallest mode",
        tuple(sorted({s for s in (0.05, 0.15, 0.2, even) if s <= even})), 0.15,
        "smallest share of a neighbourhood that makes a mode",
        lambda seed, s, task: Plan(seed, shares=_skew(count, s), contexts=contexts),
        (VALID,), (UNIMODAL, SUPPORT, NOISE),
    )  # fmt: skip


TOLD = "7 of 10 modes are told, the limit of what may be"
OBEYED = (0.2, 0.4, 0.6, 0.8, 1.0)


def _decided(
    name: str, decided_by: str, answers: tuple[Answer, ...], obeyed: tuple[float, ...] = OBEYED
) -> Cause:
    return Cause(
        name, "hidden_state", "share of episodes that obey", obeyed, 0.4, TOLD,
        lambda seed, s, task: Plan(seed, shares=HALF, decided_by=decided_by, fidelity=s),
        answers, (VALID,),
    )  # fmt: skip


def _clock(name: str, kind: str, scope: str, share: float = 1.0, minimum: float = 0.25) -> Cause:
    return Cause(
        name, "data_defect: clock", "action periods",
        tuple(sorted({0.1, minimum, 0.5, 1.0, 2.0, 4.0})), minimum,
        "the finest lag that is believed, or the least growth that is looked for",
        lambda seed, s, task: replace(
            base(seed), defects=(Defect(kind, s * PERIOD_S[task], scope, share),)
        ),
        (CLOCK,), (VALID, UNIMODAL),
    )  # fmt: skip


MODES = (
    *(_modes(count, contexts) for count in (2, 3, 4) for contexts in (1, 2)),
    Cause(
        "2 valid modes, narrow", "valid_modes", "distance relative to usual", (0.2, 0.35, 0.6, 0.8),
        0.35, "about 3 cm between the routes, the declared separation",
        lambda seed, s, task: Plan(seed, shares=HALF, width=s),
        (VALID,), (UNIMODAL, SUPPORT, NOISE),
    ),
    Cause(
        "2 valid modes, correlated strata", "valid_modes", "share that goes together", (0.5, 0.9),
        0.5, "operator, object and epoch go together, and none of them decides",
        lambda seed, s, task: Plan(seed, shares=HALF, correlation=s), (VALID,),
    ),
)  # fmt: skip

HIDDEN = (
    _decided("hidden operator", "operator", (hidden("operator"),)),
    _decided("hidden object", "object", (hidden("object"),)),
    _decided("hidden epoch", "calibration_epoch", EPOCH),
    _decided("side by session", "session", (ORDER,)),
    _decided("side in turns", "alternation", (ORDER,)),
    _decided("early lamp", "lamp_early", (hidden("unrecorded"),)),
    _decided("early path", "path_early", (hidden("unrecorded"), hidden("start_position"))),
    # Whoever always does as the time before has one way only.
    _decided("habit", "habit", (ORDER,), OBEYED[:-1]),
    Cause(
        "drift over the session", "hidden_state", "change of a mode's share over the session",
        (0.4, 0.8, 1.0), 0.8, TOLD,
        lambda seed, s, task: Plan(seed, shares=HALF, decided_by="drift", fidelity=s),
        (ORDER, *EPOCH), (VALID,),
    ),
    Cause(
        "hidden operator, correlated", "hidden_state", "share of episodes that obey",
        (0.2, 0.4, 0.6, 0.8, 1.0), 0.4, f"{TOLD}; what goes with it may be named",
        lambda seed, s, task: Plan(
            seed, shares=HALF, decided_by="operator", fidelity=s, correlation=0.7
        ), (hidden("operator"), hidden("object"), *EPOCH), (VALID,),
    ),
    Cause(
        "hidden phase", "hidden_state", "rest in both phases, s", (0.1, 0.4, 0.8, 1.6), 0.8,
        "8 observations and more without a motion that tells the phases apart",
        lambda seed, s, task: Plan(seed, station_dwell_s=s, phase_observed=False),
        (hidden("phase"),), (UNIMODAL, hidden("time_in_episode")),
    ),
)  # fmt: skip

CLOCKS = (
    _clock("robot clock, epoch", "robot_clock", "epoch"),
    _clock("robot clock, 15 % of episodes", "robot_clock", "some", 0.15, 0.75),
    _clock("camera clock, epoch", "camera_clock", "epoch"),
    _clock("clock drift in the episode", "clock_within", "epoch", minimum=1.5),
    _clock("clock drift over the session", "clock_session", "all", minimum=1.0),
)

DATA = (
    fault(
        "camera shift", "data_defect: calibration", "mm", (1, 3, 5, 10, 20), 3,
        "the limit of a calibration's residual",
        lambda s: Defect("camera_shift", s * 1e-3), CALIBRATION,
    ),
    fault(
        "tool shift", "data_defect: calibration", "mm", (1, 3, 5, 10, 20), 3,
        "the limit of a calibration's residual",
        lambda s: Defect("tool_shift", s * 1e-3), CALIBRATION,
    ),
    fault(
        "position unit, epoch", "data_defect: unit", "factor",
        (1.02, 1.15, 1.3, 10, 39.37, 1000), 1.15,
        "the limit between an epoch's answer and that of all",
        lambda s: Defect("position_unit", s), UNIT,
    ),
    fault(
        "action unit, all", "data_defect: unit", "factor", (1.02, 3, 10, 1000), 3,
        "the limit between commanded and observed motion",
        lambda s: Defect("action_unit", s, "all"), UNIT,
    ),
    fault(
        "position unit, share of episodes", "data_defect: unit", "share of episodes in mm",
        (0.01, 0.02, 0.1, 0.3), 0.02, FEW,
        lambda s: Defect("position_unit", 1000.0, "some", s), UNIT,
    ),
    fault(
        "scene unit, epoch", "data_defect: unit", "factor", (1.002, 1.01, 10, 1000), 1.01,
        "3 mm at the reach of the tasks, the limit of a calibration's residual",
        lambda s: Defect("scene_unit", s), Answer("data_defect", ("unit", "calibration")),
    ),
    fault(
        "frame turned, epoch", "data_defect: frame", "degrees", (1, 5, 8.1, 15, 90), 8.1,
        "the limit between commanded and observed motion",
        lambda s: Defect("turn", s * 0.017453292519943295), FRAME,
    ),
    fault(
        "frame turned, all", "data_defect: frame", "degrees", (1, 5, 8.1, 15, 90), 8.1,
        "the limit between commanded and observed motion",
        lambda s: Defect("turn", s * 0.017453292519943295, "all"), FRAME,
    ),
    fault(
        "mirrored, share of episodes", "data_defect: frame", "share of episodes",
        (0.01, 0.02, 0.2, 1.0), 0.02, FEW,
        lambda s: Defect("mirror", 1.0, "some", s), FRAME,
    ),
    fault(
        "columns swapped, share of episodes", "data_defect: frame", "share of episodes",
        (0.01, 0.02, 0.2, 1.0), 0.02, FEW,
        lambda s: Defect("swap", 1.0, "some", s), FRAME,
    ),
    fault(
        "stored twice", "data_defect: duplicate", "share of episodes",
        (0.01, 0.02, 0.05, 0.3), 0.02, FEW,
        lambda s: Defect("repeat", s), REPEATED,
    ),
    fault(
        "glued to the next", "data_defect: glued", "share of episodes",
        (0.01, 0.02, 0.1, 0.5), 0.02, FEW, lambda s: Defect("glue", s, "some"), GLUED,
    ),
    fault(
        "glued to itself", "data_defect: glued", "share of episodes",
        (0.01, 0.02, 0.1, 1.0), 0.02, FEW, lambda s: Defect("glue", s, "all"), GLUED,
    ),
)  # fmt: skip

LABELLED = (
    Cause(
        "wrong labels", "label_contamination", "share of labels", (0.02, 0.05, 0.1, 0.25), 0.1,
        "one label in ten; the exact bound of 60 replays cannot tell less from the limit of 10 %",
        lambda seed, s, task: replace(base(seed), wrong_labels=s),
        (LABELS,), (VALID, UNIMODAL, SUPPORT),
    ),
    Cause(
        "wrong labels of one mode", "label_contamination", "share of its labels",
        (0.05, 0.2, 0.5), 0.2, "one label in ten of all",
        lambda seed, s, task: Plan(seed, shares=HALF, wrong_labels=s, wrong_mode_only=True),
        (LABELS,), (VALID, UNIMODAL, SUPPORT),
    ),
    Cause(
        "a mode that fails", "one valid mode", "share of its episodes that fail",
        (0.1, 0.3, 0.5, 0.95), 0.3, "the limit of a mode's success",
        lambda seed, s, task: Plan(seed, shares=HALF, failing=s), (ONE_VALID,), (VALID,),
    ),
)  # fmt: skip

STRUCTURE = (
    Cause(
        "tremor", "pointwise_noise", "mm", (0.5, 2, 6, 12), 2,
        "the limit of the spread that matters",
        lambda seed, s, task: Plan(seed, tremor_m=s * 1e-3), (NOISE,), (UNIMODAL,),
    ),
    Cause(
        "unimodal", "unimodal", "spread of the routes, mm", (2, 8, 15, 25), 0,
        "one way, however wide",
        lambda seed, s, task: Plan(seed, route_spread_m=s * 1e-3), (UNIMODAL,),
    ),
    Cause(
        "heavy tails", "unimodal", "degrees of freedom of the routes' spread", (1.5, 2, 3), 3,
        "one way, with strays: a handful of routes of their own are no mode",
        lambda seed, s, task: Plan(seed, tails=s), (UNIMODAL,), falling=True,
    ),
    Cause(
        "the goal decides", "unimodal", "half width of the goal, mm", (4, 10, 30), 10,
        "one declared scale (10 mm) between the middles of the two sides",
        lambda seed, s, task: Plan(
            seed, shares=HALF, decided_by="goal", goal_half_width_m=s * 1e-3
        ), (UNIMODAL,), (VALID,),
    ),
    Cause(
        "a lamp decides", "unimodal", "share of episodes that obey", (0.3, 0.8, 0.9, 1.0), 0.9,
        "it then orders 95 of 100 pairs, the limit of what the observation decides",
        lambda seed, s, task: Plan(seed, shares=HALF, decided_by="lamp", fidelity=s),
        (UNIMODAL,), (VALID,),
    ),
    Cause(
        "too few episodes", "insufficient_support", "episodes", (60, 40, 20, 10), 20,
        "fewer training episodes than a neighbourhood needs",
        lambda seed, s, task: replace(base(seed), episodes=int(s)),
        (SUPPORT,), (VALID, UNIMODAL), falling=True,
    ),
    Cause(
        "starts too far apart", "insufficient_support", "width of starts relative to usual",
        (3, 8, 15, 25, 40), 25, "fewer than 3 training episodes within reach of most places",
        lambda seed, s, task: replace(base(seed), start_wide=s, goal_half_width_m=0.01 * s),
        (SUPPORT,), (VALID, UNIMODAL),
    ),
)  # fmt: skip

CAUSES = MODES + HIDDEN + CLOCKS + DATA + LOST + LABELLED + STRUCTURE + PAIRS + ACTIONS + MOVING
