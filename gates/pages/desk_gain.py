"""What the reader is asked about, in numbers: the promoted policy against the best simple one."""

from collections.abc import Mapping

from pydantic import ValidationError

from gates.bounds import mean_gain
from gates.evidence import Evidence, MissingEvidenceError, flags
from gates.pages.bound import require_bound
from gates.report import Gate, GateReport
from gates.stress.gate import best_baseline
from gates.stress.pairs import paired_differences
from gates.stress.recoveries import RECOVERIES
from gates.stress.rollouts import ROLLOUTS, StressSettings, rollouts
from gates.stress.utility import mean_worth
from gates.stress.weights import RECOVERY, by_cost, listed
from gates.words import share_of
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
        settings = StressSettings.model_validate(report.settings, strict=False)
        require_bound(evidence, report, ROLLOUTS)
        if RECOVERY in by_cost(settings.utility):
            require_bound(evidence, report, RECOVERIES)
        return _said(report.promoted, evidence, settings)
    except (MissingEvidenceError, ValidationError):
        return ""


def _said(promoted: str, evidence: Evidence, settings: StressSettings) -> str:
    best = best_baseline(evidence, settings)
    differences = paired_differences(evidence, settings, promoted, best)
    # As the promotion is tested, so that a gain that it shows is one that stands here.
    low, high = gain_interval(differences, alpha=settings.alpha)
    by, worth, of = "", "", ""
    if settings.utility:
        means = [
            mean_worth(evidence, settings, method, rollouts(evidence, settings, method))
            for method in (promoted, best)
        ]
        by, of = " by utility", " of utility"
        worth = (
            f". As utility, a success less {listed(settings.utility)}, that is worth "
            f"{means[0]:.3g} against {means[1]:.3g}"
        )
    return (
        f"{promoted} succeeds in {_won(evidence, settings, promoted)}, the best simple policy"
        f"{by}, {best}, in {_won(evidence, settings, best)}{worth}: "
        f"{_points(mean_gain(differences))} points{of} on "
        f"the same {len(differences)} starts in {len(settings.perturbations)} conditions, between "
        f"{_points(low)} and {_points(high)} (each end wrong with at most "
        f"{100 * settings.alpha:.3g} %); more than {_points(settings.margin)} had to be shown."
    )


def _won(evidence: Evidence, settings: StressSettings, method: str) -> str:
    won = flags(rollouts(evidence, settings, method), "success")
    return share_of(float(won.sum()), len(won))


def _points(share: float) -> str:
    """A share in points, with its sign; a true minus."""
    return f"{100 * share:+.3g}".replace("-", "−")
