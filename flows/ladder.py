"""The ladder as Prefect flows: one flow per gate, its stages as tasks, all of it through DVC.

No verdict depends on a server, and `dvc repro` alone ends at the same place. Gates A to D are
runs below that of the ladder. Gate E waits for people, which a run below another cannot do: it is
a run of its own, behind the ladder (`flows.card_gate`).
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flows import prefect_settings  # noqa: F401

# isort: split
from prefect import Flow, State, flow
from prefect.runtime import deployment
from prefect.states import Completed, Failed

from flows.beforehand import refused_beforehand
from flows.card_gate import WAITS, hand_over, start_by_hand, told
from flows.estimate import estimate
from flows.gate_runs import run_gate
from flows.reproduce import EXIT_BAD_INPUT, EXIT_FAULT, stop_all
from flows.server import api_url, server_is_there, watch_server
from genpolicy.cli.shell import run_program
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import read_yaml

BELOW = ("a", "b", "c", "d")
"""Gates that machines judge alone."""
GATES = (*BELOW, WAITS)


def stages_by_gate(pipeline: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """The stages of `dvc.yaml`, in its order, cut behind every `gate_<letter>`.

    Returns:
        Stages by letter of the gate that judges them; the gate's own stage is the last.

    Raises:
        ConfigError: A stage follows the last gate, so that no gate would judge it.
    """
    result: dict[str, tuple[str, ...]] = {}
    pending: list[str] = []
    for name in pipeline.get("stages") or {}:
        pending.append(name)
        if name.startswith("gate_"):
            result[name.removeprefix("gate_")] = tuple(pending)
            pending = []
    if pending:
        raise ConfigError(
            where="dvc.yaml",
            found=f"with {', '.join(pending)} behind the last gate",
            expected="every stage before the gate that judges it",
            action="Move them, or add the gate.",
        )
    return result


def _gate_flow(letter: str) -> Flow[..., State[Any]]:
    def gate(workspace: str, stages: list[str]) -> State[Any]:
        return run_gate(Path(workspace), letter, stages)

    gate.__doc__ = f"The evidence stages of gate {letter.upper()}, then its judgement."
    return flow(name=f"gate-{letter}", retries=0)(gate)


GATE_FLOWS = {letter: _gate_flow(letter) for letter in BELOW}


@flow(name="ladder", retries=0)
def ladder(workspace: str = ".") -> State[Any]:
    """The gates below the card in order; ends at the first that refuses, then hands over.

    Args:
        workspace: Folder with `dvc.yaml`, as the process that runs the flow sees it.
    """
    plan = stages_by_gate(read_yaml(Path(workspace) / "dvc.yaml"))
    state: State[Any] = Completed()
    with watch_server(api_url()):
        for letter, gate in GATE_FLOWS.items():
            if letter not in plan:
                continue
            state = gate(workspace, list(plan[letter]), return_state=True)
            if not state.is_completed():
                return Failed(name=state.name, message=state.message)
        if WAITS in plan and deployment.name:
            hand_over(str(Path(workspace).resolve()), plan[WAITS], deployment.name)
    return Completed(name=state.name, message=state.message)


def run_ladder(workspace: Path) -> int:
    """Run the ladder as flows, here and now; returns the exit code."""
    if not server_is_there():
        return EXIT_FAULT
    plan = stages_by_gate(read_yaml(workspace / "dvc.yaml"))
    if unknown := sorted(set(plan) - set(GATES)):
        raise ConfigError(
            where="dvc.yaml",
            found=f"with the gates {', '.join(unknown)}",
            expected=f"only {', '.join(GATES)}",
            action="Correct the names of the stages.",
        )
    if why := refused_beforehand(workspace):
        print(f"The ladder stopped: {why}", file=sys.stderr)
        return EXIT_BAD_INPUT
    print(estimate(workspace), flush=True)
    folder = str(workspace.resolve())
    try:
        state = ladder(folder, return_state=True)
        if state.is_completed() and WAITS in plan:
            state = start_by_hand(folder, plan[WAITS])
    finally:
        stop_all()
    return told(state)


if __name__ == "__main__":
    sys.exit(run_program("flows.commands:ladder", "python -m flows.ladder"))
