"""The ladder as Prefect flows: one flow per gate, its stages as tasks, all of it through DVC.

Prefect decides when to go on, shows and schedules it; DVC knows what is up to date; the gates
judge. So no verdict depends on a server, and `dvc repro` alone ends at the same place. A gate that
does not pass is a failed task and a failed flow, named by its verdict. Retries are for faults of
the machine only: a refusal or a bad input does not become better by itself.
"""

import os
import sys
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

# Read by Prefect while it is imported. What the caller has set stays.
for _name, _value in {
    "PREFECT_SERVER_EPHEMERAL_STARTUP_TIMEOUT_SECONDS": "120",
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "PREFECT_SERVER_LOGGING_LEVEL": "CRITICAL",
    "PREFECT_HOME": str(Path.cwd() / ".prefect"),
    "PREFECT_CLIENT_MAX_RETRIES": "3",
    "DO_NOT_TRACK": "1",
}.items():
    os.environ.setdefault(_name, _value)

import httpx  # noqa: E402
from prefect import Flow, State, flow, get_client, get_run_logger, task  # noqa: E402
from prefect.artifacts import create_link_artifact, create_markdown_artifact  # noqa: E402
from prefect.settings import PREFECT_API_URL  # noqa: E402
from prefect.states import Completed, Failed  # noqa: E402

from flows.judged import GOES_ON, PENDING, judged  # noqa: E402
from flows.reproduce import (  # noqa: E402
    EXIT_BAD_INPUT,
    EXIT_DONE,
    EXIT_FAULT,
    EXIT_REFUSED,
    reproduce,
    stop_all,
)
from genpolicy.cli.shell import run_program  # noqa: E402
from genpolicy.errors import ConfigError  # noqa: E402
from genpolicy.integrity.documents import read_yaml  # noqa: E402

GATES = ("a", "b", "c", "d", "e")
RETRIES = 2
RETRY_DELAY_S = (5.0, 20.0)
# A server that does not answer is given up well within a minute, not after Prefect's 138 s.
FIRST_ANSWER_S = 10.0
SILENCE_S = 30.0
PROBE_PERIOD_S = 3.0

RED = ("FAIL", "INCONCLUSIVE")
STATE_NAMES = {EXIT_FAULT: "Fault", EXIT_BAD_INPUT: "Bad input", EXIT_REFUSED: "Refused"}


class StageStoppedError(Exception):
    """A stage did not reach its end.

    Args:
        code: Exit code of the ladder: 1 fault, 2 bad input, 3 refused by a gate.
        sentence: What the stage said.
        infrastructure: Whether a retry could help.
        verdict: Verdict of the gate that has judged and does not pass; empty before a judgement.
    """

    def __init__(self, code: int, sentence: str, infrastructure: bool, verdict: str = "") -> None:
        super().__init__(code, sentence, infrastructure, verdict)
        self.verdict = verdict
        self.code = code
        self.sentence = sentence
        self.infrastructure = infrastructure

    def __str__(self) -> str:
        return self.sentence


def worth_a_retry(_task: Any, _run: Any, state: State[Any]) -> bool:
    """Only a lock, a full disk or a killed process; never a refusal, a bad input or our fault."""
    error = state.result(raise_on_failure=False)
    return isinstance(error, StageStoppedError) and error.infrastructure


@task(
    task_run_name="{stage}",
    retries=RETRIES,
    retry_delay_seconds=list(RETRY_DELAY_S),
    retry_condition_fn=worth_a_retry,
)
def reproduce_stage(workspace: str, stage: str) -> float:
    """Bring one stage up to date.

    Returns:
        Wall time, s.

    Raises:
        StageStoppedError: The stage was refused, had bad input or failed, or it is a gate that
            has judged and does not pass.
    """
    outcome = reproduce(
        Path(workspace), stages=(stage,), single_item=True, echo=get_run_logger().info
    )
    if outcome.code != EXIT_DONE:
        raise StageStoppedError(outcome.code, outcome.sentence, outcome.infrastructure)
    if stage.startswith("gate_"):
        verdict, sentence = judged(Path(workspace), stage)
        if verdict not in GOES_ON:
            raise StageStoppedError(EXIT_REFUSED, sentence, False, verdict)
    return outcome.duration_s


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
        stopped: StageStoppedError | None = None
        for stage in stages:
            state = reproduce_stage(workspace, stage, return_state=True)
            if not state.is_completed():
                error = state.result(raise_on_failure=False)
                stopped = (
                    error
                    if isinstance(error, StageStoppedError)
                    else StageStoppedError(EXIT_FAULT, f"{stage}: {state.message}", False)
                )
                break
        _publish(Path(workspace), letter, stopped)
        if stopped is not None:
            name = stopped.verdict or STATE_NAMES[stopped.code]
            return Failed(name=name, message=stopped.sentence)
        verdict, sentence = judged(Path(workspace), f"gate_{letter}")
        return Completed(name=verdict if verdict == PENDING else None, message=sentence)

    gate.__doc__ = f"The evidence stages of gate {letter.upper()}, then its judgement."
    return flow(name=f"gate-{letter}", retries=0)(gate)


gate_a_flow = _gate_flow("a")
gate_b_flow = _gate_flow("b")
gate_c_flow = _gate_flow("c")
gate_d_flow = _gate_flow("d")
gate_e_flow = _gate_flow("e")

GATE_FLOWS = dict(
    zip(GATES, (gate_a_flow, gate_b_flow, gate_c_flow, gate_d_flow, gate_e_flow), strict=True)
)


@flow(name="ladder", retries=0)
def ladder(workspace: str = ".") -> State[Any]:
    """All gates in order; ends at the first that refuses.

    Args:
        workspace: Folder with `dvc.yaml`, as the process that runs the flow sees it.
    """
    plan = stages_by_gate(read_yaml(Path(workspace) / "dvc.yaml"))
    state: State[Any] = Completed()
    with watch_server(_api_url()):
        for letter, stages in plan.items():
            state = GATE_FLOWS[letter](workspace, list(stages), return_state=True)
            if not state.is_completed():
                return Failed(name=state.name, message=state.message)
    return Completed(name=state.name, message=state.message)


class watch_server:  # noqa: N801  (used like a function, as a context)
    """Ends the process, and the stage that it runs, when the Prefect server falls silent.

    Args:
        url: Address of the server's API.
        silence_s: How long it may stay silent.
        period_s: Time between two questions.
        answers: Asks the server; a parameter for tests.
        give_up: Called once when the server is given up; a parameter for tests.
    """

    def __init__(
        self,
        url: str,
        *,
        silence_s: float = SILENCE_S,
        period_s: float = PROBE_PERIOD_S,
        answers: Callable[[str], bool] | None = None,
        give_up: Callable[[str], None] | None = None,
    ) -> None:
        self._url = url
        self._silence_s = silence_s
        self._period_s = period_s
        self._answers = answers or server_answers
        self._give_up = give_up or _leave
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="server watch", daemon=True)

    def __enter__(self) -> "watch_server":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()

    def _watch(self) -> None:
        heard = time.monotonic()
        while not self._done.wait(self._period_s):
            if self._answers(self._url):
                heard = time.monotonic()
            elif time.monotonic() - heard >= self._silence_s:
                self._give_up(self._url)
                return


def server_url() -> str | None:
    """Address of the Prefect server that the settings name; None for a temporary one."""
    url = PREFECT_API_URL.value()
    return str(url) if url else None


def server_answers(url: str, *, timeout_s: float = FIRST_ANSWER_S) -> bool:
    """Whether a Prefect server answers at `url` within the time given."""
    try:
        return httpx.get(f"{url.rstrip('/')}/health", timeout=timeout_s).status_code == 200
    except httpx.HTTPError:
        return False


def run_ladder(workspace: Path) -> int:
    """Run the ladder as a flow, here and now; returns the exit code."""
    url = server_url()
    if url and not server_answers(url):
        print(
            f"PREFECT_API_URL is {url}, where no server answers within {FIRST_ANSWER_S:.0f} s, "
            "expected a running Prefect server. Start it, unset the variable, or run "
            "`python -m flows.reproduce`, which needs none.",
            file=sys.stderr,
        )
        return EXIT_FAULT
    plan = stages_by_gate(read_yaml(workspace / "dvc.yaml"))
    if unknown := sorted(set(plan) - set(GATES)):
        raise ConfigError(
            where="dvc.yaml",
            found=f"with the gates {', '.join(unknown)}",
            expected=f"only {', '.join(GATES)}",
            action="Correct the names of the stages.",
        )
    try:
        state = ladder(str(workspace.resolve()), return_state=True)
    finally:
        stop_all()
    if state.is_completed():
        return EXIT_DONE
    print(f"\nThe ladder stopped: {state.message}", file=sys.stderr)
    codes = {name: code for code, name in STATE_NAMES.items()} | dict.fromkeys(RED, EXIT_REFUSED)
    return codes.get(state.name or "", EXIT_FAULT)


def _publish(workspace: Path, letter: str, stopped: StageStoppedError | None) -> None:
    """Show the gate's report, or why there is none, in Prefect's own interface."""
    title = f"Gate {letter.upper()}"
    if stopped is not None and not stopped.verdict:  # a report that lies there is of an earlier run
        create_markdown_artifact(
            f"**{title} was not reached.** {stopped.sentence}",
            key=f"gate-{letter}",
            description=title,
        )
        return
    text = workspace / "reports" / f"gate_{letter}.md"
    if text.is_file():
        create_markdown_artifact(text.read_text(), key=f"gate-{letter}", description=title)
    page = text.with_suffix(".html")
    if page.is_file():
        create_link_artifact(
            page.resolve().as_uri(), key=f"gate-{letter}-report", link_text=f"{title}: report"
        )


def _api_url() -> str:
    with get_client(sync_client=True) as client:
        return str(client.api_url)


def _leave(url: str) -> None:
    print(
        f"The Prefect server at {url} has not answered for {SILENCE_S:.0f} s; the stage was "
        "stopped. Run again, or use `python -m flows.reproduce`, which needs no server.",
        file=sys.stderr,
        flush=True,
    )
    stop_all()
    os._exit(EXIT_FAULT)


if __name__ == "__main__":
    sys.exit(run_program("flows.commands:ladder", "python -m flows.ladder"))
