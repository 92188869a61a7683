"""Commands that drive the ladder; registered in `genpolicy.commands`.

`python -m flows.<name>` is the same as `genpolicy <name>`. Nothing heavy is imported here.
"""

from pathlib import Path
from typing import Annotated

import typer

from genpolicy.cli.shell import with_examples

Workspace = Annotated[Path, typer.Option(help="Folder with dvc.yaml.")]


@with_examples("genpolicy reproduce gate_b", "genpolicy reproduce --workspace build/smoke gate_c")
def reproduce(
    stages: Annotated[
        list[str] | None, typer.Argument(help="Stages to bring up to date; default: all.")
    ] = None,
    workspace: Workspace = Path(),
    single_item: Annotated[
        bool, typer.Option("--single-item", help="Not what they depend on.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Run also where nothing changed.")] = False,
) -> int:
    """Run `dvc repro`; the exit code says why it ended.

    0 done, 1 a fault of ours, 2 bad input, 3 refused by a gate. Without named
    stages also 3 where the last gate does not pass and waits for nobody.
    """
    from flows.reproduce import reproduce_here

    return reproduce_here(workspace, stages=stages or (), single_item=single_item, force=force)


@with_examples("genpolicy ladder --workspace build/smoke")
def ladder(workspace: Workspace = Path()) -> int:
    """Run the ladder as Prefect flows.

    Without PREFECT_API_URL a temporary server is started. Exit codes: 0 done,
    1 a fault, 2 bad input, 3 refused by a gate that does not pass. Gate E is
    suspended until the signed card is there; `genpolicy resume` goes on.
    """
    from flows.ladder import run_ladder

    return run_ladder(workspace)


@with_examples("genpolicy resume")
def resume(
    workspace: Workspace = Path(),
    if_waiting: Annotated[
        bool, typer.Option("--if-waiting", help="Exit 0 where no run waits, or no server answers.")
    ] = False,
) -> int:
    """Go on with gate E, suspended by `genpolicy ladder`.

    The signed card is verified first: a wrong one is told with its reason, and
    leaves the run suspended (exit 3). The run then judges it again by itself.
    The last signature of `genpolicy card sign` does the same.
    """
    from flows.resume import resume_gate

    return resume_gate(workspace, if_waiting=if_waiting)


@with_examples("genpolicy serve --cron '0 3 * * *'")
def serve(
    name: Annotated[str, typer.Option(help="Name of the deployment.")] = "ladder",
    workspace: Workspace = Path(),
    cron: Annotated[str | None, typer.Option(help="Schedule; default: started by hand.")] = None,
) -> int:
    """Serve the ladder as a deployment of a Prefect server.

    The server is that of PREFECT_API_URL. One run at a time: a workspace has
    one writer.
    """
    from flows.serve import serve_ladder

    return serve_ladder(name, workspace=workspace, cron=cron)


@with_examples("genpolicy workspace build/smoke --overrides params.smoke.yaml")
def workspace(
    target: Annotated[Path, typer.Argument(help="Folder to make or refresh.")],
    overrides: Annotated[Path, typer.Option(help="YAML with other values.")],
    source: Annotated[Path, typer.Option(help="The checkout.")] = Path(),
) -> int:
    """Make or refresh a workspace with parameters of its own."""
    import os

    from flows.workspace import make_workspace

    made = make_workspace(source, target, overrides)
    print(f"Workspace {os.path.relpath(made)} is up to date with {overrides}.")
    return 0
