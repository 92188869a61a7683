"""Did a candidate touch anything? Of the force of one that never did, nothing is known.

Said whether or not the force is judged: who declares that criterion not applicable takes away the
question, and not what the rollouts did. A card carries it beside the force limit.
"""

import re
from collections.abc import Sequence

import numpy as np

from gates.engine import Judged
from gates.evidence import Evidence, MissingEvidenceError, numbers
from gates.stress.rollouts import StressSettings, rollouts

FORCE = "force_peak_p95_n"
UNTOUCHED = re.compile(r"(\S+): (no contact in [\d,]+ of [\d,]+ rollouts)\b")
"""How the caveat of a candidate that touched nothing begins: its name, and what was seen."""


def touched(evidence: Evidence, settings: StressSettings, candidate: str) -> str:
    """That a candidate touched something, in how many rollouts and how hard; empty if it did not.

    Asked where force was declared not to matter: a limit that nobody names holds no force.
    """
    forces = numbers(rollouts(evidence, settings, candidate), "force_peak_n")
    if not np.any(forces > 0):
        return ""
    return (
        f"it touched something in {np.sum(forces > 0):,} of {len(forces):,} rollouts, with up to "
        f"{forces.max():.3g} N"
    )


def contact_said(judged: Judged) -> list[str]:
    """A caveat for each candidate that touched nothing in any planned condition.

    And for each that touched something of which a rehearsal asks nothing.
    """
    asked = {answer.candidate for answer in judged.answers if answer.id == FORCE}
    said = []
    for name in judged.candidates:
        try:
            forces = numbers(rollouts(judged.evidence, judged.settings, name), "force_peak_n")
        except MissingEvidenceError:
            continue  # the criteria say what is missing
        if np.any(forces > 0) and name not in asked:
            seen = touched(judged.evidence, judged.settings, name)
            said.append(f"{name}: {seen.removeprefix('it ')}, and no limit of force was asked.")
        if np.all(forces == 0):
            count = f"{len(forces):,} of {len(forces):,}"
            said.append(
                f"{name}: no contact in {count} rollouts, so that no force of it was ever seen."
            )
    return said


def untouched(caveats: Sequence[str], candidate: str) -> str:
    """What Gate D says of a candidate that touched nothing; empty of one that did.

    Args:
        caveats: Of its report, or of a card drafted from it.
        candidate: Name of the method.
    """
    found = (UNTOUCHED.match(caveat) for caveat in caveats)
    return next((match[2] for match in found if match and match[1] == candidate), "")
