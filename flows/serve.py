"""Serve the ladder as a Prefect deployment: start it from the interface, or by a schedule."""

import sys
from pathlib import Path

from flows.ladder import FIRST_ANSWER_S, ladder, server_answers, server_url
from flows.reproduce import EXIT_FAULT
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
    ladder.serve(
        name=name,
        parameters={"workspace": str(workspace.resolve())},
        cron=cron,
        limit=1,
        print_starting_message=True,
    )
    return 0


if __name__ == "__main__":
    sys.exit(run_program("flows.commands:serve", "python -m flows.serve"))
