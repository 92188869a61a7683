"""`python -m benchmarks.ten_minutes LADDER`: from a checkpoint on disk to a verdict, by the clock.

A ladder that has run is copied, and a checkpoint of it is brought as `docs/candidates.md` walks:
written as a program, its entry beside it, checked, named in `params.yaml`, judged. Printed is what
each step took against the ten minutes. Gates B to D are timed with everybody in them: a candidate
more measures all of them again, since they are compared on one machine in one mood.

The ladder's own code runs in the copy, so that nothing of it trains again. Exit 1 where the walk
took longer, or a gate did not judge the candidate; which verdict it gets decides nothing.

    python -m benchmarks.ten_minutes build/each_kind/small --kind onnx
"""

import argparse
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.each_kind.compared import GATES
from benchmarks.kinds import KINDS, of_each_kind
from benchmarks.ladder_truth.bringing import OWN, TWIN, as_the_twin, bring_weights, enter
from benchmarks.ladder_truth.workspace import edit_params
from flows.reproduce import reproduce
from gates.report import report_path, stage_of
from genpolicy.integrity.documents import read_json

TEN_MINUTES_S = 600.0
NAME = "my_flow"
REASON = "the checkpoint of a ladder, as somebody else's"
REFUSED = 3

Step = tuple[str, float, str]
"""What was done, how long it took, s, and what became of it."""


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ten_minutes", description=__doc__)
    parser.add_argument("ladder", type=Path, help="workspace of a ladder that has run")
    parser.add_argument("--kind", choices=KINDS, default="torch", help="how it is hosted")
    parser.add_argument("--last", choices=GATES, default=GATES[-1], help="gate to stop behind")
    return parser.parse_args(argv)


@contextmanager
def copied(ladder: Path) -> Iterator[Path]:
    """The ladder without those that were brought to it before."""
    with TemporaryDirectory() as scratch:
        workspace = Path(scratch) / "ladder"
        shutil.copytree(ladder, workspace, symlinks=True)
        shutil.rmtree(workspace / OWN, ignore_errors=True)

        def nobody(params: dict[str, Any]) -> None:
            params["candidates"], params["gate_b"]["unmatched"] = {}, {}

        edit_params(workspace, nobody)
        yield workspace


def walk(workspace: Path, *, kind: str, last: str) -> Iterator[Step]:
    """The steps of the page, one after the other."""
    own = bring_weights(workspace)

    def written() -> str:
        fields = of_each_kind(own, TWIN)[kind]
        entry = {**as_the_twin(workspace, NAME), "kind": kind, **fields}
        enter(workspace, entry, REASON)
        return f"{OWN}/{NAME}.yaml"

    yield timed(f"entry of kind {kind}, its files written", written)
    yield timed("check-candidate", lambda: checked(workspace))
    for gate in GATES[: GATES.index(last) + 1]:
        yield timed(f"gate {gate}, and what it judges", lambda gate=gate: judged(workspace, gate))


def timed(what: str, work: Callable[[], str]) -> Step:
    """A step and its wall time, s."""
    begun = time.perf_counter()
    said = work()
    return what, time.perf_counter() - begun, said


def checked(workspace: Path) -> str:
    """What the conformance kit found, in a word.

    Raises:
        SystemExit: It did not run.
    """
    words = ["check-candidate", f"{OWN}/{NAME}.yaml", "--dataset", "artifacts/ingest"]
    done = subprocess.run(
        [sys.executable, "-m", "genpolicy", *words], cwd=workspace, capture_output=True, text=True,
        check=False, env=os.environ | {"PYTHONPATH": str(workspace)},
    )  # fmt: skip
    if done.returncode not in (0, REFUSED):
        sys.exit(f"check-candidate ended with {done.returncode}: {done.stderr}")
    return "holds" if done.returncode == 0 else "refuses"


def judged(workspace: Path, gate: str) -> str:
    """The verdict of a gate on the candidate, after its evidence was measured."""
    os.environ["PYTHONPATH"] = str(workspace)
    reproduce(workspace, stages=(stage_of(gate),), echo=lambda line: print(line, file=sys.stderr))
    said = read_json(workspace / report_path(gate))["candidates"]
    return str(said.get(NAME, NOBODY))


NOBODY = "not judged"


def table(steps: Sequence[Step]) -> str:
    """Seconds of each step and of all, as a page wants them."""
    total_s = sum(seconds for _, seconds, _ in steps)
    rows = [*steps, ("together", total_s, f"of {TEN_MINUTES_S:.0f} s")]
    lines = ["| step | s | |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {what} | {s:.0f} | {said} |" for what, s, said in rows)])


def main(argv: Sequence[str] | None = None) -> int:
    """Walk, and print. 1 where it took longer than ten minutes, or nobody judged."""
    args = arguments(argv)
    steps = []
    with copied(args.ladder) as workspace:
        for step in walk(workspace, kind=args.kind, last=args.last):
            print(f"{step[0]}: {step[1]:.0f} s, {step[2]}", file=sys.stderr, flush=True)
            steps.append(step)
    print(table(steps))
    total_s = sum(seconds for _, seconds, _ in steps)
    return 1 if total_s > TEN_MINUTES_S or any(said == NOBODY for *_, said in steps) else 0


if __name__ == "__main__":
    sys.exit(main())
