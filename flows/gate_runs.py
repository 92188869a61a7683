"""The stages of a gate as Prefect tasks; the run of a gate ends in a state named by its verdict.

Prefect decides when to go on, shows and schedules it; DVC knows what is up to date; the gates
judge. A gate that does not pass is a failed task and a failed flow, named by its verdict. Retries
are for faults of the machine only: a refusal or a bad input does not become better by itself.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flows import prefect_settings  # noqa: F401

# isort: split
from prefect import State, get_run_logger, task
from prefect.artifacts import create_link_artifact, create_markdown_artifact
from prefect.cache_policies import NO_CACHE
from prefect.states import Completed, Failed

from flows.judged import GOES_ON, PENDING, judged
from flows.reproduce import (
    EXIT_BAD_INPUT,
    EXIT_DONE,
    EXIT_FAULT,
    EXIT_REFUSED,
    reproduce,
)

RETRIES = 2
RETRY_DELAY_S = (5.0, 20.0)

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
    cache_policy=NO_CACHE,  # DVC knows what is up to date; a run that is resumed judges again
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


def run_gate(workspace: Path, letter: str, stages: Sequence[str]) -> State[Any]:
    """Run the stages of a gate, publish its report, and end as it judges.

    Args:
        workspace: Folder with `dvc.yaml`.
        letter: Of the gate.
        stages: Its stages in order; the last one judges.

    Returns:
        The state for its flow run: completed, named `PENDING_REVIEW` where it waits for people,
        or failed, named by the verdict or by what stopped it.
    """
    stopped: StageStoppedError | None = None
    for stage in stages:
        state = reproduce_stage(str(workspace), stage, return_state=True)
        if not state.is_completed():
            error = state.result(raise_on_failure=False)
            stopped = (
                error
                if isinstance(error, StageStoppedError)
                else StageStoppedError(EXIT_FAULT, f"{stage}: {state.message}", False)
            )
            break
    _publish(workspace, letter, stopped)
    if stopped is not None:
        name = stopped.verdict or STATE_NAMES[stopped.code]
        return Failed(name=name, message=stopped.sentence)
    verdict, sentence = judged(workspace, f"gate_{letter}")
    if verdict not in GOES_ON:  # no stage was run that could have said so
        return Failed(name=verdict, message=sentence)
    return Completed(name=verdict if verdict == PENDING else None, message=sentence)


def exit_code(state: State[Any]) -> int:
    """Exit code of the ladder for the state in which a flow run ended, or waits."""
    if state.is_completed() or state.is_paused():
        return EXIT_DONE
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
