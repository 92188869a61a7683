"""Gate E as a flow run of its own, which is suspended until the signed card is there.

Prefect suspends only a run that stands under no other and belongs to a deployment, since somebody
must be able to begin it again. So the ladder ends in front of it. Where the ladder is served, the
gate is served beside it; otherwise it belongs to the deployment `by-hand`, which nobody serves,
and `genpolicy resume` runs it on.

Whoever resumes is not believed: the run judges again from the bytes that lie there, and asks of
the card what `genpolicy card verify` asks. What it finds decides, not the click.
"""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from textwrap import shorten
from typing import Any, cast
from uuid import uuid4

from flows import prefect_settings  # noqa: F401

# isort: split
from prefect import State, flow, get_client, get_run_logger, task
from prefect.cache_policies import NO_CACHE
from prefect.client.orchestration import SyncPrefectClient
from prefect.client.schemas.filters import (
    FlowFilter,
    FlowFilterName,
    FlowRunFilter,
    FlowRunFilterState,
    FlowRunFilterStateName,
)
from prefect.client.schemas.objects import FlowRun
from prefect.deployments import run_deployment
from prefect.exceptions import Pause
from prefect.flow_engine import run_flow
from prefect.flow_runs import suspend_flow_run
from prefect.states import Cancelled, Completed, Failed, Pending

from flows.gate_runs import STATE_NAMES, exit_code, run_gate
from flows.judged import PENDING
from flows.reproduce import EXIT_DONE, EXIT_FAULT, EXIT_REFUSED, stage_environment
from flows.server import api_url, watch_server

WAITS = "e"
FLOW = "gate-e"
BY_HAND = "by-hand"
OPEN = (["FAIL"], ["INCONCLUSIVE"], [PENDING])
"""How a line of `genpolicy card verify` begins that keeps the card from being good."""
MOST_SAID = 2000
"""Characters of it that a state of Prefect is given."""
SUSPENDED, RESUMING = "Suspended", "Resuming"
HOW_TO_GO_ON = (
    "Gate E waits: its run is suspended until people have signed the card (docs/gate-e.md). "
    "Then: genpolicy resume"
)


@task(task_run_name="card verify", cache_policy=NO_CACHE)
def verify(workspace: str) -> str:
    """What is wrong with the signed card; empty where nothing is."""
    code, lines = ask_card(Path(workspace))
    for line in lines:
        get_run_logger().info(line)
    return "" if code == EXIT_DONE else refusal(lines)


@flow(name=FLOW, retries=0)
def gate_e(workspace: str, stages: list[str]) -> State[Any]:
    """The trial card: drafted, judged, and suspended while people have not signed.

    Args:
        workspace: Folder with `dvc.yaml`, as the process that runs the flow sees it.
        stages: Stages of the gate in order; the last one judges.
    """
    with watch_server(api_url()):
        state = run_gate(Path(workspace), WAITS, stages)
        if not state.is_completed():
            return state
        if state.name == PENDING:
            # A key of its own each time: Prefect lets a run go on, unsigned, at a key it knows.
            suspend_flow_run(key=str(uuid4()))
            return Failed(name=STATE_NAMES[EXIT_FAULT], message="Prefect did not suspend the run.")
        if wrong := verify(workspace):
            return Failed(name=STATE_NAMES[EXIT_REFUSED], message=wrong)
    return Completed(message=state.message)


def ask_card(workspace: Path) -> tuple[int, list[str]]:
    """`genpolicy card verify` in the workspace, by the code that lies there.

    Returns:
        Its exit code, 0 only for a valid, complete, signed card; and what it said.
    """
    done = subprocess.run(
        [sys.executable, "-m", "genpolicy", "card", "verify"],
        cwd=workspace,
        env=stage_environment(workspace),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    return done.returncode, done.stdout.splitlines()


def refusal(lines: Sequence[str]) -> str:
    """Of what `genpolicy card verify` said, the verdict and what does not hold; else all of it."""
    wrong = [line.strip() for line in lines[1:] if line.split()[:1] in OPEN]
    said = " ".join([*lines[:1], *(wrong or lines[1:])])
    return shorten(said, MOST_SAID, placeholder=" ...") or "genpolicy card verify said nothing"


def hand_over(workspace: str, stages: Sequence[str], served: str) -> None:
    """Have the gate run as the deployment `served` that is served beside the ladder."""
    with get_client(sync_client=True) as client:
        let_go(client, workspace)
    parameters = {"workspace": workspace, "stages": list(stages)}
    run_deployment(f"{FLOW}/{served}", parameters=parameters, timeout=0, as_subflow=False)


def start_by_hand(workspace: str, stages: Sequence[str]) -> State[Any]:
    """Run the gate here and now; returns the state in which it ended, or waits."""
    with get_client(sync_client=True) as client:
        let_go(client, workspace)
        deployment = client.create_deployment(client.create_flow(gate_e), BY_HAND)
        run = client.create_flow_run_from_deployment(
            deployment,
            parameters={"workspace": workspace, "stages": list(stages)},
            state=Pending(),
        )
    return go_on(run)


def go_on(run: FlowRun) -> State[Any]:
    """Run what is pending, or was resumed, in this process."""
    try:
        return cast("State[Any]", run_flow(gate_e, flow_run=run, return_type="state"))
    except Pause as pause:
        return cast("State[Any]", pause.state)


def waiting(client: SyncPrefectClient, workspace: str) -> list[FlowRun]:
    """Runs of the gate that wait for the card of this workspace, or were just resumed."""
    runs = client.read_flow_runs(
        flow_filter=FlowFilter(name=FlowFilterName(any_=[FLOW])),
        flow_run_filter=FlowRunFilter(
            state=FlowRunFilterState(name=FlowRunFilterStateName(any_=[SUSPENDED, RESUMING]))
        ),
    )
    return [run for run in runs if run.parameters.get("workspace") == workspace]


def let_go(client: SyncPrefectClient, workspace: str) -> None:
    """A newer run of the ladder waits in the place of those that wait for an older chain."""
    for run in waiting(client, workspace):
        client.set_flow_run_state(run.id, Cancelled(message="A newer run of the ladder waits."))


def told(state: State[Any]) -> int:
    """Say why the ladder ended, where it did not pass; returns its exit code."""
    if state.is_paused():
        print(f"\n{HOW_TO_GO_ON}")
    elif not state.is_completed():
        print(f"\nThe ladder stopped: {state.message}", file=sys.stderr)
    return exit_code(state)
