"""Command line of the gates: `python -m gates <command>`.

Exit codes: 0 done, 1 not every gate passes (`check`) or a fault of ours, 2 bad input, 3 refused.
"""

import dataclasses
import datetime
import functools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from gates import proof
from gates.card.signing import sign_card
from gates.overview import as_text, overview
from gates.proof import Rung, decided_text, prove_all, prove_chain
from gates.report import GATES, Gate, limit_text, measured_text, read_report
from genpolicy.errors import BadInputError, GenpolicyError

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Judge evidence, prove reports, sign and verify trial cards.",
)
Root = Annotated[Path, typer.Option(help="Repository root.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
INDEX = "reports/index.html"
Letter = Annotated[str, typer.Argument(help="Gate: A, B, C, D or E.")]


def _clean(command: Callable[..., None]) -> Callable[..., None]:
    """Errors of the project become one sentence and their exit code."""

    @functools.wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except GenpolicyError as error:
            typer.echo(str(error), err=True)
            raise typer.Exit(error.exit_code) from None

    return wrapped


def _gate(letter: str) -> Gate:
    for gate in GATES:
        if letter.upper() in {gate, f"GATE_{gate}"}:
            return gate
    raise BadInputError(
        where="gate", found=repr(letter), expected="A, B, C, D or E", action="Name one gate."
    )


def _print_rungs(rungs: list[Rung], as_json: bool) -> None:
    if as_json:
        rows = [dataclasses.asdict(rung) for rung in rungs]
        typer.echo(json.dumps(rows, indent=2, ensure_ascii=False))
        return
    wide = max(len(rung.name) for rung in rungs)
    for rung in rungs:
        name = f"{rung.gate}  {rung.name:<{wide}}  {rung.verdict:<14}"
        typer.echo(f"{name}  {rung.decided_by or rung.note}".rstrip())


@app.command()
@_clean
def check(
    through: Annotated[str, typer.Option(help="Last gate that must pass.")] = "D",
    root: Root = Path(),
    as_json: AsJson = False,
) -> None:
    """Prove the chain; exit 0 if every gate up to `--through` passes, else 1."""
    last = _gate(through)
    rungs = prove_all(root)[: GATES.index(last) + 1]
    _print_rungs(rungs, as_json)
    if any(rung.verdict != "PASS" for rung in rungs):
        raise typer.Exit(1)


@app.command()
@_clean
def verify(root: Root = Path(), as_json: AsJson = False) -> None:
    """Hash every material and derive every verdict again; exit 2 or 3 if a report is untrue."""
    rungs = [rung for rung in prove_all(root) if rung.verdict != "NOT JUDGED"]
    if not rungs:
        typer.echo("No report lies here. Run `dvc repro gate_a`.", err=True)
        raise typer.Exit(3)
    _print_rungs(rungs, as_json)
    untrue = [rung.exit_code for rung in rungs if rung.verdict == "REFUSED"]
    if untrue:
        raise typer.Exit(max(untrue))


@app.command()
@_clean
def show(letter: Letter, root: Root = Path(), as_json: AsJson = False) -> None:
    """Print one report as it lies there, not proved."""
    report, digest = read_report(root, _gate(letter))
    if as_json:
        typer.echo(report.model_dump_json(indent=2))
        return
    typer.echo(f"Gate {report.gate}: {report.verdict}  (report {digest[:12]}, not proved)")
    typer.echo(f"Decision: {report.decision}")
    if report.diagnosis:
        typer.echo(f"Diagnosis: {report.diagnosis}")
    for c in report.criteria:
        name = f"{c.id} ({c.candidate})" if c.candidate else c.id
        numbers = f"{measured_text(c)}, required {limit_text(c)}"
        typer.echo(f"  {c.verdict:<14} {name}: {numbers}")


@app.command()
@_clean
def judge(letter: Letter, root: Root = Path()) -> None:
    """Judge the evidence that lies here and write the report; a FAIL exits 0 like any verdict."""
    from gates.writing import write_gate  # noqa: PLC0415 - loads the plotting library

    report = write_gate(root, _gate(letter))
    text = decided_text(report) or report.decision
    typer.echo(f"Gate {report.gate}: {report.verdict}. {text}")


@app.command()
@_clean
def sign(
    card: Annotated[Path, typer.Option(help="Completed card, or an envelope to sign as well.")],
    key: Annotated[Path, typer.Option(help="Your private key, PEM, Ed25519.")],
    reviewer: Annotated[str, typer.Option(help="Your name as on reviewers.yaml.")],
    root: Root = Path(),
) -> None:
    """Add your signature to a trial card, after gates A to D are proved again."""
    prove_chain(root, "D")
    path = sign_card(root, card_file=card, key_file=key, reviewer=reviewer)
    typer.echo(f"Signed {path.name} as {reviewer}. Judge gate E again to see what is missing.")


@app.command("verify-card")
@_clean
def verify_card(
    root: Root = Path(),
    today: Annotated[str, typer.Option(help="Day to judge for, YYYY-MM-DD; default today.")] = "",
    as_json: AsJson = False,
) -> None:
    """Judge gate E without writing; exit 0 only for a valid, complete, signed card."""
    report = proof.judge(root, "E", today=_day(today) if today else None)
    if as_json:
        typer.echo(report.model_dump_json(indent=2))
    else:
        typer.echo(f"{report.verdict}: {report.decision}")
        for c in report.criteria:
            typer.echo(f"  {c.verdict:<14} {c.id}: {c.caveat}")
    if report.verdict != "PASS":
        raise typer.Exit(3)


@app.command()
@_clean
def summary(root: Root = Path(), as_json: AsJson = False) -> None:
    """The ladder in one table, each report proved; always exits 0."""
    lines = overview(root, prove_all(root))
    if as_json:
        rows = [dataclasses.asdict(line) for line in lines]
        typer.echo(json.dumps(rows, indent=2, ensure_ascii=False))
        return
    typer.echo(as_text(lines))
    if (root / INDEX).is_file():
        typer.echo(f"Reports: {INDEX}")


def _day(text: str) -> datetime.date:
    try:
        return datetime.date.fromisoformat(text)
    except ValueError as error:
        raise BadInputError(
            where="--today", found=repr(text), expected="YYYY-MM-DD", action="Give a day."
        ) from error


if __name__ == "__main__":
    app()
