"""Figures of Gate A: modes and their mean, strata, success per mode, baselines."""

import numpy as np
from matplotlib.figure import Figure

from gates.evidence import Evidence, MissingEvidenceError, flags, numbers
from gates.models import GateReport
from gates.need import AUDIT, BASELINES
from gates.render import plots_scene
from gates.render.figures import Photo, Plot, in_order
from gates.render.limits import draw_limit
from gates.render.plots_scene import SUMMARY, draw_obstacles
from genpolicy.figures.drawing import BLUE, GREEN, GREY, INK, ORANGE, RED, new_figure
from genpolicy.statistics.intervals import clopper_pearson

FANS = 24


def _overlay(evidence: Evidence, report: GateReport) -> Figure:
    path = f"{AUDIT}/neighbourhoods.parquet"
    columns = ("split", "two_mode", "mean_admissible", "mean_reason", "mean_path", "mode_paths")
    frame = evidence.frame(path, *columns)
    held_out = frame["split"].isin(report.settings.get("held_out_splits", []))
    frame = frame[held_out & flags(frame, "two_mode")]
    total = len(frame)
    if total == 0:
        raise MissingEvidenceError("no held-out situation has two modes")
    frame = frame.iloc[np.unique(np.linspace(0, total - 1, FANS).round().astype(int))]
    figure, (axes,) = new_figure(height=3.7)
    draw_obstacles(axes, evidence)
    counts = {GREEN: 0, RED: 0}
    for _, row in frame.iterrows():
        for flat in row["mode_paths"]:
            line = np.asarray(flat, dtype=np.float64).reshape(-1, 3)
            left = line[:, 1].mean() > line[0, 1]
            axes.plot(line[:, 0], line[:, 1], color=BLUE if left else ORANGE, alpha=0.55, lw=1.2)
        mean = np.asarray(row["mean_path"], dtype=np.float64).reshape(-1, 3)
        rejected = row["mean_admissible"] is not True and not bool(row["mean_admissible"])
        colour = RED if rejected else GREEN
        counts[colour] += 1
        axes.plot(mean[:, 0], mean[:, 1], color=colour, ls="--", lw=1.4)
    reasons = sorted({str(reason) for reason in frame["mean_reason"].dropna()} - {""})
    for colour, style, label in (
        (BLUE, "-", "mode, to larger y"),
        (ORANGE, "-", "mode, to smaller y"),
        (RED, "--", f"mean, refused: {counts[RED]} of {len(frame)}"),
        (GREEN, "--", f"mean, admissible: {counts[GREEN]} of {len(frame)}"),
    ):
        axes.plot([], [], color=colour, ls=style, label=label)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(f"{len(frame)} of {total} held-out situations with two modes, from above")
    axes.set_xlabel("x, m (base frame)")
    axes.set_ylabel("y, m")
    title = "means are refused for\n" + "\n".join(reasons[:4]) if reasons else ""
    legend = axes.legend(
        loc="center left", bbox_to_anchor=(1.0, 0.5), title=title, alignment="left"
    )
    legend.get_title().set_fontsize(8)
    return figure


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
    axes.set_xlabel(f"share of uncertainty removed (red: adjusted p at most {level:g})")
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
    means = (
        frame.assign(share=share).groupby(["method", "convention"])["share"].agg(["mean", "size"])
    )
    deployed = report.settings.get("deployed_conventions", [])
    order = [key for name in in_order(frame["method"]) for key in means.index if key[0] == name]
    figure, (axes,) = new_figure(height=1.0 + 0.3 * len(order))
    for place, (method, convention) in enumerate(order):
        drawn = convention not in deployed
        axes.barh(
            place,
            float(means.loc[(method, convention), "mean"]),
            color="white" if drawn else BLUE,
            edgecolor=BLUE,
            hatch="//" if drawn else "",
            height=0.6,
        )
    labels = [f"{m} · {c} (n = {int(means.loc[(m, c), 'size'])})" for m, c in order]
    axes.set_yticks(np.arange(len(order)), labels)
    axes.invert_yaxis()
    axes.set_xlim(0, 1.02)
    draw_limit(axes, report, "baseline_mode_coverage")
    axes.set_xlabel("mean share of modes covered, situations with two modes")
    return figure


PLOTS: tuple[Plot | Photo, ...] = (
    *plots_scene.PLOTS,
    Plot(
        "Modes and their mean, in the scene plane",
        "Solid: the next chunk of nearest neighbours, one line per mode. Dashed: the mean of the "
        "modes, which is what a policy trained by regression tends to. A generator is needed "
        "where both fans pass and the mean is refused. Lines are the tool centre; gripper and "
        "held object are wider, so a mean beside the obstacle may still hit it.",
        f"{AUDIT}/neighbourhoods.parquet",
        _overlay,
        also=(SUMMARY,),
    ),
    Plot(
        "What explains the modes",
        "Share of the uncertainty (entropy) about the mode that each recorded variable removes: "
        "bar the estimate, line its interval. Grey: not significant after Holm's correction. A "
        "red bar beyond the limit means: give this variable to the policy instead.",
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
        "Modes that the simple policies keep",
        "Share of the modes of a held-out situation that a policy's samples reach. A deterministic "
        "policy reaches one of two at most, which is 0.5; less means that it lands between them. "
        "Judged is the best baseline as it is deployed (solid bars); hatched bars draw at random, "
        "as a generator does.",
        f"{BASELINES}/modes.parquet",
        _baselines,
    ),
)
