"""Commands about whole runs: what a planned one can decide, and what moved between two.

Registered in `genpolicy.commands`; exit codes as in `gates.commands`.
"""

from pathlib import Path
from typing import Annotated

import typer

from gates.commands import Root
from genpolicy.cli.shell import AsJson, examples, new_app, with_examples

report = new_app("What no page says of a run, and what moved between two.")


@with_examples("genpolicy plan", "genpolicy plan --json")
def plan(root: Root = Path(), as_json: AsJson = False) -> int:
    """Say what gate D can decide with the planned starts.

    Which results keep each limit at this number of starts, and the smallest
    gain that the paired test finds. Reads params.yaml alone. Exit 3 if a limit
    cannot be kept by any result: the gate would be INCONCLUSIVE in any case, or
    a FAIL, where the test promotes without a gain.
    """
    from gates.plan_text import plan_text
    from gates.planning import plan_of
    from gates.printed import print_document

    found = plan_of(root)
    if as_json:
        print_document(found.as_document())
    else:
        print(plan_text(found))
    return 3 if found.undecidable else 0


@report.command("diff", epilog=examples("genpolicy report diff HEAD~1 reports"))
def diff(
    before: Annotated[str, typer.Argument(help="A checkout, a folder of reports or a commit.")],
    after: Annotated[str, typer.Argument(help="Likewise; `reports` for what lies here.")],
    root: Root = Path(),
    as_json: AsJson = False,
) -> int:
    """What moved between two runs, and what may be why; proves nothing.

    Per gate: its verdict, criteria that turned, limits that were loosened,
    tightened or overridden, numbers, then which code, parameters and evidence are other ones.
    Exit 0 whatever moved.
    """
    from gates.moved import moved, moved_text
    from gates.past import reports_of
    from gates.printed import print_rows

    found = moved(reports_of(before, root), reports_of(after, root))
    if as_json:
        print_rows(found)
    else:
        print(moved_text(found))
    return 0


@report.command(
    "status", epilog=examples("genpolicy report status", "genpolicy report status --json")
)
def status(root: Root = Path(), as_json: AsJson = False) -> int:
    """When the ladder ran, by whom, at which commit; is it proved?

    What no versioned page may say, since the same evidence gives the same page.
    Proves every report now, and says what moved since the run that the newest
    signed card was signed over. Exit 0 whatever it finds.
    """
    from dataclasses import asdict

    from gates.printed import print_document
    from gates.proof import prove_all
    from gates.status import status_of, status_text

    found = status_of(root, prove_all(root))
    if as_json:
        print_document(asdict(found))
    else:
        print(status_text(found))
    return 0


@report.command(
    "limits", epilog=examples("genpolicy report limits", "genpolicy report limits --json")
)
def limits(root: Root = Path(), as_json: AsJson = False) -> int:
    """Which limits moved after their evidence was there, and by whom.

    Asks git: each commit that loosened, tightened or changed what a gate judges
    by, after it could have seen what it judges; what is not committed; and who
    committed each exception of overrides.yaml. Without a history it says that
    nobody knows. Exit 0 whatever moved.
    """
    from dataclasses import asdict

    from gates.change_control import control_of, control_text
    from gates.printed import print_document

    found = control_of(root)
    if as_json:
        print_document(asdict(found))
    else:
        print(control_text(found))
    return 0


@report.command(
    "ledger", epilog=examples("genpolicy report ledger", "genpolicy report ledger --kind matched")
)
def ledger(
    kind: Annotated[
        str, typer.Option(help="matched, source_specific, abstract_only or unmatched.")
    ] = "",
    as_json: AsJson = False,
) -> int:
    """What papers say, by how far it carries here.

    Each claim with its source, its place there, and what it does not show. All of
    it is text: no number of a paper can become a limit or a rank. Every bundle
    carries it (`genpolicy package`). Exit 0.
    """
    from gates.ledger.claims import claims_of, ledger_text, read_ledger
    from gates.printed import print_document

    found = claims_of(read_ledger(), kind)
    if as_json:
        print_document([claim.model_dump(mode="json") for claim in found])
    else:
        print(ledger_text(found))
    return 0
