"""Whether the classical planner that was compared is one that says anything of scripted plans.

A planner frees the gate of the caveat that none was compared. A bad one frees it as well, and
whoever beats it has shown nothing against a better one.
"""

from gates.engine import Judged
from gates.evidence import MissingEvidenceError
from gates.stress.rollouts import StressSettings
from gates.stress.utility import mean_worths
from genpolicy.contract.planner import PLANNER


def planner_said(judged: Judged) -> list[str]:
    """A caveat where the planner is worth less than a simple method, or than one is planned to be.

    It is silent where none was compared, which is said, or a method did not meet the plan.
    """
    settings = judged.settings
    assert isinstance(settings, StressSettings)
    if PLANNER not in settings.baselines:
        return []
    try:
        worth = mean_worths(judged.evidence, settings)
    except MissingEvidenceError:
        return []
    own = worth.pop(PLANNER)
    measures = {"the plan's simple method": settings.planned_effect[0], **worth}
    other = max(measures, key=lambda name: measures[name])
    if own >= measures[other]:
        return []
    return [
        f"{PLANNER} is worth {own:.2f} in {settings.measure} and {other} {measures[other]:.2f}: "
        "who beats such a planner shows nothing against a better one."
    ]
