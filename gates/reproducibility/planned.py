"""How much was measured, held against what was planned: fixtures, processes, invocations.

One fixture, or one invocation a process, says as little as it costs, and no interval would tell: it
is widened by what was measured and not by what was left out. More than planned is no fault.
"""

import pandas as pd

from gates.evidence import MissingEvidenceError
from gates.reproducibility.latency_budget import COLD, LATENCY, WARM
from gates.reproducibility.settings import SAMPLES, ReproducibilitySettings

RUNS, PROCESSES = (1, 2), (1, 2, 3)
"""Measurements, and fresh processes of each (`genpolicy.evidence.reproducibility.latency`)."""
SHOWN_TO_BROUGHT = 32
"""Fixtures of who was brought, however many others have (`genpolicy.evidence.fixtures_again`)."""


def require_fixtures(rows: pd.DataFrame, settings: ReproducibilitySettings, candidate: str) -> None:
    """Of each training seed and device, every planned fixture came back.

    Args:
        rows: `samples.parquet` of the candidate.
        settings: What is planned.
        candidate: The candidate.

    Raises:
        MissingEvidenceError: Fewer.
    """
    planned = settings.fixtures
    if candidate in settings.brought:
        planned = min(planned, SHOWN_TO_BROUGHT)
    for (seed, device), part in rows.groupby(["seed", "device"]):
        if lacking := set(range(planned)) - set(part["row"]):
            raise MissingEvidenceError(
                f"{SAMPLES} has {planned - len(lacking)} of {planned} planned fixtures "
                f"(policy.fixtures) of {candidate}, seed {seed}, on {device}"
            )


def require_repeats(
    rows: pd.DataFrame, settings: ReproducibilitySettings, method: str, temperature: str
) -> None:
    """Every process of either run was asked as often as planned, at one temperature.

    Args:
        rows: `latency.parquet` of the method.
        settings: What is planned.
        method: The method.
        temperature: `cold` or `warm`. A server is cold once, however often others are.

    Raises:
        MissingEvidenceError: Less often, or a process lacks.
    """
    planned = {WARM: settings.warm, COLD: settings.cold}[temperature]
    if temperature == COLD and method in settings.brought:
        planned = 1
    own = rows[(rows["source"] == "measured") & (rows["temperature"] == temperature)]
    asked = own.groupby(["run", "process"])["repeat"].nunique()
    for run in RUNS:
        for process in PROCESSES:
            found = int(asked.get((run, process), 0))
            if found < planned:
                raise MissingEvidenceError(
                    f"{LATENCY} has {found} {temperature} invocations of {method} in process "
                    f"{process} of run {run}; planned are {planned} (latency.{temperature})"
                )
