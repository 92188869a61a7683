"""The cause: the first red layer in the order of diagnosis decides, and says what to do next.

Order: clocks and frames, calibration, labels, support, modes at all, persistence, recorded
variables, validity of each mode. A later layer is not believed while an earlier one is red.
"""

from dataclasses import dataclass
from enum import StrEnum

from genpolicy.audit.labels import ModeOutcome, Replayed, disagreement
from genpolicy.audit.persistence import Persistence
from genpolicy.audit.semantics import Semantics
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.strata import Stratum

DATA_VARIABLES = ("calibration_epoch",)
POINTWISE_RATIO = 0.5


class Cause(StrEnum):
    """Why demonstrations differ where the observation does not."""

    VALID_MODES = "valid_modes"
    HIDDEN_STATE = "hidden_state"
    DATA_DEFECT = "data_defect"
    LABEL_CONTAMINATION = "label_contamination"
    POINTWISE_NOISE = "pointwise_noise"
    UNIMODAL = "unimodal"
    INSUFFICIENT_SUPPORT = "insufficient_support"


@dataclass(frozen=True)
class Counts:
    """What was found, in numbers; episodes are distinct held-out episodes.

    Attributes:
        queries: Situations looked at.
        analysed: Situations with enough neighbours.
        analysed_episodes: Held-out episodes with at least one of them.
        two_mode: Situations with several modes under one observation.
        two_mode_episodes: Held-out episodes with at least one of them.
        resolved: Situations with clusters that are not claimed as modes: an observed component
            tells them apart, or they are too few in their phase.
        persistent: Situations with several modes that persist.
        noise_ratio: Median von Neumann ratio of the spread inside situations: 1 white, 0 smooth.
        noise_spread: Median spread inside situations, unit of the position.
    """

    queries: int
    analysed: int
    analysed_episodes: int
    two_mode: int
    two_mode_episodes: int
    resolved: int
    persistent: int
    noise_ratio: float
    noise_spread: float


@dataclass(frozen=True)
class AuditVerdict:
    """Cause, the variable or the kind that it names (else empty), and what to do next."""

    cause: Cause
    variable: str
    kind: str
    next_action: str


def decide(
    settings: AuditSettings,
    *,
    semantics: Semantics,
    replayed: tuple[Replayed, ...],
    counts: Counts,
    persistence: Persistence,
    strata: tuple[Stratum, ...],
    modes: tuple[ModeOutcome, ...],
) -> AuditVerdict:
    """The cause from the layers, first red first.

    Args:
        settings: Limits.
        semantics: Clocks and calibration.
        replayed: Replays; none leaves the label layer open, which `modes` then answers.
        counts: Support and modes.
        persistence: Identity over time.
        strata: Tests of recorded variables.
        modes: Modes of the phase with most situations.
    """
    return (
        _data(settings, semantics)
        or _labels(settings, replayed)
        or _support(settings, counts)
        or _structure(settings, counts, persistence)
        or _explained(settings, strata)
        or _validity(settings, modes)
        or AuditVerdict(
            Cause.VALID_MODES,
            "",
            "",
            "Train the simple baselines on this dataset and see whether they lose the modes.",
        )
    )


def _data(settings: AuditSettings, semantics: Semantics) -> AuditVerdict | None:
    for clock in semantics.clocks:
        offset = clock.offset_before_s
        if offset is not None and not settings.clock_limit_s - abs(offset) >= 0:
            return AuditVerdict(
                Cause.DATA_DEFECT,
                clock.stream,
                "clock",
                f"Correct the clock of stream {clock.stream} in epoch {clock.epoch or '-'} "
                f"({offset:+.3f} s), ingest again and repeat the audit.",
            )
    if semantics.negative_delays:
        return AuditVerdict(
            Cause.DATA_DEFECT,
            "",
            "clock",
            f"{semantics.negative_delays} samples were received before they happened: put both "
            "times on one clock and ingest again.",
        )
    for calibration in semantics.calibrations:
        known = calibration.residual_m == calibration.residual_m
        if known and not settings.calibration_limit_m - calibration.residual_m >= 0:
            return AuditVerdict(
                Cause.DATA_DEFECT,
                calibration.epoch,
                "calibration",
                f"Recalibrate or leave out epoch {calibration.epoch}: its releases lie "
                f"{calibration.residual_m * 1e3:.1f} mm from those of the others.",
            )
    return None


def _labels(settings: AuditSettings, replayed: tuple[Replayed, ...]) -> AuditVerdict | None:
    wrong, n, upper = disagreement(replayed)
    if n == 0 or settings.label_disagreement_limit - upper >= 0:
        return None
    if wrong == 0:
        return AuditVerdict(
            Cause.INSUFFICIENT_SUPPORT,
            "outcome",
            "replay",
            f"Replay more episodes: {n} without a disagreement only show a share below "
            f"{upper:.3f}.",
        )
    return AuditVerdict(
        Cause.LABEL_CONTAMINATION,
        "outcome",
        "replay",
        f"{wrong} of {n} labels disagree with the replay: label again from the replay and repeat "
        "the audit.",
    )


def _support(settings: AuditSettings, counts: Counts) -> AuditVerdict | None:
    share = counts.analysed / counts.queries if counts.queries else 0.0
    if counts.analysed_episodes >= settings.minimum_situations:
        if share - settings.minimum_support_share >= 0:
            return None
        return AuditVerdict(
            Cause.INSUFFICIENT_SUPPORT,
            "",
            "neighbourhoods",
            f"Only {share:.0%} of the held-out situations have enough comparable training "
            f"episodes ({settings.minimum_support_share:.0%} needed): record more, from fewer "
            "starts.",
        )
    return AuditVerdict(
        Cause.INSUFFICIENT_SUPPORT,
        "",
        "neighbourhoods",
        f"Only {counts.analysed_episodes} held-out episodes have enough comparable training "
        f"episodes ({settings.minimum_situations} needed): record more, from fewer starts.",
    )


def _structure(
    settings: AuditSettings, counts: Counts, persistence: Persistence
) -> AuditVerdict | None:
    if counts.two_mode_episodes < settings.minimum_two_mode_situations:
        white = counts.noise_ratio >= POINTWISE_RATIO
        if white and counts.noise_spread >= settings.noise_floor_m:
            return _noise("The spread is noise from action to action")
        decided = counts.resolved > counts.two_mode
        return AuditVerdict(
            Cause.UNIMODAL,
            "",
            "observation_decides" if decided else "",
            "Use the simple baselines: one observation has one action here.",
        )
    if persistence.n < settings.minimum_two_mode_situations:
        return AuditVerdict(
            Cause.INSUFFICIENT_SUPPORT,
            "",
            "persistence",
            f"Only {persistence.n} situations with several modes go on long enough to see whether "
            "the modes persist: record more, from fewer starts.",
        )
    if not persistence.observed - persistence.null_q95 >= 0:
        return _noise("Clusters do not persist over a chunk")
    return None


def _explained(settings: AuditSettings, strata: tuple[Stratum, ...]) -> AuditVerdict | None:
    found = [
        row
        for row in strata
        if row.p_adjusted is not None
        and row.effect is not None
        and row.p_adjusted <= settings.strata_alpha
        and not settings.strata_effect_limit - row.effect >= 0
    ]
    if not found:
        return None
    row = max(found, key=lambda item: (item.effect or 0.0, item.variable))
    share = f"{row.variable} explains {row.effect or 0.0:.0%} of the modes in {row.phase}"
    if row.variable in DATA_VARIABLES:
        return AuditVerdict(
            Cause.DATA_DEFECT, row.variable, row.variable, f"{share}: correct the epochs."
        )
    if row.observed:
        return AuditVerdict(
            Cause.UNIMODAL,
            row.variable,
            "observed_variable",
            f"{share}, and the policy sees it: use the simple baselines.",
        )
    return AuditVerdict(
        Cause.HIDDEN_STATE,
        row.variable,
        "stratum",
        f"{share}: add it to the observation or standardise it, then repeat the audit.",
    )


def _validity(settings: AuditSettings, modes: tuple[ModeOutcome, ...]) -> AuditVerdict | None:
    if len(modes) < 2:
        return AuditVerdict(
            Cause.INSUFFICIENT_SUPPORT,
            "",
            "linking",
            "The situations overlap too little to follow a mode: record more, from fewer starts.",
        )
    if all(mode.episodes == 0 for mode in modes):
        return AuditVerdict(
            Cause.INSUFFICIENT_SUPPORT,
            "outcome",
            "not_recorded",
            "Record whether each episode succeeded: without it no mode can be called valid.",
        )
    valid = [
        mode
        for mode in modes
        if mode.success_lower - settings.mode_success_limit >= 0
        and (
            mode.checked == 0 or mode.admissible / mode.checked - settings.mode_feasible_limit >= 0
        )
    ]
    if len(valid) >= 2:
        return None
    weak = ", ".join(mode.mode for mode in modes if mode not in valid)
    return AuditVerdict(
        Cause.UNIMODAL,
        weak,
        "one_valid_mode",
        f"Leave out the episodes of {weak}, which do not succeed or are not feasible often "
        "enough; what remains has one mode.",
    )


def _noise(what: str) -> AuditVerdict:
    return AuditVerdict(
        Cause.POINTWISE_NOISE,
        "",
        "",
        f"{what}: use chunked behaviour cloning, which averages it out.",
    )
