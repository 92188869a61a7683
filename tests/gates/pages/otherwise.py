"""A gate judged under another level and another confidence, and what its figures then show."""

import evidence

from gates.evidence import Evidence
from gates.pages.figures import draw_all
from gates.proof import judge


def judged_by_others(root, gate, plots):
    """The report, and the pictures of these figures."""

    def change(params):
        params["confidence"] = 0.9
        (owner,) = [part for part in params["gate_a"]["cause"].values() if "strata_p" in part]
        owner["strata_p"][0] = 0.013

    evidence.write_params(root, change)
    report = judge(root, gate)
    return report, draw_all(plots, Evidence(root), report)


def without_confidence(root, report, plots):
    """What is said of the figures that need the confidence, where the report has none."""
    settings = {key: value for key, value in report.settings.items() if key != "confidence"}
    without = report.model_copy(update={"settings": settings})
    return [p.skipped for p in draw_all(plots, Evidence(root), without) if p.skipped]
