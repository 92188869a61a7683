"""Figures of Gate A: modes and their mean, strata, success per mode, baselines."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gates.evidence import Evidence, MissingEvidenceError, flags, numbers
from gates.need.kept import coverage
from gates.need.settings import AUDIT, MEASURED
from gates.pages import plots_factors, plots_scene
from gates.pages.figures import Photo, Plot, in_order
from gates.pages.limits import draw_limit, limit_of
from gates.pages.plots_scene import SUMMARY_FILE
from gates.report import GateReport
from genpolicy.audit.documents import SUMMARY
from genpolicy.audit.rows import ModeOutcome, ReplayRow, SituationRow, Stratum
from genpolicy.audit.shown_rows import Alignment, ExampleChunk
from genpolicy.evidence.rows.need import ModeRow
from genpolicy.pages.figures import captions, checks, situations
from genpolicy.pages.figures.drawing import BLUE, INK, in_percent, new_figure

EXAMPLES = f"{AUDIT}/examples.parquet"
ALIGNMENT = f"{AUDIT}/alignment.parquet"
REPLAY = f"{AUDIT}/replay.parquet"


def _plane(evidence: Evidence) -> dict[str, Any]:
    """Names and unit of the position, and the obstacles, as the audit wrote them."""
    summary = evidence.document(AUDIT, SUMMARY)
    return {
        "names": summary.position_names,
        "unit": summary.position_unit,
        "obstacles": summary.obstacles,
    }


def _clusters(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.rows(EXAMPLES, ExampleChunk, lists=True)
    return situations.clusters(frame, **_plane(evidence))


def _overlay(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.rows(f"{AUDIT}/neighbourhoods.parquet", SituationRow, lists=True)
    held_out = frame["split"].isin(report.settings.get("held_out_splits", []))
    return situations.mean_versus_modes(
        frame[held_out & flags(frame, "two_mode")], **_plane(evidence)
    )


def _realignment(evidence: Evidence, report: GateReport) -> Figure:
    summary = evidence.document(AUDIT, SUMMARY)
    frame = evidence.rows(ALIGNMENT, Alignment)
    limit_s = limit_of(report, "clock_residual_s")
    if limit_s is None:
        raise MissingEvidenceError("the report has no limit of the clock")
    return checks.realignment(
        frame,
        limit_s=limit_s,
        modes_before=summary.modes_before_realignment,
        modes_after=summary.modes_after_realignment,
    )


def _labels(evidence: Evidence, report: GateReport) -> Figure:
    return checks.label_agreement(evidence.rows(REPLAY, ReplayRow))


def _strata(evidence: Evidence, report: GateReport) -> Figure:
    return checks.strata_bars(
        evidence.rows(f"{AUDIT}/strata.parquet", Stratum),
        level=_strata_level(report),
        limit=limit_of(report, "strata_effect"),
    )


def _strata_level(report: GateReport) -> float:
    """Level at which a variable counts; the cause asks by the same limit."""
    by_owner = report.settings["cause"].values()
    return float(next(found["strata_p"][0] for found in by_owner if "strata_p" in found))


def _mode_success(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.rows(f"{AUDIT}/modes.parquet", ModeOutcome)
    return checks.mode_success(
        frame,
        confidence=float(report.settings["confidence"]),
        limit=limit_of(report, "mode_success_lower"),
    )


def _baselines(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.rows(f"{MEASURED}/modes.parquet", ModeRow)
    frame = frame[numbers(frame, "modes_present") >= 2]
    own = {(str(m), str(c)): rows for (m, c), rows in frame.groupby(["method", "convention"])}
    order = [key for name in in_order(frame["method"]) for key in own if key[0] == name]
    deployed = report.settings.get("deployed_conventions", [])
    generative = report.settings.get("generative_baselines", [])
    drawn = {key for key in order if key[1] not in deployed or key[0] in generative}
    # As `baseline_mode_coverage` judges: as many chances to keep the modes as are deployed.
    outside = 1.0 - float(report.settings["confidence"])
    level = 1.0 - outside / max(len(order) - len(drawn), 1)
    figure, (axes,) = new_figure(height=1.0 + 0.3 * len(order))
    labels = []
    for place, key in enumerate(order):
        share, lower, upper = coverage(own[key], level)
        axes.barh(
            place,
            share,
            color="white" if key in drawn else BLUE,
            edgecolor=BLUE,
            hatch="//" if key in drawn else "",
            height=0.6,
        )
        axes.hlines(place, lower, upper, color=INK, lw=1.5)
        episodes = own[key]["episode_uuid"].nunique()
        labels.append(f"{key[0]} · {key[1]} (n = {episodes})")
    axes.set_yticks(np.arange(len(order)), labels)
    axes.invert_yaxis()
    axes.set_xlim(0, 1.02)
    in_percent(axes.xaxis)
    draw_limit(axes, report, "baseline_mode_coverage")
    axes.set_xlabel("mean share of modes covered, situations with two modes; n episodes")
    return figure


PLOTS: tuple[Plot | Photo, ...] = (
    *plots_scene.PLOTS,
    Plot(
        *captions.CLUSTERS,
        EXAMPLES,
        _clusters,
        also=(SUMMARY_FILE,),
    ),
    Plot(
        "Modes and their mean, in the scene plane",
        "Solid: the next chunk of nearest neighbours, one line per mode. Dashed: the mean of the "
        "modes, which is what a policy trained by regression tends to. A generator is needed "
        "where both fans pass and the mean is refused. Lines are the tool centre; gripper and "
        "held object are wider, so a mean beside the obstacle may still hit it.",
        f"{AUDIT}/neighbourhoods.parquet",
        _overlay,
        also=(SUMMARY_FILE,),
    ),
    Plot(
        *captions.REALIGNMENT,
        ALIGNMENT,
        _realignment,
        also=(SUMMARY_FILE,),
    ),
    Plot(
        *captions.STRATA,
        f"{AUDIT}/strata.parquet",
        _strata,
    ),
    Plot(
        "Success of each mode",
        "Point: share of successful episodes that took this mode. Line: exact interval. The gate "
        "judges the lower end. The audit numbers the modes m0, m1 and so on.",
        f"{AUDIT}/modes.parquet",
        _mode_success,
    ),
    Plot(
        *captions.LABELS,
        REPLAY,
        _labels,
    ),
    Plot(
        "Modes that the simple policies keep",
        "Share of the modes of a held-out situation that a policy's admissible samples reach. A "
        "deterministic policy reaches one of two at most, which is 50 %; less means that it lands "
        "between them or is refused. Line: interval over episodes (n), its level divided among the "
        "deployed conventions, as the gate judges. Judged is the upper end of the best baseline "
        "as it is deployed (solid bars); hatched bars draw at random, as a generator does.",
        f"{MEASURED}/modes.parquet",
        _baselines,
    ),
    *plots_factors.PLOTS,
)
