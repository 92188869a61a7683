"""What the reader is asked about, in numbers: the promoted policy against the best simple one."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from gates.evidence import Evidence, MissingEvidenceError, flags
from gates.pages.bound import require_bound
from gates.report import Gate, GateReport
from gates.stress.rollouts import ROLLOUTS
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.statistics.eprocess import gain_interval


def gain_of(reports: Mapping[Gate, GateReport], evidence: Evidence) -> str:
    """One sentence of successes, the gain in points, its interval and what it rests on.

    Empty where nobody is promoted or the rollouts are not those that were judged: the first page
    says elsewhere what is missing.
    """
    report = reports.get("D")
    if report is None or report.promoted is None:
        return ""
    try:
        require_bound(evidence, report, ROLLOUTS)
        rows = evidence.rows(ROLLOUTS, RolloutRow)
        rows = rows.assign(success=flags(rows, "success"))
        return _said(report, rows[rows["perturbation"].isin(report.settings["perturbations"])])
    except (MissingEvidenceError, KeyError):
        return ""


def _said(report: GateReport, rows: pd.DataFrame) -> str:
    promoted, simple = str(report.promoted), list(report.settings["baselines"])
    best = max(simple, key=lambda name: rows[rows["method"] == name]["success"].mean())
    own, other = (_by_start(rows, name) for name in (promoted, best))
    differences = np.asarray(own - other, dtype=np.float64)
    if not len(differences) or np.any(np.isnan(differences)):
        raise MissingEvidenceError(f"{promoted} and {best} did not roll out from the same starts")
    # As the promotion is tested, so that a gain that it shows is one that stands here.
    alpha = float(report.settings["family_alpha"]) / len(report.settings["candidates"])
    low, high = gain_interval(differences, alpha=alpha)
    conditions = rows["perturbation"].nunique()
    return (
        f"{promoted} succeeds in {_share(rows, promoted)}, the best simple policy, {best}, in "
        f"{_share(rows, best)}: {_points(differences.mean())} points on the same "
        f"{len(differences)} starts in {conditions} conditions, between {_points(low)} and "
        f"{_points(high)} (each end wrong with at most {100 * alpha:.3g} %); more than "
        f"{_points(float(report.settings['margin']))} had to be shown."
    )


def _by_start(rows: pd.DataFrame, method: str) -> "pd.Series[float]":
    """Mean success of each start, over conditions and training seeds, which are no draws."""
    own = rows[rows["method"] == method].groupby(["start", "perturbation"])["success"].mean()
    return own.groupby("start").mean().sort_index()


def _share(rows: pd.DataFrame, method: str) -> str:
    own = rows[rows["method"] == method]["success"]
    return f"{100 * own.mean():.3g} % ({int(own.sum()):,} of {len(own):,})"


def _points(share: float) -> str:
    """A share in points, with its sign; a true minus."""
    return f"{100 * share:+.3g}".replace("-", "−")
