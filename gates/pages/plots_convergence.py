"""Figure of Gate B about training: was it done, for candidates and what they are held against?"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gates.evidence import Array, Evidence, MissingEvidenceError
from gates.need.settings import TRAINED as BASELINES
from gates.pages.figures import Plot, Table, in_order, line_looks
from gates.pages.limits import draw_limit, limit_of
from gates.report import GateReport
from gates.reproducibility.convergence import losses, updates_of
from gates.reproducibility.settings import GENERATORS
from gates.words import percent, share_between
from genpolicy.pages.figures.drawing import GREY, in_percent, new_figure
from genpolicy.policies.validation_row import VALIDATION_FILE, three_quarters
from genpolicy.statistics.ratios import ratio_of_sums

LIMIT = "baseline_fall_upper"
MATCHED = "matched.json"
Interval = tuple[float, float, float]


@dataclass(frozen=True)
class Training:
    """Validation loss of one training, over that of the first measurement.

    Attributes:
        method: The method.
        candidate: Whether the limit on the loss judges it not: a candidate.
        table: Where it stands.
        after: Updates after which it was measured. Shape (n,).
        loss: Loss after each, over the first. Shape (n,).
        moments: Three quarters of the training, and its end.
        spread: At both: ratio, lower and upper end.
        fall: Share by which it falls between them, lower and upper end.
    """

    method: str
    candidate: bool
    table: str
    after: Array
    loss: Array
    moments: tuple[int, int]
    spread: tuple[Interval, Interval]
    fall: Interval


def _trainings(evidence: Evidence, report: GateReport) -> Iterator[Training]:
    """Those that the two criteria of convergence judge."""
    settings = report.settings
    compared = {settings["budget_reference"], *settings["baselines"]}
    confidence = float(settings["confidence"])
    for root in (BASELINES, GENERATORS):
        tables = evidence.bind(f"{root}/*/seed_*/{VALIDATION_FILE}")
        methods = in_order(path.split("/")[-3] for path in tables)
        for method in methods if root == GENERATORS else filter(compared.__contains__, methods):
            updates = updates_of(evidence, root, method)
            moments = (three_quarters(updates), updates)
            for table, frame in losses(evidence, root, method).items():
                after = sorted(int(count) for count in frame["total"].columns)
                total = {s: frame["total"][s].to_numpy(dtype="float64") for s in after}
                if not set(moments) <= set(after):
                    raise MissingEvidenceError(f"{table} lacks the loss after {moments}")
                first = total[after[0]]
                at = [ratio_of_sums(total[m], first, confidence=confidence) for m in moments]
                ratio, lower, upper = ratio_of_sums(
                    total[updates], total[moments[0]], confidence=confidence
                )
                yield Training(
                    method=method,
                    candidate=root == GENERATORS,
                    table=table,
                    after=np.array(after, dtype=np.float64),
                    loss=np.array([total[s].sum() / first.sum() for s in after]),
                    moments=moments,
                    spread=(at[0], at[1]),
                    fall=(1.0 - ratio, 1.0 - upper, 1.0 - lower),
                )


def _convergence(evidence: Evidence, report: GateReport) -> Figure:
    found = list(_trainings(evidence, report))
    if not found:
        raise MissingEvidenceError("validation.parquet of every training is missing")
    names = [training.method for training in found]
    looks = line_looks(names)
    figure, (losses_of, falls) = new_figure(height=1.9 + 0.24 * len(found), columns=2)
    for place, training in enumerate(found):
        look = looks[training.method]
        at = [int(np.argmin(np.abs(training.after - moment))) for moment in training.moments]
        losses_of.plot(training.after, training.loss, markevery=at, **look)
        for moment, (point, lower, upper) in zip(training.moments, training.spread, strict=True):
            losses_of.errorbar(
                [moment], [point], yerr=[[point - lower], [upper - point]], fmt="none",
                capsize=2, color=look["color"],
            )  # fmt: skip
        _fall(falls, place, training, look)
    for moment in sorted({training.moments[0] for training in found}):
        losses_of.axvline(moment, color=GREY, lw=0.8)
    losses_of.set_ylim(bottom=0.0)
    losses_of.set_xlabel("updates (line: three quarters)")
    losses_of.set_ylabel("validation loss, over its first")
    labels = [f"{t.method}{' (by samples)' if t.candidate else ''}" for t in found]
    falls.set_yticks(np.arange(len(found)), labels)
    falls.set_ylim(len(found) - 0.4, -0.9)
    falls.axvline(0.0, color=GREY, lw=0.8)
    falls.set_xlabel(f"fall, {100 * report.settings['confidence']:g} % interval")
    in_percent(falls.xaxis)
    draw_limit(falls, report, LIMIT)
    # The names at the right stand at rows of another panel, which says nothing of these curves.
    for name in in_order(names):
        losses_of.plot([], [], label=name, **looks[name])
    figure.legend(loc="outside lower center", ncols=4)
    return figure


def _fall(axes: Axes, place: int, training: Training, look: Mapping[str, Any]) -> None:
    point, lower, upper = training.fall
    axes.hlines(place, lower, upper, color=look["color"], lw=2)
    face = "white" if training.candidate else look["color"]
    axes.plot([point], [place], **{**look, "ls": "", "ms": 5}, markerfacecolor=face)


def _table(evidence: Evidence, report: GateReport) -> Table:
    limit = limit_of(report, LIMIT)
    heads = (
        "method", "updates", "loss at three quarters, over its first", "at the end",
        "fall over the last quarter", "its limit", "from",
    )  # fmt: skip
    rows = [
        (
            training.method, f"{training.moments[1]}", *map(_text, training.spread),
            share_between(*training.fall),
            "asked by samples" if training.candidate or limit is None else percent(limit),
            training.table,
        )
        for training in _trainings(evidence, report)
    ]  # fmt: skip
    return (heads, *rows)


def _text(interval: Interval) -> str:
    return f"{interval[0]:.3g} ({interval[1]:.3g} to {interval[2]:.3g})"


PLOTS = (
    Plot(
        "Was the training done?",
        "Left: loss of the averaged weights on held-out episodes, each method its own loss, over "
        "that after its first measured updates; interval over episodes at three quarters and "
        "at the end. Right: by how much it falls in between. The limit is that of "
        f"{LIMIT} and judges what candidates are compared with (filled). A candidate (hollow) "
        "is asked by its samples, late_change_upper: the loss of a density goes on falling when "
        "its samples have long ceased to change. Drawn from validation.parquet beside each "
        "checkpoint.",
        f"{GENERATORS}/{MATCHED}",
        _convergence,
        also=(f"{BASELINES}/{MATCHED}",),
        read=_table,
    ),
)
