"""`python -m benchmarks.decision.recovery`: how often recovery looks bad by luck alone.

Gate D looks at entries into recovery by condition, by all that nobody called for, and by phase:
15 groups here. Drawn are entries of a policy whose true share of recoveries is the same everywhere,
at the limit of `params.yaml` and above, and asked is the gate's own function (`shown_by`). Beside
it stands what a FAIL was before decision 345: the group with the lowest bound, its upper bound at
the level of a single look below the limit.

Nobody plans where recovery begins. It is assumed to begin once on every start of the drill, on
three of ten starts under pushes and on one of ten under each other condition, in six phases.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.decision.worlds import CONDITIONS
from gates.evidence import MissingEvidenceError
from gates.settings import read_params
from gates.stress.recoveries import PUSH
from gates.stress.rollouts import DRILL
from gates.stress.safety import groups_of, shown_by
from gates.verdicts import judge_criterion
from genpolicy.seeds import stream
from genpolicy.statistics.intervals import clopper_pearson

ROOT = Path(__file__).parents[2]
ROOT_SEED = 13
BEGINS = {DRILL: 1.0, PUSH: 0.3}
ELSEWHERE = 0.1
"""Share of starts on which recovery begins."""
PHASES = {"approach": 0.4, "align": 0.2, "insert": 0.2, "search": 0.1, "leave": 0.05, "grasp": 0.05}
"""In which share of the entries it begins."""
TRUE_SHARES = (0.5, 0.55, 0.6, 0.7)
CRITERION = "recovery_success_lower"
VERDICTS = ("PASS", "INCONCLUSIVE", "FAIL")


def drawn(share: float, starts: int, rng: np.random.Generator) -> pd.DataFrame:
    """Entries of a policy that recovers from each with the same chance; columns of the gate."""
    parts = []
    for condition in CONDITIONS:
        begun = np.flatnonzero(rng.random(starts) < BEGINS.get(condition, ELSEWHERE))
        parts.append(pd.DataFrame({
            "perturbation": condition, "start": begun,
            "phase": rng.choice(list(PHASES), size=len(begun), p=list(PHASES.values())),
            "recovered": rng.random(len(begun)) < share,
        }))  # fmt: skip
    return pd.concat(parts, ignore_index=True)


def verdict(rows: pd.DataFrame, *, least: float, confidence: float) -> str:
    """What the gate says of such entries."""
    try:
        found = shown_by(rows, least=least, confidence=confidence)
    except MissingEvidenceError:
        return "INCONCLUSIVE"
    return judge_criterion(found.value, least, ">=", found.interval)


def failed_before(rows: pd.DataFrame, *, least: float, confidence: float) -> bool:
    """Whether it was a FAIL, each group held to the level of a single look."""
    asked = [
        group.measured(rows, least=least, among=1, confidence=confidence)
        for group in groups_of(rows)
    ]
    found = [one for one in asked if one is not None]
    return bool(found) and min(found, key=lambda one: one.bound).bad


def table(trials: int) -> list[str]:
    """One line for each true share."""
    params = read_params(ROOT)
    confidence, starts = params["confidence"], params["stress"]["starts"]
    owners = params["gate_d"]["limits"].values()
    (least,) = [own[CRITERION][0] for own in owners if CRITERION in own]
    lines = ["| true share | trials | PASS | INCONCLUSIVE | FAIL | FAIL before |"]
    lines.append("|---|---|---|---|---|---|")
    for share in TRUE_SHARES:
        said: Counter[str] = Counter()
        for trial in range(trials):
            rows = drawn(share, starts, stream(ROOT_SEED, "decision", "recovery", trial))
            said[verdict(rows, least=least, confidence=confidence)] += 1
            said["before"] += failed_before(rows, least=least, confidence=confidence)
        cells = " | ".join(_share(said[name], trials) for name in (*VERDICTS, "before"))
        lines.append(f"| {share:g}{' (the limit)' * (share == least)} | {trials:,} | {cells} |")
    return lines


def _share(count: int, trials: int) -> str:
    low, high = clopper_pearson(count, trials)
    return f"{count / trials:.3f} ({low:.3f} to {high:.3f})"


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table of `docs/decision-accuracy.md`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.decision.recovery", description=__doc__
    )
    parser.add_argument("--trials", type=int, default=1000)
    print("\n".join(table(parser.parse_args(argv).trials)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
