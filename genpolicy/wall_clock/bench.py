"""What both clocks are given: windows of recorded episodes, limits, and the draws of every term."""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml
from pydantic import Field

from genpolicy.contract.settings import Settings
from genpolicy.data.dataset import Dataset
from genpolicy.evidence.admission_context import make_checker
from genpolicy.evidence.stress.latency import LatencyModel, draw_latency
from genpolicy.execution.cell import Cell
from genpolicy.feasibility.admission import FeasibilityChecker
from genpolicy.feasibility.settings import FeasibilitySettings
from genpolicy.integrity.atomic import write_bytes
from genpolicy.seeds import stream
from genpolicy.tasks.api import Task, load_task
from genpolicy.tasks.fixtures import PINS
from genpolicy.wall_clock.limits import LIMITS, WallClockLimits, pin_limits, read_limits
from genpolicy.wall_clock.recorded import replay_of
from genpolicy.wall_clock.replay import Replay

CONDITION = "wall_clock"
"""Name of the draws, in the place of a perturbation."""
HELD_OUT = "test"


class WallClockSection(Settings):
    """Section `wall_clock`.

    Attributes:
        episodes: Held-out episodes of which a window is replayed, at most.
        rows: Rows of a window: room for two warm invocations of the default horizons, of one of
            them until its chunk has given way.
    """

    episodes: int = Field(ge=1)
    rows: int = Field(default=16, ge=1)


@dataclass(frozen=True)
class Bench:
    """What all candidates share.

    Attributes:
        root: Workspace with the pinned limits of the run.
        task: The task.
        windows: What is replayed.
        samples: Candidates that an invocation of a stochastic method draws.
        root_seed: Root of the draws.
    """

    root: Path
    task: Task
    windows: Sequence[Replay]
    samples: int
    root_seed: int

    def terms_s(self, model: LatencyModel, window: int, invocation: int) -> Mapping[str, float]:
        """The drawn terms of an invocation, s; equal for both clocks where they are declared."""
        drawn = draw_latency(
            model, root_seed=self.root_seed, perturbation=CONDITION, start=window,
            invocation=invocation, extra_s={}, compute_factor=1.0,
        )  # fmt: skip
        return drawn.terms

    def checker(self) -> FeasibilityChecker:
        """The six layers."""
        limits = read_limits(self.root)
        return make_checker(
            self.task, limits.feasibility, action_period_s=limits.horizons.action_period_s
        )


def limits_of(task: str, cell: Cell, feasibility: FeasibilitySettings) -> WallClockLimits:
    """Limits of a run that is held to what Gate D is, and to a silence that stops.

    The deadlines of single terms are left out: a wall clock knows whole answers. Silence stops
    after as long as recovery begins in Gate D; no recovery runs here.
    """
    silence_s = cell.execution.hold_before_recovery_s
    return WallClockLimits(
        task=task,
        horizons=cell.horizons,
        execution=cell.execution.model_copy(
            update={"term_deadlines": {}, "silence_stop_s": silence_s}
        ),
        feasibility=feasibility,
    )


@contextmanager
def bench(
    data: Dataset,
    limits: WallClockLimits,
    *,
    section: WallClockSection,
    samples: int,
    root_seed: int,
    pins: Path,
) -> Iterator[Bench]:
    """Windows, and the limits pinned in a workspace of its own.

    Args:
        data: The dataset.
        limits: What both clocks are held to.
        section: How much is replayed.
        samples: Candidates that an invocation of a stochastic method draws.
        root_seed: Root of the draws.
        pins: The workspace's pinned fixtures.
    """
    task = load_task(limits.task)
    with TemporaryDirectory() as scratch:
        root = Path(scratch)
        write_bytes(root / LIMITS, yaml.safe_dump(limits.model_dump(mode="json")).encode())
        shutil.copyfile(pins, root / PINS)
        pin_limits(root)
        found = windows(data, task, section, root_seed=root_seed)
        yield Bench(root, task, found, samples, root_seed)


def windows(
    data: Dataset, task: Task, section: WallClockSection, *, root_seed: int
) -> list[Replay]:
    """A window of each of some held-out episodes that are long enough, from a drawn row on."""
    generator = stream(root_seed, CONDITION, "windows")
    held_out = data.split(HELD_OUT).episodes
    names = sorted(held_out["episode_uuid"].astype(str))
    whole = (replay_of(data, task, names[at]) for at in generator.permutation(len(names)))
    found: list[Replay] = []
    for replay in whole:
        if len(found) == section.episodes:
            break
        if len(replay) >= section.rows:
            first = int(generator.integers(0, len(replay) - section.rows + 1))
            found.append(replay.part(first, section.rows))
    return found
