"""How far the trial card's box reaches beyond what a candidate was commanded to inside it.

The card allows the box that the rollouts were held to, and they need not have gone everywhere in
it. What nobody visited is allowed all the same, so it is said, side by side, and stays on the card.
"""

import re

from gates.engine import Judged
from gates.evidence import MissingEvidenceError
from gates.pipeline import TASK
from gates.stress.rollouts import STRESS
from genpolicy.documents.task import IDENTITY
from genpolicy.evidence.documents.stress import ENVELOPE, Envelope
from genpolicy.verification.report import Reached

BEYOND = re.compile(r"(\S+): the card's box reaches up to \d+ mm beyond what was visited\b")
"""How the caveat of a candidate begins: its name, and how far at most."""
MM_PER_M = 1000.0


def visited_said(judged: Judged) -> list[str]:
    """A caveat for each passing candidate that left 1 mm or more at a side of the box unvisited.

    It is silent where nothing ran inside an envelope, or the candidate did not: no card follows.
    """
    try:
        envelope = judged.evidence.document(STRESS, ENVELOPE)
        workspace = judged.evidence.document(TASK, IDENTITY).workspace_m
    except MissingEvidenceError:
        return []
    box = (envelope.workspace_lower_m, envelope.workspace_upper_m)
    whole = "; it is the whole workspace of the task" if box == tuple(workspace) else ""
    said = []
    for name, verdict in judged.candidates.items():
        sides = _beyond(envelope, envelope.reached.get(name))
        if verdict == "PASS" and sides:
            most = max(sides.values())
            each = ", ".join(f"{side} {gap} mm" for side, gap in sides.items())
            said.append(
                f"{name}: the card's box reaches up to {most} mm beyond what was visited "
                f"({each}), so that a trial may go where no rollout was{whole}."
            )
    return said


def _beyond(envelope: Envelope, reached: Reached | None) -> dict[str, int]:
    """Room between a side of the box and the outermost command, mm, where there is any."""
    if reached is None or reached.lowest_m is None or reached.highest_m is None:
        return {}
    gaps = {}
    lows = zip("xyz", envelope.workspace_lower_m, reached.lowest_m, strict=True)
    highs = zip("xyz", envelope.workspace_upper_m, reached.highest_m, strict=True)
    gaps.update({f"-{axis}": least - low for axis, low, least in lows})
    gaps.update({f"+{axis}": high - most for axis, high, most in highs})
    whole = {side: round(MM_PER_M * gap) for side, gap in gaps.items()}
    return {side: gap for side, gap in whole.items() if gap > 0}
