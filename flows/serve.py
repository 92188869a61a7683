"""Serve the ladder as a Prefect deployment: start it from the interface, or by a schedule."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from flows.ladder import FIRST_ANSWER_S, ladder, server_answers, server_url
from flows.reproduce import EXIT_FAULT


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve until interrupted; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m flows.serve",
        description="Serve the ladder as a deployment of a running Prefect server "
        "(PREFECT_API_URL). One run at a time: a workspace has one writer.",
        epilog="Example: python -m flows.serve --cron '0 3 * * *'",
    )
    parser.add_argument("--name", default="ladder", help="name of the deployment")
    parser.add_argument("--workspace", type=Path, default=Path(), help="folder with dvc.yaml")
    parser.add_argument("--cron", default=None, help="schedule; default: started by hand")
    options = parser.parse_args(arguments)
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
        name=options.name,
        parameters={"workspace": str(options.workspace.resolve())},
        cron=options.cron,
        limit=1,
        print_starting_message=True,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
