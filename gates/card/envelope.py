"""The envelope that a card may allow: the one that the comparison ran inside, and nothing else."""

import math
from dataclasses import dataclass

from gates.evidence import Evidence, MissingEvidenceError
from gates.pipeline import TASK
from gates.report import GateReport
from gates.stress.rollouts import STRESS
from genpolicy.documents.task import IDENTITY, Point
from genpolicy.errors import IntegrityError
from genpolicy.evidence.documents.stress import ENVELOPE, Envelope

ENVELOPE_FILE = f"{STRESS}/{ENVELOPE.file}"
"""Written by the comparison: the limits of the condition, and how far its commands went."""
ROUNDING = 1e-6
"""Of a position in m, and of a speed as a share: what rounding of commands may add."""


@dataclass(frozen=True)
class Simulated(Envelope):
    """What the rollouts were held to, and what the task allows.

    Attributes:
        robot: Name of the robot in the scene.
        task_lower_m: Lower corner of the task's own workspace.
        task_upper_m: Upper corner.
    """

    robot: str
    task_lower_m: Point
    task_upper_m: Point


def simulated_envelope(evidence: Evidence) -> Simulated:
    """The envelope of the comparison, with robot and workspace of the task's identity.

    Raises:
        IntegrityError: No condition ran inside an envelope, or a document of another form.
    """
    try:
        envelope = evidence.document(STRESS, ENVELOPE)
        identity = evidence.document(TASK, IDENTITY)
    except MissingEvidenceError as error:
        raise IntegrityError(
            where=ENVELOPE_FILE,
            found=f"no envelope ({error})",
            expected="rollouts inside the card's envelope, and the task's identity",
            action="Plan the condition `envelope` in `stress.perturbations`; run `dvc repro`.",
        ) from error
    lower, upper = identity.workspace_m
    return Simulated(**vars(envelope), robot=identity.robot, task_lower_m=lower, task_upper_m=upper)


def was_judged(report: GateReport, condition: str) -> bool:
    """Whether Gate D held its criteria against the condition."""
    return condition in report.settings.get("perturbations", ())


def beyond_simulation(simulated: Simulated, candidate: str) -> list[str]:
    """Where the envelope is looser than the task, or the candidate's commands left it."""
    bad = []
    lower, upper = simulated.workspace_lower_m, simulated.workspace_upper_m
    limits = zip("xyz", simulated.task_lower_m, lower, upper, simulated.task_upper_m, strict=True)
    for axis, floor, low, high, ceiling in limits:
        if not floor <= low < high <= ceiling:
            bad.append(f"workspace {axis} not inside the task's")
    reached = simulated.reached.get(candidate)
    if reached is None or not reached.commands > 0:
        return [*bad, f"{candidate} was not run inside the envelope"]
    fastest = math.nan if reached.fastest_m_s is None else reached.fastest_m_s
    if not 0 <= fastest <= simulated.speed_limit_m_s * (1 + ROUNDING):
        bad.append(f"commands at {fastest:.4g} m/s inside the envelope")
    nowhere = (math.nan, math.nan, math.nan)
    lowest, highest = reached.lowest_m or nowhere, reached.highest_m or nowhere
    for axis, low, high, least, most in zip("xyz", lower, upper, lowest, highest, strict=True):
        if not low - ROUNDING <= least <= most <= high + ROUNDING:
            bad.append(f"commands outside the workspace in {axis}")
    return bad
