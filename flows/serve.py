"""Serve the ladder as a Prefect deployment: start it from the interface, or by a schedule.

Gate E is served beside it under the same name, so that a run of it goes on when it is resumed.
"""

import sys
from pathlib import Path
from typing import cast

from flows import prefect_settings  # noqa: F401

# isort: split
from prefect import serve
from prefect.deployments.runner import RunnerDeployment

from flows.card_gate import gate_e
from flows.ladder import ladder
from flows.reproduce import EXIT_FAULT
from flows.server import FIRST_ANSWER_S, server_answers, server_url
from genpolicy.cli.shell import run_program


def serve_ladder(name: str, *, workspace: Path, cron: str | None) -> int:
    """Serve until interrupted; returns the exit code."""
    url = server_url()
    if not url or not server_answers(url):
        print(
            f"PREFECT_API_URL is {url or 'not set'}, where no server answers within "
            f"{FIRST_ANSWER_S:.0f} s, expected a running Prefect server. Run "
            "`prefect server start` and set the variable to the address that it prints.",
            file=sys.stderr,
        )
        return EXIT_FAULT
    folder = str(workspace.resolve())
    both = (
        ladder.to_deployment(name, parameters={"workspace": folder}, cron=cron),
        gate_e.to_deployment(name),
    )
    serve(*cast("tuple[RunnerDeployment, RunnerDeployment]", both), limit=1)
    return 0


if __name__ == "__main__":
    sys.exit(run_program("flows.commands:serve", "python -m flows.serve"))
