"""`python -m benchmarks.each_kind`: one set of weights as a candidate of each kind, judged alike?

The small ladder of `benchmarks/ladder_truth` is run until its flow is trained and pinned. That flow
is brought to a copy as `trained`, `torch`, `onnx` and `server`, by the product's own exports and
commands, and the copy is run to its end: nothing may train again. Printed is what gates B to D say
of each, what does not hold, and how far its chunks are from those of the bare network. Exit 1
where a verdict differs from that of the ladder's own flow, or chunks by more than the tolerance.

Policies of LeRobot, trained on the ladder's export, go with them where they are named; what is
said of them decides no exit code. Whom a gate stops is in no evidence above it, and a busy machine
may stop anybody at Gate B. So that all are seen above it too, each gate's report is kept, and
behind it the limits that they break are widened to what was measured: what stands in the table is
the kept report's, and above a stop it is a look. A run that was killed goes on where it was;
remove `--work` for a new one.

    python -m benchmarks.each_kind
    python -m benchmarks.each_kind --lerobot act=build/lerobot-act/checkpoints/last/pretrained_model
"""

import argparse
import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.each_kind import lerobot
from benchmarks.each_kind.compared import GATES, Apart, Judged, apart, differing, judged
from benchmarks.kinds import KINDS, of_each_kind
from benchmarks.ladder_truth.bringing import TWIN, as_the_twin, bring_weights, enter
from benchmarks.ladder_truth.outcome import settled
from benchmarks.ladder_truth.workspace import hold_to_limits, make_small_ladder, set_limit
from flows.reproduce import reproduce
from gates.report import report_path, stage_of

TOLERANCE = {"trained": 0.0, "server": 0.0, "torch": 1e-5, "onnx": 1e-4}
"""m, or of a number of a rotation; as docs/candidates.md states them."""
REASON = "the weights of the twin, hosted in another way"
PATIENCE = {"timeout_s": 20.0, "start_timeout_s": 300.0}
"""A neighbour on the machine must not cost an answer: lateness is judged by its own criteria."""


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.each_kind", description=__doc__)
    parser.add_argument("--work", type=Path, default=Path("build/each_kind"))
    parser.add_argument(
        "--lerobot", action="append", default=[], metavar="NAME=FOLDER", type=named,
        help="a pretrained_model folder of LeRobot",
    )  # fmt: skip
    parser.add_argument(
        "--python", type=Path, default=Path("build/lerobot/bin/python"), help="that has LeRobot"
    )
    parser.add_argument(
        "--data", type=Path, default=Path("build/lerobot-data"), help="export it was trained on"
    )
    parser.add_argument("--table", action="store_true", help="print what a run left, and stop")
    return parser.parse_args(argv)


def named(word: str) -> tuple[str, Path]:
    """`NAME=FOLDER`.

    Raises:
        ArgumentTypeError: It is not.
    """
    name, equals, folder = word.partition("=")
    if not (name and equals and folder):
        raise argparse.ArgumentTypeError(f"{word!r} is not NAME=FOLDER")
    return name, Path(folder)


def until_pinned(target: Path) -> Path:
    """The small ladder until it has trained and pinned its flow; from where it was killed."""
    done = target.with_name(f"{target.name}.done")
    if not done.exists():
        if not target.exists():
            hold_to_limits(make_small_ladder(target))
        settled(target, "reload")
        done.touch()
    return target


def bring_each_kind(workspace: Path) -> None:
    """Write the exports and entries of the ladder's own flow, and name them."""
    own = bring_weights(workspace)
    for kind, fields in of_each_kind(own, TWIN).items():
        name = f"as_{kind}"
        enter(
            workspace, {**as_the_twin(workspace, name), "kind": kind, **fields, **PATIENCE}, REASON
        )


def judge(workspace: Path, kept: Path, names: Sequence[str]) -> None:
    """Run gate after gate, keep each report, and let on whom it stops of those named."""
    for gate in GATES:
        file = kept / report_path(gate)
        if not file.exists():
            run(workspace, stage_of(gate))
            file.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(workspace / report_path(gate), file)
        if gate != GATES[-1]:
            widen(workspace, gate, [judged(kept, name) for name in names])
    run(workspace)


def widen(workspace: Path, gate: str, broken_by: Sequence[Judged]) -> None:
    """Move the limits of a gate that candidates break to the worst that was measured of them."""
    limits: dict[str, float] = {}
    for (where, name), answer in (pair for own in broken_by for pair in own.answers.items()):
        if where == gate and answer.verdict != "PASS" and answer.measured is not None:
            worse = max if answer.comparison == "<=" else min
            limits[name] = worse(limits.get(name, answer.measured), answer.measured)
    for name, limit in limits.items():
        set_limit(workspace, stage_of(gate), name, limit)


def run(workspace: Path, *stages: str) -> None:
    """Run a ladder to which candidates were brought; its own may not be trained again.

    Raises:
        SystemExit: It ended, or something was trained.
    """
    # A command of an entry finds what is installed; here that shall be the code of the ladder.
    os.environ["PYTHONPATH"] = str(workspace)
    lines: list[str] = []

    def echo(line: str) -> None:
        lines.append(line)
        print(line, file=sys.stderr, flush=True)

    end = reproduce(workspace, stages=stages, echo=echo)
    ran = [line.split("'")[1] for line in lines if line.startswith("Running stage '")]
    if again := [name for name in ran if name.startswith("train_")]:
        sys.exit(f"trained again: {', '.join(again)}")
    print(f"Ran: {', '.join(ran)}; {end.duration_s:.0f} s; exit {end.code}", flush=True)
    if end.code != 0 and not end.verdict:
        sys.exit(f"the ladder ended: {end.sentence}")


def table(found: dict[str, Judged], far: dict[str, Apart]) -> str:
    """Verdicts and chunks of each candidate, as a page wants them."""
    lines = ["| candidate | B | C | D | chunks apart | same bits | as at Gate B |"]
    lines.append("|---|---|---|---|---|---|---|")
    for name, own in found.items():
        cells = [own.verdicts[gate] for gate in GATES]
        if name in far:
            seen = far[name]
            cells += [f"{seen.largest:.1e}", f"{seen.identical} of {seen.fixtures}",
                      "yes" if seen.as_judged else "NO"]  # fmt: skip
        else:
            cells += ["-", "-", "-"]
        lines.append(f"| `{name}` | {' | '.join(cells)} |")
    return "\n".join(lines)


def wrong(found: dict[str, Judged], far: dict[str, Apart]) -> list[str]:
    """What is not as it must be of the same weights."""
    result = []
    for kind in KINDS:
        name = f"as_{kind}"
        result += [f"{name}: {text}" for text in differing(found[name], found[TWIN])]
        if not far[name].largest <= TOLERANCE[kind]:
            result.append(f"{name}: chunks {far[name].largest:.1e} apart, {TOLERANCE[kind]:g} told")
        if not far[name].as_judged:
            result.append(f"{name}: now it answers otherwise than at Gate B")
    return result


def main(argv: Sequence[str] | None = None) -> int:
    """Run, and print. 1 where the same weights are not judged the same."""
    args = arguments(argv)
    work = args.work.resolve()
    workspace, kept = work / "brought", work / "kept"
    if not args.table:
        bring(until_pinned(work / "small"), workspace, args)
        judge(workspace, kept, [TWIN, *(f"as_{kind}" for kind in KINDS), *dict(args.lerobot)])
    if not args.lerobot:
        print("No policy of LeRobot: none was named (--lerobot NAME=FOLDER, after `make lerobot`).")
    far = apart(workspace)
    found = {name: judged(kept, name) for name in (TWIN, *sorted(far))}
    print(table(found, {name: far[name] for name in far if name.startswith("as_")}))
    for name, own in found.items():
        print(f"\n{name}: {'; '.join(own.unmet) or 'every criterion holds'}")
    differences = wrong(found, far)
    print("\n" + ("\n".join(differences) or "Of the same weights every verdict is the same."))
    return 1 if differences else 0


def bring(base: Path, workspace: Path, args: argparse.Namespace) -> None:
    """A copy of the pinned ladder with everybody who is brought; once."""
    done = workspace.with_name(f"{workspace.name}.done")
    if done.exists():
        return
    shutil.rmtree(workspace, ignore_errors=True)
    shutil.copytree(base, workspace, symlinks=True)
    bring_each_kind(workspace)
    for name, folder in args.lerobot:
        lerobot.bring(workspace, name, folder, interpreter=args.python, data=args.data)
    done.touch()


if __name__ == "__main__":
    sys.exit(main())
