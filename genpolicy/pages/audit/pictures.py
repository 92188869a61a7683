"""The figures of the audit's page: each drawn from one table, or with the reason why it is not."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

from matplotlib.figure import Figure

from genpolicy.pages.audit.evidence import AuditEvidence
from genpolicy.pages.audit.origins import short_name
from genpolicy.pages.figures import captions, checks, situations
from genpolicy.pages.figures.drawing import Picture, drawn
from genpolicy.pages.figures.situations import NothingToDrawError

Limits = Mapping[str, float]


@dataclass(frozen=True)
class Plot:
    """A figure that can be drawn from the evidence."""

    title: str
    caption: str
    source: str
    draw: Callable[[AuditEvidence, Limits], Figure]


def draw_all(evidence: AuditEvidence, limits: Limits) -> list[Picture]:
    """Every figure; what is missing is said, never left out in silence.

    Args:
        evidence: What is drawn.
        limits: Limits of the cause, by question.
    """
    pictures = []
    for number, plot in enumerate(PLOTS):
        source = (f"evidence/{plot.source}.parquet",)
        try:
            shape = drawn(partial(plot.draw, evidence, limits), plot.title, salt=f"audit{number}")
        except NothingToDrawError as error:
            pictures.append(Picture(plot.title, plot.caption, source, skipped=str(error)))
        else:
            pictures.append(Picture(plot.title, plot.caption, source, svg=shape))
    return pictures


def _clusters(evidence: AuditEvidence, limits: Limits) -> Figure:
    summary, examples = evidence.summary, evidence["examples"]
    figure = situations.clusters(
        examples,
        names=summary.position_names,
        unit=summary.position_unit,
        obstacles=summary.obstacles,
    )
    for axes in figure.axes:
        title = axes.get_title("left")  # the place of titles in the figures' style
        if title:
            told = _in_users_words(title, evidence)
            axes.set_title(told, loc="left", fontsize=9, parse_math=False)
    return figure


def _in_users_words(title: str, evidence: AuditEvidence) -> str:
    """A title that begins with the first digits of an identifier, with the episode's own name."""
    for uuid in set(evidence["examples"]["query_uuid"]) & set(evidence.origins):
        start = f"{uuid[:8]}, "
        if title.startswith(start):
            return f"{short_name(evidence.origins[uuid])}\n{title.removeprefix(start)}"
    return title


def _overlay(evidence: AuditEvidence, limits: Limits) -> Figure:
    frame, summary = evidence["neighbourhoods"], evidence.summary
    return situations.mean_versus_modes(
        frame[frame["two_mode"].astype(bool)],
        names=summary.position_names,
        unit=summary.position_unit,
        obstacles=summary.obstacles,
    )


def _strata(evidence: AuditEvidence, limits: Limits) -> Figure:
    return checks.strata_bars(
        evidence["strata"], level=limits["strata_p"], limit=limits["strata_effect"]
    )


def _modes(evidence: AuditEvidence, limits: Limits) -> Figure:
    limit = limits["mode_success_lower"]
    return checks.mode_success(evidence["modes"], confidence=evidence.coverage, limit=limit)


def _realignment(evidence: AuditEvidence, limits: Limits) -> Figure:
    summary = evidence.summary
    return checks.realignment(
        evidence["alignment"],
        limit_s=limits["clock_residual_s"],
        modes_before=summary.modes_before_realignment,
        modes_after=summary.modes_after_realignment,
    )


def _labels(evidence: AuditEvidence, limits: Limits) -> Figure:
    return checks.label_agreement(evidence["replay"])


def _support(evidence: AuditEvidence, limits: Limits) -> Figure:
    summary = evidence.summary
    return checks.support_map(
        evidence["support"],
        names=summary.position_names,
        unit=summary.position_unit,
        limit=limits["supported_share"],
    )


PLOTS: tuple[Plot, ...] = (
    Plot(
        *captions.CLUSTERS,
        "examples",
        _clusters,
    ),
    Plot(
        "The mean and the modes",
        "Solid: the next chunk of nearest neighbours, one line per mode. Dashed: the mean of "
        "the modes, which is what a policy trained by regression tends to. Lines are the "
        "commanded position; what moves along them is wider.",
        "neighbourhoods",
        _overlay,
    ),
    Plot(
        *captions.REALIGNMENT,
        "alignment",
        _realignment,
    ),
    Plot(
        *captions.STRATA,
        "strata",
        _strata,
    ),
    Plot(
        "Success of each mode",
        "Point: share of successful episodes that took this mode. Line: exact interval; the "
        "lower end is held against the limit.",
        "modes",
        _modes,
    ),
    Plot(
        *captions.LABELS,
        "replay",
        _labels,
    ),
    Plot(
        "Where the data can answer",
        "Each mark is a held-out situation. Crosses: too few demonstrations came near, so "
        "nothing is said about that place.",
        "support",
        _support,
    ),
)
