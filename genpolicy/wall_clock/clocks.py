"""The two clocks on the same recorded windows: one candidate, its journals, and what they say.

By the wall clock the policy answers in a process of its own while the supervisor's ticks, and the
terms that this machine has none of (exposure to transfer, network, queue) are delays of the line
between them. By the virtual clock the same draws of these terms are added to draws of what Gate B
measured. Both replay the windows one after the other, each a session of its own.
"""

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.contenders import Promotable, Running
from genpolicy.candidates.hosts.translation import as_server
from genpolicy.candidates.judged import candidates_of
from genpolicy.candidates.wire.entry import ServerEntry, verify_files
from genpolicy.candidates.wire.faults import PolicyError
from genpolicy.candidates.wire.launched import Launched
from genpolicy.candidates.wire.policy import WirePolicy
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.contract.latency import Term
from genpolicy.evidence.documents.shadow import CHECKER
from genpolicy.evidence.rows.clocks import ClockAgeRow, ClockInvocationRow, ClockTickRow
from genpolicy.evidence.shadow.tables import checker_document
from genpolicy.evidence.stress.latency import LatencyModel
from genpolicy.integrity.atomic import write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.rows import write_rows
from genpolicy.progress import ProgressLine
from genpolicy.tasks.api import Task
from genpolicy.verification.clocks import derived_windows
from genpolicy.wall_clock.admission import judge
from genpolicy.wall_clock.bench import Bench
from genpolicy.wall_clock.limits import read_limits
from genpolicy.wall_clock.policy import answer_of
from genpolicy.wall_clock.proxy import LinePlan, planned
from genpolicy.wall_clock.request import WallClockRequest
from genpolicy.wall_clock.run import POLICY, PROXY, loading, start
from genpolicy.wall_clock.session import SupervisedSession
from genpolicy.wall_clock.streamed import JOURNAL, StreamedJournal, collect, session_file
from genpolicy.wall_clock.virtual import run_virtually

WALL, VIRTUAL = "wall", "virtual"
TO_POLICY = (Term.EXPOSURE, Term.CAPTURE, Term.DECODE, Term.TRANSFER)
TO_SUPERVISOR = (Term.NETWORK, Term.QUEUE)
PLAN = "line.json"
TABLES: dict[type, str] = {
    ClockInvocationRow: "invocations.parquet",
    ClockAgeRow: "ages.parquet",
    ClockTickRow: "ticks.parquet",
}


def write_clocks(
    folder: Path,
    shared: Bench,
    candidates: Sequence[Promotable],
    models: Mapping[str, LatencyModel],
) -> None:
    """Journals of every candidate by both clocks, what they say, and what the checker says of them.

    Args:
        folder: Existing folder.
        shared: What all candidates share.
        candidates: Who is replayed.
        models: Latency of each, by name.
    """
    journals = folder / "journals"
    journals.mkdir()
    paths: list[Path] = []
    said, clocks = ProgressLine("runs of a clock"), 2 * len(candidates)
    for place, candidate in enumerate(candidates):
        said(2 * place, clocks)  # between two runs, while nothing is timed
        # A server that is not there costs its candidate the comparison, and Gate D says so.
        try:
            model, halfway = models[candidate.name], partial(said, 2 * place + 1, clocks)
            paths += run_both(shared, candidate, model, journals=journals, between=halfway)
        except PolicyError:
            for left in journals.glob(f"{candidate.name}__*"):
                left.unlink()
    said.close()
    cell = read_limits(shared.root).cell
    found = derived_windows(paths, deadline_s=cell.execution.deadline_s)
    for row, columns in (
        (ClockInvocationRow, found.invocations), (ClockAgeRow, found.ages),
        (ClockTickRow, found.ticks),
    ):  # fmt: skip
        write_rows(folder / TABLES[row], row, [row(**values) for values in columns])
    checker = shared.checker()
    CHECKER.write(folder, checker_document(paths, cell=cell, robot=checker.cell))


def run_both(
    shared: Bench,
    candidate: Promotable,
    model: LatencyModel,
    *,
    journals: Path,
    between: Callable[[], None],
) -> tuple[Path, Path]:
    """Replay every window by the wall clock, then by the virtual one.

    Args:
        shared: What all candidates share.
        candidate: Who answers.
        model: Its latency, as Gate B measured it.
        journals: Existing folder.
        between: Called behind the first clock.

    Returns:
        Paths of the two journals.

    Raises:
        PolicyError: It is behind the wire, and its server is not there.
        GenpolicyError: The supervisor's process died.
        IntegrityError: Its files are not those of its identity.
    """
    paths = tuple(journals / f"{candidate.name}__{clock}.mcap" for clock in (WALL, VIRTUAL))
    with TemporaryDirectory() as scratch, _asked_elsewhere(candidate, shared) as asked:
        request = WallClockRequest(
            root=str(shared.root), method=candidate.name, checkpoint=asked.checkpoint,
            sampler=asked.sampler, replay=shared.windows[0], then=tuple(shared.windows[1:]),
        )  # fmt: skip
        by_the_wall = Path(scratch) / WALL
        by_the_wall.mkdir()
        write_bytes(by_the_wall / PLAN, canonical_json(line(shared, model)))
        running = start(
            by_the_wall, request, [*asked.command, "--candidates", str(asked.candidates)],
            line=[*PROXY, str(by_the_wall / PLAN)], ready=True,
        )  # fmt: skip
        running.wait()
        shutil.move(by_the_wall / JOURNAL, paths[0])
        between()
        with asked.here() as policy:
            virtually(shared, policy, asked.candidates, request, model, folder=Path(scratch))
        shutil.move(Path(scratch) / JOURNAL, paths[1])
    return paths[0], paths[1]


def line(shared: Bench, model: LatencyModel) -> dict[str, object]:
    """Plan of the line: the declared terms of each invocation, before it and behind it."""
    asks, answers = {}, {}
    for window, replay in enumerate(shared.windows):
        for number in range(len(replay)):
            terms = shared.terms_s(model, window, number)
            asks[window, number] = [sum(terms[term] for term in TO_POLICY)]
            answers[window, number] = [sum(terms[term] for term in TO_SUPERVISOR)]
    return LinePlan(asks=planned(asks), answers=planned(answers)).model_dump(mode="json")


def virtually(
    shared: Bench,
    policy: Running,
    count: int,
    request: WallClockRequest,
    model: LatencyModel,
    *,
    folder: Path,
) -> None:
    """The same windows by the virtual clock; the journal of all is left in the folder."""
    limits = read_limits(shared.root)
    checker = shared.checker()
    for number, replay in enumerate(shared.windows):
        name = f"{policy.method}/virtual_clock/{number}"
        labels = {"method": policy.method, "episode": replay.episode_uuid}
        session = SupervisedSession(
            shared.task, limits.cell, request.model_copy(update={"replay": replay, "then": ()}),
            StreamedJournal(name, session_file(folder, number), labels), stop_stands=False,
        )  # fmt: skip
        run_virtually(
            session,
            sample=partial(answer_of, policy, candidates=count),
            latency_s=partial(_total_s, shared, model, number),
            judged=partial(judge, shared.task, checker),
        )
    collect(folder)


def _total_s(shared: Bench, model: LatencyModel, window: int, invocation: int) -> float:
    return sum(shared.terms_s(model, window, invocation).values())


@dataclass(frozen=True)
class _Asked:
    """A candidate that another process asks, and then this one; never both at once.

    Attributes:
        checkpoint: Its weights.
        sampler: Its sampler settings.
        candidates: Drawn in an invocation.
        command: Of the process that asks it.
        here: The same, asked here.
    """

    checkpoint: str
    sampler: str
    candidates: int
    command: list[str]
    here: Callable[[], AbstractContextManager[Running]]


@contextmanager
def _asked_elsewhere(candidate: Promotable, shared: Bench) -> Iterator[_Asked]:
    """The server of one that was brought is started and ended here: no kill leaves it behind."""
    if not isinstance(candidate, BroughtPolicy):
        policy = candidate.load()
        yield _Asked(
            policy.checkpoint_hash, policy.sampler_config_hash,
            candidates_of(policy, shared.samples),
            loading(candidate.folder, candidate.sha256, device=candidate.device),
            lambda: nullcontext(policy),
        )  # fmt: skip
        return
    verify_files(candidate.entry, candidate.folder)
    entry = as_server(candidate.entry, candidate.path, shared.task.observation)
    with Launched(entry, candidate.folder) as server:
        words = [str(candidate.path), candidate.sha256, "--address", server.address]
        yield _Asked(
            candidate.sha256, candidate.sampler_sha256,
            shared.samples if candidate.entry.stochastic else 1,
            [*POLICY, *words, "--task", read_limits(shared.root).task],
            partial(_connected, candidate, entry, server, shared.task),
        )  # fmt: skip


@contextmanager
def _connected(
    brought: BroughtPolicy, entry: ServerEntry, server: Launched, task: Task
) -> Iterator[WirePolicy]:
    remote = RemotePolicy(
        entry, server.address, task.observation, scene=task.scene_path, ended=server.died
    )
    try:
        yield WirePolicy(brought, remote)
    finally:
        remote.close()
