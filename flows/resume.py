"""Go on with gate E, which waits for the signed card, once a card that verifies lies there."""

import sys
from pathlib import Path

from flows import prefect_settings  # noqa: F401

# isort: split
from prefect import get_client
from prefect.flow_runs import resume_flow_run

from flows.card_gate import BY_HAND, SUSPENDED, ask_card, go_on, refusal, told, waiting
from flows.reproduce import EXIT_DONE, EXIT_FAULT, stop_all
from flows.server import database, server_is_there
from genpolicy.cli.shell import run_program
from genpolicy.errors import BadInputError


def resume_gate(workspace: Path, *, if_waiting: bool = False) -> int:
    """Resume the run that waits, unless its card is wrong; returns the exit code.

    A card that is wrong, or not there, is told with its reason and leaves the run suspended.

    Args:
        workspace: Whose run it is.
        if_waiting: Whether it is no fault if none waits, or nobody can be asked.

    Raises:
        BadInputError: No run waits for this workspace.
    """
    if not server_is_there():
        return EXIT_DONE if if_waiting else EXIT_FAULT
    with get_client(sync_client=True) as client:
        runs = waiting(client, str(workspace.resolve()))
        if not runs and if_waiting:
            print(f"No run of gate E waits in {database()}.")
            return EXIT_DONE
        if not runs:
            raise BadInputError(
                where=str(workspace),
                found=f"a workspace for which no run of gate E waits in {database()}",
                expected="one that is suspended",
                action="Run `genpolicy ladder`; it ends there when gates A to D pass.",
            )
        run = runs[0]
        served = client.read_deployment(str(run.deployment_id)).name
        code, lines = ask_card(workspace)
        if code != EXIT_DONE:
            print(f"Gate E stays suspended: {refusal(lines)}", file=sys.stderr)
            return code
        if run.state and run.state.name == SUSPENDED:
            resume_flow_run(run.id)
        if served != BY_HAND:
            print(f"Resumed {run.name}; whoever serves `{served}` runs it on.")
            return EXIT_DONE
        run = client.read_flow_run(run.id)
    try:
        return told(go_on(run))
    finally:
        stop_all()


if __name__ == "__main__":
    sys.exit(run_program("flows.commands:resume", "python -m flows.resume"))
