"""Commands of the gates: judge evidence, prove reports; what `gates.card.commands` registers.

Registered in `genpolicy.commands`. Exit codes: 0 done, 1 a fault of ours, 2 bad usage or input,
3 refused: a gate that does not pass, or a report that is not what the files say.
"""

import datetime
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from gates.package.commands import verify_bundle
from genpolicy.cli.commands import Contract, Format, Recordings, TaskName
from genpolicy.cli.shell import AsJson, examples, new_app, with_examples
from genpolicy.errors import BadInputError, GenpolicyError

if TYPE_CHECKING:
    from gates.report import Gate

Root = Annotated[Path, typer.Option(help="Repository root.")]
Letter = Annotated[str, typer.Argument(help="Gate: A, B, C, D or E.")]

Layout = Annotated[
    Literal["text", "json", "junit", "github"], typer.Option("--format", help="How to print it.")
]

gates = new_app("Judge evidence, prove reports; cards: `genpolicy card`.")
verify = new_app("Prove the reports that lie here, or a bundle.")
verify.command("bundle", epilog=examples("genpolicy verify bundle flow.zip"))(verify_bundle)


@with_examples(
    "genpolicy audit recordings/ --out audit/",
    "genpolicy audit recordings/ --contract contract.yaml --out audit/",
    "genpolicy audit dataset/ --out audit/",
)
def audit(
    path: Recordings,
    out: Annotated[Path, typer.Option(help="Folder to write, or to replace.")],
    layout: Format = "auto",
    contract: Contract = None,
    task: TaskName = None,
    limits: Annotated[
        Path | None,
        typer.Option(metavar="PARAMS", help="params.yaml whose gate_a holds the limits."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Root of all random draws.")] = 0,
) -> int:
    """Name the cause of different actions at one observation.

    Do the recordings hold several valid actions under one observation, or is a
    variable hidden, the data broken, a label wrong?

    Writes audit.html (read this), audit.json, contract.yaml (what was guessed;
    correct it and give it back), evidence/ and dataset/. The exit code is 0
    whatever the verdict: it was measured.
    """
    from genpolicy.cli.beforehand import check_folder, check_import, check_settings

    check_settings(limits, "--limits", "gate_a")
    check_import(path, out, format=layout, contract=contract)
    check_folder(out, "audit.json", "audit")
    from gates.audit.importing import AuditOptions, import_recordings

    options = AuditOptions(path, layout, contract, task, out=out, limits=limits, seed=seed)
    if limits is not None:  # a wrong limit is told before anything is read
        from gates.need.gate import read_cause_limits

        read_cause_limits(limits)
    opened = import_recordings(options)
    # What audits loads all of science; recordings that cannot be read are told before.
    from gates.audit.command import run_audit

    return run_audit(options, opened)


@with_examples("genpolicy shadow --method flow --out runs/flow")
def shadow(
    method: Annotated[str, typer.Option(help="A method that gate B admits.")],
    out: Annotated[Path, typer.Option(help="Folder of the run.")],
    episode: Annotated[str, typer.Option(help="UUID; the first held-out one if absent.")] = "",
    root: Root = Path(),
) -> int:
    """Replay an episode by the wall clock, down to the stub.

    The policy proposes in one process, supervisor and controller stub decide in
    another, under the pinned limits.yaml; nothing moves. A folder in which a stop
    stood, or a supervisor died, begins stopped. Exit 3 if gate B does not pass, 1
    if the independent checker finds a broken rule.
    """
    from gates.proof import admit
    from genpolicy.cli.shadow import ShadowOptions, run_shadow

    return run_shadow(ShadowOptions(root, out, method, episode), admit("shadow", root).candidates)


@gates.command(
    epilog=examples(
        "genpolicy gates check --through C", "genpolicy gates check --format junit > gates.xml"
    )
)
def check(
    through: Annotated[str, typer.Option(help="Last gate that must pass.")] = "D",
    root: Root = Path(),
    as_json: AsJson = False,
    layout: Layout = "text",
) -> int:
    """Prove the chain.

    Exit 0 if every gate up to `--through` passes, 3 if one does not or its
    report is untrue, 2 if a report or a setting cannot be read, or a limit is
    overridden by somebody who may not, in the name of another (as far as git
    knows), or no longer. Through E, git must show that the plan was committed
    before the evidence, and that nobody but the authors committed to the candidate;
    2 where it does not.

    `--format junit` prints a test for each criterion, `github` an annotation for
    each that does not hold.
    """
    from gates.card.history import require_history
    from gates.printed import not_built, print_cases, print_rungs, problems_beside, worst
    from gates.proof import prove_all
    from gates.report import GATES

    last = _gate(through)
    every = prove_all(root)
    rungs = every[: GATES.index(last) + 1]
    codes = {rung.exit_code for rung in rungs if rung.verdict != "PASS"}
    problems = problems_beside(root, rungs)
    if last == "E" and not codes:
        try:
            require_history(root)
        except GenpolicyError as error:
            if str(error) not in {text for _, text, _, _ in problems}:
                problems.append(("history", str(error), "preregistration.yaml", error.exit_code))
    if layout in ("junit", "github"):
        print_cases(root, rungs, problems, layout)
    elif layout == "text" and not as_json and (said := not_built(root, every)):
        print(said)
    else:
        print_rungs(rungs, as_json or layout == "json")
    for _, text, _, _ in problems:
        print(text, file=sys.stderr)
    return worst(codes | {code for *_, code in problems})


@gates.command("verify", epilog=examples("genpolicy gates verify --json"))
@verify.command("report", epilog=examples("genpolicy verify report --json"))
def verify_reports(root: Root = Path(), as_json: AsJson = False) -> int:
    """Hash all evidence, derive all verdicts again.

    The independent checker reads every journal again, and each rollout must be
    what its journal says; all pages must be those that the reports give.
    Exit 3 if a report is untrue, 2 if one cannot be read.
    """
    from gates.printed import NOT_BUILT, not_built, pages_code, print_rungs, worst
    from gates.proof import prove_all

    every = prove_all(root)
    rungs = [rung for rung in every if rung.verdict != "NOT JUDGED"]
    if said := not_built(root, every) or (not rungs and NOT_BUILT):
        print(said, file=sys.stderr)
        return worst({3, *(rung.exit_code for rung in rungs)})
    # What derives again loads simulation and compiled kernels: not to say that nothing lies here.
    from gates.rederive import rederived

    rungs = rederived(root, rungs)
    print_rungs(rungs, as_json)
    codes = {rung.exit_code for rung in rungs if rung.verdict == "REFUSED"}
    return worst(codes | pages_code(root))


@gates.command(epilog=examples("genpolicy gates show C"))
def show(letter: Letter, root: Root = Path(), as_json: AsJson = False) -> int:
    """Print one report as it lies there, not proved."""
    from gates.overview import painted
    from gates.printed import coloured
    from gates.readable import found_text, limit_text
    from gates.report import read_report

    report, digest = read_report(root, _gate(letter))
    if as_json:
        print(report.model_dump_json(indent=2))
        return 0
    colour = coloured()
    verdict = painted(report.verdict, wide=0, colour=colour)
    print(f"Gate {report.gate}: {verdict}  (report {digest[:12]}, not proved)")
    print(f"Decision: {report.decision}")
    if report.diagnosis:
        print(f"Diagnosis: {report.diagnosis}")
    for c in report.criteria:
        name = f"{c.id} ({c.candidate})" if c.candidate else c.id
        verdict = painted(c.verdict, wide=14, colour=colour)
        print(f"  {verdict} {name}: {found_text(c)}, required {limit_text(c)}")
    return 0


@gates.command(epilog=examples("genpolicy gates judge A"))
def judge(letter: Letter, root: Root = Path()) -> int:
    """Judge the evidence here, write the report. A FAIL exits 0 like any verdict."""
    from gates.verdicts import decided_text
    from gates.writing import write_gate

    report = write_gate(root, _gate(letter))
    print(f"Gate {report.gate}: {report.verdict}. {decided_text(report) or report.decision}")
    return 0


@gates.command(epilog=examples("genpolicy gates preregister"))
def preregister(root: Root = Path()) -> int:
    """Write preregistration.yaml from params.yaml. Commit it, then run the ladder."""
    from gates.preregistration import PREREGISTRATION, plan_bytes
    from gates.settings import read_params
    from genpolicy.integrity.atomic import write_bytes

    write_bytes(root / PREREGISTRATION, plan_bytes(read_params(root)))
    print(f"Wrote {PREREGISTRATION}. Commit it before the evidence exists.")
    return 0


def verify_card(
    root: Root = Path(),
    today: Annotated[str, typer.Option(help="Day to judge for, YYYY-MM-DD; default today.")] = "",
    as_json: AsJson = False,
) -> int:
    """Judge gate E without writing. Exit 0 only for a valid, complete, signed card.

    Where it would pass, all is asked that `card sign` asks before a signature.
    """
    from gates.overview import painted
    from gates.printed import coloured
    from gates.proof import judge

    report = judge(root, "E", today=_day(today) if today else None)
    if report.verdict == "PASS":
        require_beneath(root)
    if as_json:
        print(report.model_dump_json(indent=2))
    else:
        colour = coloured()
        print(f"{painted(report.verdict, wide=0, colour=colour)}: {report.decision}")
        for c in report.criteria:
            verdict = painted(c.verdict, wide=14, colour=colour)
            print(f"  {verdict} {c.id}: {'; '.join(filter(None, (c.counted, c.caveat)))}")
    return 0 if report.verdict == "PASS" else 3


@gates.command(epilog=examples("genpolicy gates summary --json"))
def summary(root: Root = Path(), as_json: AsJson = False) -> int:
    """The ladder in one table, each report proved; always exits 0.

    On a terminal no line is longer than 80 columns, and verdicts are coloured
    unless NO_COLOR is set; in a pipe each stage has one line.
    """
    from gates.overview import as_text, overview
    from gates.printed import coloured, not_built, print_rows
    from gates.proof import prove_all
    from gates.writing import INDEX

    rungs = prove_all(root)
    lines = overview(root, rungs)
    if as_json:
        print_rows(lines)
        return 0
    if (said := not_built(root, rungs)) and all(line.seconds is None for line in lines):
        print(said)
        return 0
    print(as_text(lines, terminal=sys.stdout.isatty(), colour=coloured()))
    if (root / INDEX).is_file():
        print(f"Reports: {INDEX}")
    return 0


WHATEVER: dict[str, Any] = {"ignore_unknown_options": True, "allow_extra_args": True}
"""What was typed behind a retired name is not read."""


def retired(group: typer.Typer, name: str, instead: str) -> None:
    """Keep a name that is no command any more, so that it says what is.

    Args:
        group: Where it was.
        name: The name.
        instead: What to type in its place.
    """

    def say(context: typer.Context) -> int:
        raise BadInputError(
            where=context.command_path,
            found="no command any more",
            expected=f"genpolicy {instead}",
            action=f"See `genpolicy {instead} --help`.",
        )

    say.__doc__ = f"No command any more: `genpolicy {instead}`."
    epilog = examples(f"genpolicy {instead} --help")
    group.command(name, hidden=True, context_settings=WHATEVER, epilog=epilog)(say)


sign = new_app("No command any more: `genpolicy card sign`.")
retired(sign, "sign", "card sign")
retired(gates, "sign", "card sign")
retired(gates, "verify-card", "card verify")
retired(verify, "card", "card verify")


def require_beneath(root: Path) -> None:
    """What a proved chain does not show: its history, and that its journals say the same.

    Pages too, but for Gate E's: it shows who has signed, and the next signature makes it old.
    """
    from gates.card.history import require_history
    from gates.rederive import rederive
    from gates.report import GATES

    require_history(root)
    for gate in GATES:
        rederive(root, gate, printed=gate != "E")


def _gate(letter: str) -> "Gate":
    from gates.report import GATES

    for gate in GATES:
        if letter.upper() in {gate, f"GATE_{gate}"}:
            return gate
    raise BadInputError(
        where="gate", found=repr(letter), expected="A, B, C, D or E", action="Name one gate."
    )


def _day(text: str) -> datetime.date:
    try:
        return datetime.date.fromisoformat(text)
    except ValueError as error:
        raise BadInputError(
            where="--today", found=repr(text), expected="YYYY-MM-DD", action="Give a day."
        ) from error
