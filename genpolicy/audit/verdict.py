"""The cause: the first red layer in the order of diagnosis decides, and says what to do next.

Order: clocks and frames, calibration, labels, support, modes at all, persistence, recorded
variables, validity of each mode. A later layer is not believed while an earlier one is red.
"""

from dataclasses import dataclass, replace
from enum import StrEnum

from genpolicy.audit.labels import ModeOutcome, Replayed, disagreement
from genpolicy.audit.persistence import POINTWISE_RATIO, Persistence
from genpolicy.audit.semantics import Semantics
from genpolicy.audit.settings import AuditSettings
from genpolicy.audit.strata import HISTORY, SEQUENCE, Stratum

DATA_VARIABLES = ("calibration_epoch",)
# Which variable to name when several explain the modes equally well, most concrete first; all
# others (observed ones) come before the last three, which anything else may shine through.
CONCRETE = (
    "phase", "object", "operator", "calibration_epoch", "episode_order", SEQUENCE,
    "time_in_episode", HISTORY,
)  # fmt: skip
VAGUE = 3
NEARLY = 0.15
# Time and the past show whatever else was recorded: they must explain this much more to be named.
EVERYTHING = ("time_in_episode", HISTORY)
SHINES = 0.3


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
        needed_episodes: How many it takes to speak of modes.
        resolved: Situations with clusters that are not claimed as modes: an observed component
            tells them apart, or they are too few in their phase.
        incoherent: Situations with clusters in phases where they do not persist.
        persistent: Situations with several modes that persist.
        noise_ratio: Median von Neumann ratio of the spread inside situations: 1 white, 0 smooth.
        noise_spread: Median spread inside situations, unit of the position.
    """

    queries: int
    analysed: int
    analysed_episodes: int
    two_mode: int
    two_mode_episodes: int
    needed_episodes: int
    resolved: int
    incoherent: int
    persistent: int
    noise_ratio: float
    noise_spread: float


class Layer(StrEnum):
    """The layers of the diagnosis, in the order in which they are believed."""

    DATA = "data"
    LABELS = "labels"
    SUPPORT = "support"
    STRUCTURE = "structure"
    HIDDEN = "hidden"
    VALIDITY = "validity"
    NONE = "none"


@dataclass(frozen=True)
class AuditVerdict:
    """Cause, the variable or the kind that it names (else empty), and what to do next.

    `layer` is the first red one, `none` where all are green.
    """

    cause: Cause
    variable: str
    kind: str
    next_action: str
    layer: Layer = Layer.NONE


@dataclass(frozen=True)
class Layers:
    """What the layers measured.

    Attributes:
        semantics: Clocks, frames, calibration.
        replayed: Replays; none leaves the label layer open, which `modes` then answers.
        counts: Support and modes.
        persistence: Identity over time.
        strata: Tests of recorded variables and of the past.
        modes: Modes of the phase with most situations.
    """

    semantics: Semantics
    replayed: tuple[Replayed, ...]
    counts: Counts
    persistence: Persistence
    strata: tuple[Stratum, ...]
    modes: tuple[ModeOutcome, ...]


def decide(settings: AuditSettings, layers: Layers) -> AuditVerdict:
    """The cause from the layers, first red first.

    Args:
        settings: Limits.
        layers: What was measured.
    """
    found = (
        (Layer.DATA, _data(layers.semantics)),
        (Layer.LABELS, _labels(settings, layers.replayed)),
        (Layer.SUPPORT, _support(settings, layers.counts)),
        (Layer.STRUCTURE, _structure(settings, layers.counts, layers.persistence)),
        (Layer.HIDDEN, _explained(settings, layers.strata)),
        (Layer.VALIDITY, _validity(settings, layers.modes)),
    )
    for layer, verdict in found:
        if verdict is not None:
            return replace(verdict, layer=layer)
    return AuditVerdict(
        Cause.VALID_MODES,
        "",
        "",
        "Train the simple baselines on this dataset and see whether they lose the modes.",
    )


def _data(semantics: Semantics) -> AuditVerdict | None:
    if not semantics.defects:
        return None
    first = semantics.defects[0]
    return AuditVerdict(Cause.DATA_DEFECT, first.variable, first.kind, first.action)


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
    loud = counts.noise_spread >= settings.noise_floor_m
    white = counts.noise_ratio >= POINTWISE_RATIO and loud
    unseen = persistence.n < settings.minimum_two_mode_situations
    if white and (unseen or counts.two_mode_episodes < counts.needed_episodes):
        return _absent(settings, counts, white=True)
    if counts.two_mode_episodes < counts.needed_episodes:
        return _absent(settings, counts, white=False)
    if unseen:
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


def _absent(settings: AuditSettings, counts: Counts, *, white: bool) -> AuditVerdict:
    """No modes were found; is that enough to say that there are none?"""
    share = counts.analysed / counts.queries if counts.queries else 0.0
    if not share - settings.minimum_absence_share >= 0:
        return AuditVerdict(
            Cause.INSUFFICIENT_SUPPORT,
            "",
            "neighbourhoods",
            f"No modes were found in the {share:.0%} of the held-out situations that have enough "
            "comparable training episodes; the others may hold some "
            f"({settings.minimum_absence_share:.0%} needed to deny it): record more, from fewer "
            "starts.",
        )
    if white:
        return _noise("The spread is noise from action to action")
    if counts.incoherent >= settings.minimum_two_mode_situations:
        return _noise("Clusters do not persist over a chunk")
    decided = counts.resolved > counts.two_mode
    return AuditVerdict(
        Cause.UNIMODAL,
        "",
        "observation_decides" if decided else "",
        "Use the simple baselines: one observation has one action here.",
    )


def _explained(settings: AuditSettings, strata: tuple[Stratum, ...]) -> AuditVerdict | None:
    found = [
        row
        for row in strata
        if row.p_adjusted is not None
        and row.effect is not None
        and row.p_adjusted <= settings.strata_alpha
        and not settings.strata_effect_limit - row.effect >= 0
        and (row.effect_lower or 0.0) - settings.strata_lower_limit >= 0
    ]
    if not found:
        return None
    row = _foremost(found)
    share = f"{row.variable} explains {row.effect or 0.0:.0%} of the modes in {row.phase}"
    if row.variable in DATA_VARIABLES:
        return AuditVerdict(
            Cause.DATA_DEFECT, row.variable, row.variable, f"{share}: correct the epochs."
        )
    if row.variable == SEQUENCE:
        return AuditVerdict(
            Cause.HIDDEN_STATE,
            "unrecorded",
            SEQUENCE,
            f"The mode of {row.phase} follows from those of the episodes recorded just before and "
            f"after ({row.effect or 0.0:.0%}): find out what was decided per session or in turns, "
            "record it, or draw it anew for every episode, then repeat the audit.",
        )
    if row.variable == HISTORY:
        return AuditVerdict(
            Cause.HIDDEN_STATE,
            "unrecorded",
            HISTORY,
            f"The past explains {row.effect or 0.0:.0%} of the modes in "
            f"{row.phase} ({row.detail}): "
            "record what was decided there, or lengthen the observation history, then repeat the "
            "audit.",
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


def _foremost(found: list[Stratum]) -> Stratum:
    """The variable to name: the strongest, and of nearly equal ones the most concrete."""
    best = max((row.effect or 0.0) - SHINES * (row.variable in EVERYTHING) for row in found)
    equal = [row for row in found if (row.effect or 0.0) >= best - NEARLY]

    def rank(row: Stratum) -> tuple[int, float, str]:
        name = row.variable
        place = CONCRETE.index(name) if name in CONCRETE else len(CONCRETE) - VAGUE
        return place, -(row.effect or 0.0), name

    return min(equal, key=rank)


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
