"""Numbers on which all is well, the same with one thing wrong, and limits that can be moved."""

from dataclasses import replace

from gates.cause import Cause, CauseLimits, default_limits, name_cause
from gates.cause.numbers import Kept, Labels, Numbers
from genpolicy.audit.component_rows import ComponentModes
from genpolicy.audit.documents import Counts
from genpolicy.audit.reach_rows import LEARNED, LOCAL, Alternative, Reach, Side
from genpolicy.audit.rows import Finding, ModeOutcome, Prediction, Stratum
from genpolicy.audit.settings import AuditSettings

LIMITS = default_limits()


def named(numbers: Numbers, limits: CauseLimits = LIMITS, draws=()) -> Cause:
    return name_cause(numbers, draws, limits)


def limit(**changes: float) -> CauseLimits:
    found = dict(LIMITS.by_question)
    for question, value in changes.items():
        found[question] = replace(found[question], limit=value)
    return CauseLimits(found, LIMITS.confidence)


STRATUM = Stratum("operator", "approach", 0.9, 0.9, 0.05, 0.0, 0.1, 100, True, False, "")


def component(name: str, **changes) -> ComponentModes:
    plain = ComponentModes(
        name, "varies", "m", 0.03, 0.01, 0.01, 180, 0, 0, 0, 0, 0, followed=False
    )
    return replace(plain, **changes)


HIDDEN = replace(STRATUM, p_adjusted=0.001, effect=0.8, effect_lower=0.6)


TOLD = Prediction("operator", "approach", 0.05, -0.1, 0.2, 0.52, 0.5, 120)


VALID = Numbers(
    findings=(), floors=AuditSettings().floors, ceilings=AuditSettings().ceilings,
    metre=1.0, unit="m",
    labels=Labels(60, 0),
    counts=Counts(200, 180, 50, 120, 45, 50, 0, 0, 110, 0.1, 0.01, 0.02),
    kept=Kept(0.95, 0.6, 118), strata=(STRATUM,), told=(TOLD,),
    modes=(
        ModeOutcome("m0", "approach", 40, 40, 0.91, 1.0, 50, 50),
        ModeOutcome("m1", "approach", 40, 39, 0.87, 1.0, 48, 50),
    ),
    components=(
        component("position", clusters=120, two_mode=120, two_mode_episodes=45, followed=True),
        component("rotation", unit="rad", separation=0.15),
        component("gripper", state="hardly_varies", unit="strokes", separation=0.2),
        component("other", state="absent", unit="strokes", separation=0.2, situations=0),
        component("timing"),
    ),
    alternatives=(Alternative("approach", "m0", "m1", 120),),
    reach=tuple(Reach(LOCAL, fifth, 40, 36) for fifth in range(1, 6)),
)  # fmt: skip


OFFSET = Finding("clock", "robot", "epoch e1", "clock_residual_s", 0.05, 0.01, "s", "Correct it.")


def counts(**changes) -> Numbers:
    return replace(VALID, counts=replace(VALID.counts, **changes))


BROKEN = {
    "data": (replace(VALID, findings=(OFFSET,)), "data_defect", "clock"),
    "labels": (replace(VALID, labels=Labels(60, 12)), "label_contamination", "replay"),
    "support": (counts(analysed_episodes=19), "insufficient_support", "neighbourhoods"),
    "structure": (counts(two_mode_episodes=9), "unimodal", ""),
    "hidden": (replace(VALID, strata=(HIDDEN,)), "hidden_state", "stratum"),
    "validity": (
        replace(
            VALID,
            modes=(VALID.modes[0], replace(VALID.modes[1], successes=20)),
        ),
        "unimodal", "one_valid_mode",
    ),
}  # fmt: skip


def learned(*, modes=0, spoke=0.9, confirmed=0, contradicted=0):
    """What the learned evidence found, and how far it reaches."""
    side = Side(
        LEARNED, followed=False, queries=600, analysed=round(600 * spoke), analysed_episodes=50,
        two_mode=3 * modes, two_mode_episodes=modes, primary_episodes=50 if modes else 0,
        resolved=0, incoherent=0, persistent=3 * modes, noise_ratio=0.1, noise_spread=0.01,
        white_share=0.02, kept=0.9, kept_null_q95=0.6, kept_n=3 * modes, confirmed=confirmed,
        contradicted=contradicted,
    )  # fmt: skip
    reach = tuple(Reach(LEARNED, k, 120, round(120 * spoke)) for k in range(1, 6))
    return {"other": side, "other_reach": reach}
