"""How many of the modes the best simple policy keeps, as it is deployed.

Who keeps nearly all of them needs no density. The mean over situations is judged at the upper end
of its interval over episodes: of few episodes, modes that look lost may not be.
"""

import numpy as np
import pandas as pd

from gates.bounds import share_interval
from gates.criterion import Measured, criterion
from gates.evidence import Array, Evidence, MissingEvidenceError, counts, numbers
from gates.need.held import require_asked
from gates.need.settings import NeedSettings
from gates.need.simpler import MODES
from gates.words import number, percent
from genpolicy.evidence.rows.need import ModeRow


@criterion(
    "<=",
    question="Does the best simple policy lose modes?",
    look_at="Baselines: a simple policy already covers the modes; keep it.",
)
def baseline_mode_coverage(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Upper bound of the mode coverage of the best baseline as it is deployed.

    A mode counts by admissible samples. What a baseline covers when its latent is drawn stands in
    the caveat: drawn from, it is a generator itself and has to pass the gates like any other
    candidate. Wide scatter reaches modes by chance, so the share of its samples that pass all six
    layers stands beside it.
    """
    deployed: dict[str, pd.DataFrame] = {}
    drawn: list[tuple[float, float, str]] = []
    for method in settings.baselines:
        rows = evidence.of(MODES, ModeRow, method)
        require_asked(evidence, rows, method, settings, table=MODES)
        rows = rows[numbers(rows, "modes_present") >= 2]
        generative = method in settings.generative_baselines
        if not (generative or rows["convention"].isin(settings.deployed_conventions).any()):
            raise MissingEvidenceError(f"no two-mode situation was given to {method} as deployed")
        for name, own in rows.groupby("convention"):
            who = f"{method}, {name}"
            if name in settings.deployed_conventions and not generative:
                deployed[who] = own
                continue
            passed = numbers(own, "admissible").sum() / numbers(own, "samples").sum()
            drawn.append((float(_kept(own).mean()), float(passed), who))
    if not deployed:
        raise MissingEvidenceError("no baseline is judged as it is deployed")
    # As many chances to keep the modes as there are conventions: the level is divided among them.
    confidence = 1.0 - (1.0 - settings.confidence) / len(deployed)
    upper, share, lower, name = max(
        (upper, share, lower, who)
        for who, own in deployed.items()
        for share, lower, upper in [coverage(own, confidence)]
    )
    episodes = deployed[name]["episode_uuid"].nunique()
    text = (
        f"best of {len(deployed)} deployed conventions, by {name}: {percent(share)} of the modes "
        f"of {number(len(deployed[name]))} situations; upper bound over {number(episodes)} "
        "episodes, level divided among the conventions"
    )
    if drawn:
        text += "; drawn at random, as a generator: " + ", ".join(
            f"{who} {percent(value)} ({percent(passed)} of its samples admissible)"
            for value, passed, who in sorted(drawn, key=lambda one: (one[0], one[2]), reverse=True)
        )
    counted = f"{episodes} episodes"
    return Measured(upper, (lower, upper), text, counted=counted, point=share)


def _kept(rows: pd.DataFrame) -> Array:
    """Share of the modes of each situation that admissible samples reach. Shape (n,)."""
    kept, present = counts(rows, "modes_valid"), numbers(rows, "modes_present")
    if np.any(kept > present):
        raise MissingEvidenceError("more modes are reached than the situation has")
    share: Array = kept / present
    return share


def coverage(rows: pd.DataFrame, confidence: float) -> tuple[float, float, float]:
    """Mean of these shares with its interval over episodes."""
    clusters = list(rows["episode_uuid"])
    return share_interval(_kept(rows), clusters, confidence=confidence, favourable=False)
