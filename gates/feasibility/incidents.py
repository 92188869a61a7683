"""What happened to good chunks on their way: each is counted by its reason, and does not move."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from gates.asked_for import INCIDENTS_ASKED_FOR, OF_TWO
from gates.criterion import Measured, criterion
from gates.evidence import Array, Evidence, MissingEvidenceError, counts
from gates.feasibility.settings import SHADOW, FeasibilitySettings
from genpolicy.evidence.rows.shadow import ShadowCountRow, ShadowStubRow

COUNTS = f"{SHADOW}/counts.parquet"
STUB = f"{SHADOW}/stub.parquet"


@dataclass(frozen=True)
class Counted:
    """One incident of a method, over its sessions.

    Attributes:
        name: The incident.
        reason: By which the chunks must be counted.
        injected: Chunks that it befell.
        counted: Of these, those that were discarded for the reason.
        moved: Of these, those of which actions were executed, where none may be; where one of two
            is, how many less or more than the one.
        arrivals: Actions of theirs at the controller stub, where none may be; where one of two is
            executed, those that were refused there.
    """

    name: str
    reason: str
    injected: float
    counted: float
    moved: float
    arrivals: float

    @property
    def through(self) -> float:
        """What got as far as the stub, executed or refused there, or moved beside another."""
        return self.moved + self.arrivals

    @property
    def wrong(self) -> float:
        """Chunks that were counted otherwise or moved, and actions that arrived."""
        return abs(self.injected - self.counted) + self.through


def counted(evidence: Evidence, method: str) -> list[Counted]:
    """Every incident that is asked for, of one method.

    Raises:
        MissingEvidenceError: One was never tried, or states several totals.
    """
    rows = evidence.of(COUNTS, ShadowCountRow, method)
    stub = evidence.of(STUB, ShadowStubRow, method)
    absent = sorted(set(INCIDENTS_ASKED_FOR) - set(rows["fixture"]))
    if absent:
        raise MissingEvidenceError(f"not tried: {', '.join(absent)}")
    stated = np.stack([counts(rows, name) for name in ("generated", "executed", "count")], axis=1)
    reasons, fixtures = rows["reason"].to_numpy(), rows["fixture"].to_numpy()
    arrived, played = stub[["stale", "invalid", "arrivals"]], stub["fixture"].to_numpy()
    return [
        _counted(
            name,
            reason,
            stated[fixtures == name],
            reasons[fixtures == name] == reason,
            arrived[played == name],
        )
        for name, reason in INCIDENTS_ASKED_FOR.items()
    ]


def _counted(
    name: str, reason: str, stated: Array, hit: NDArray[np.bool_], stub: pd.DataFrame
) -> Counted:
    """One incident: generated, executed and counted in each row, and which of them say why."""
    if not np.all(stated[:, :2] == stated[0, :2]):
        raise MissingEvidenceError(f"{name} states several totals")
    generated, executed = (float(value) for value in stated[0, :2])
    if not generated > 0:
        raise MissingEvidenceError(f"not tried: {name}")
    found = float(stated[hit, 2].sum())
    if name in OF_TWO:
        half = generated / 2
        refused = counts(stub, "stale").sum() + counts(stub, "invalid").sum()
        return Counted(name, reason, half, found, abs(executed - half), float(refused))
    return Counted(name, reason, generated, found, executed, float(counts(stub, "arrivals").sum()))


@criterion(
    "<=",
    question="Is what happens to a good chunk on its way counted by its reason, and never moved?",
    look_at="Timing: a chunk that is void already was executed, or counted as something else.",
    per_candidate=True,
    always=True,
)
def incidents_miscounted(
    evidence: Evidence, settings: FeasibilitySettings, candidate: str
) -> Measured:
    """Chunks that were counted by another reason or moved, and actions that arrived of them."""
    found = counted(evidence, candidate)
    wrong = [
        f"{item.name}: {item.counted:g} of {item.injected:g} as {item.reason}, "
        f"{item.through:g} got to the stub"
        for item in found
        if item.wrong
    ]
    least = min(item.injected for item in found)
    text = f"{len(found)} incidents, each to {least:g} chunks or more"
    return Measured(sum(item.wrong for item in found), caveat="; ".join([text, *wrong]))
