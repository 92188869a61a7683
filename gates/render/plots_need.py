"""Figures of Gate A: modes and their mean, strata, success per mode, baselines."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from gates.evidence import Evidence, MissingEvidenceError, flags, numbers
from gates.models import GateReport
from gates.need import AUDIT, BASELINES
from gates.render.figures import BLUE, GREEN, GREY, INK, ORANGE, RED, Plot, new_figure
from gates.render.limits import draw_limit
from genpolicy.statistics.intervals import clopper_pearson

FANS = 24


def _overlay(evidence: Evidence, report: GateReport) -> Figure:
    path = f"{AUDIT}/neighbourhoods.parquet"
    columns = ("split", "two_mode", "mean_admissible", "mean_path", "mode_paths")
    frame = evidence.frame(path, *columns)
    frame = frame[flags(frame, "two_mode")].head(FANS)
    if len(frame) == 0:
        raise MissingEvidenceError("no situation has two modes")
    figure, (axes,) = new_figure(height=3.6)
    for _, row in frame.iterrows():
        for flat in row["mode_paths"]:
            line = np.asarray(flat, dtype=np.float64).reshape(-1, 3)
            left = line[:, 1].mean() > line[0, 1]
            axes.plot(line[:, 0], line[:, 1], color=BLUE if left else ORANGE, alpha=0.55, lw=1.2)
        mean = np.asarray(row["mean_path"], dtype=np.float64).reshape(-1, 3)
        rejected = row["mean_admissible"] is not True and not bool(row["mean_admissible"])
        axes.plot(mean[:, 0], mean[:, 1], color=RED if rejected else GREEN, ls="--", lw=1.4)
    for obstacle in _obstacles(evidence):
        place = (float(obstacle["x_m"]), float(obstacle["y_m"]))
        axes.add_patch(Circle(place, float(obstacle["radius_m"]), color=INK, alpha=0.8))
    for colour, style, label in (
        (BLUE, "-", "mode, left"),
        (ORANGE, "-", "mode, right"),
        (RED, "--", "mean, rejected"),
        (GREEN, "--", "mean, admissible"),
    ):
        axes.plot([], [], color=colour, ls=style, label=label)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x, m (base frame)")
    axes.set_ylabel("y, m")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _obstacles(evidence: Evidence) -> list[dict[str, float]]:
    try:
        found = evidence.document(f"{AUDIT}/summary.json").get("obstacles", [])
    except MissingEvidenceError:
        return []
    return [item for item in found if isinstance(item, dict)]


def _strata(evidence: Evidence, report: GateReport) -> Figure:
    columns = ("variable", "phase", "p_adjusted", "effect", "effect_lower", "effect_upper")
    frame = evidence.frame(f"{AUDIT}/strata.parquet", *columns)
    frame = frame.sort_values(["effect", "variable", "phase"]).tail(24)
    effect, adjusted = numbers(frame, "effect"), numbers(frame, "p_adjusted")
    level = float(report.settings.get("strata_level", 0.05))
    places = np.arange(len(frame))
    figure, (axes,) = new_figure(height=1.0 + 0.22 * len(frame))
    colour = [RED if p <= level else GREY for p in adjusted]
    axes.barh(places, effect, color=colour, height=0.6)
    lower, upper = (frame[f"effect_{end}"].to_numpy(dtype=np.float64) for end in ("lower", "upper"))
    axes.hlines(places, lower, upper, color=INK, lw=1.0)
    axes.set_yticks(
        places, [f"{v} · {p}" for v, p in zip(frame["variable"], frame["phase"], strict=True)]
    )
    draw_limit(axes, report, "strata_effect")
    axes.set_xlabel(f"effect size (red: adjusted p at most {level:g})")
    return figure


def _mode_success(evidence: Evidence, report: GateReport) -> Figure:
    frame = evidence.frame(f"{AUDIT}/modes.parquet", "mode", "phase", "episodes", "successes")
    frame = frame.sort_values(["phase", "mode"]).tail(24)
    trials, hits = numbers(frame, "episodes"), numbers(frame, "successes")
    level = float(report.settings.get("confidence", 0.95))
    figure, (axes,) = new_figure(height=1.0 + 0.24 * len(frame))
    for place, (n, k) in enumerate(zip(trials, hits, strict=True)):
        low, high = clopper_pearson(int(k), int(n), level)
        axes.hlines(place, low, high, color=BLUE, lw=2)
        axes.plot([k / n if n else np.nan], [place], "o", color=BLUE, ms=5)
    labels = [
        f"{mode} · {phase} (n = {int(n)})"
        for mode, phase, n in zip(frame["mode"], frame["phase"], trials, strict=True)
    ]
    axes.set_yticks(np.arange(len(frame)), labels)
    axes.set_ylim(-0.7, len(frame) - 0.3)
    axes.set_xlim(0, 1.02)
    draw_limit(axes, report, "mode_success_lower")
    axes.set_xlabel(f"share of successful episodes, exact {level:.0%} interval")
    return figure


def _baselines(evidence: Evidence, report: GateReport) -> Figure:
    columns = ("method", "convention", "modes_present", "modes_covered")
    frame = evidence.frame(f"{BASELINES}/modes.parquet", *columns)
    frame = frame[numbers(frame, "modes_present") >= 2]
    share = numbers(frame, "modes_covered") / numbers(frame, "modes_present")
    means = frame.assign(share=share).groupby(["method", "convention"])["share"].mean()
    figure, (axes,) = new_figure(height=1.0 + 0.26 * len(means))
    axes.barh(np.arange(len(means)), means.to_numpy(), color=BLUE, height=0.6)
    axes.set_yticks(np.arange(len(means)), [f"{m} · {c}" for m, c in means.index])
    axes.set_xlim(0, 1.02)
    draw_limit(axes, report, "baseline_mode_coverage")
    axes.set_xlabel("share of modes covered, two-mode situations")
    return figure


PLOTS = (
    Plot(
        "Modes and their mean, in the scene plane",
        "Solid: recorded modes of held-out situations, seen from above. Dashed: their mean chunk. "
        "A generator is needed where both fans pass and the dashed line is rejected.",
        f"{AUDIT}/neighbourhoods.parquet",
        _overlay,
    ),
    Plot(
        "What explains the modes",
        "Effect of each recorded variable on mode membership, with intervals. A red bar beyond "
        "the limit means: give this variable to the policy instead.",
        f"{AUDIT}/strata.parquet",
        _strata,
    ),
    Plot(
        "Success of each mode",
        "Point: share of successful episodes. Line: exact interval. The gate judges the lower end.",
        f"{AUDIT}/modes.parquet",
        _mode_success,
    ),
    Plot(
        "Modes that the simple policies keep",
        "A deterministic policy can cover one of two modes at most.",
        f"{BASELINES}/modes.parquet",
        _baselines,
    ),
)
