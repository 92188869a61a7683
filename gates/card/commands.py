"""`genpolicy card`: from a key and the draft to a card that can be signed."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gates.commands import Root, require_beneath, verify_card
from genpolicy.cli.shell import examples, new_app

if TYPE_CHECKING:
    from gates.card.filling import Rules

SIGN = "card sign --card completed.json --key my_key.pem --reviewer my-id"
card = new_app("Make a key, fill a card, sign it, verify it.")


@card.command(epilog=examples(f"genpolicy {SIGN}"))
def sign(
    card: Annotated[Path, typer.Option(help="Completed card, or an envelope to sign as well.")],
    key: Annotated[Path, typer.Option(help="Your private key, PEM, Ed25519.")],
    reviewer: Annotated[str, typer.Option(help="Your id on reviewers.yaml.")],
    root: Root = Path(),
) -> int:
    """Add your signature to a trial card.

    Before, gates A to D are proved again, the plan must have been committed
    before the evidence, nobody but the authors may have committed to the
    candidate, evidence must be what its journals say (minutes), pages what reports
    say. With the last signature that is needed, a run of gate E that waits goes on.
    """
    from gates.card import signing
    from gates.card.resuming import go_on
    from gates.overriders import require_in_force
    from gates.proof import prove_chain

    require_in_force(root, prove_chain(root, "D")[0])
    require_beneath(root)
    path = signing.sign_card(root, card_file=card, key_file=key, reviewer=reviewer)
    print(f"Signed {path.name} as {reviewer}. Judge gate E again to see what is missing.")
    go_on(root)
    return 0


card.command("verify", epilog=examples("genpolicy card verify --today 2027-01-31"))(verify_card)


@card.command(epilog=examples("genpolicy card keygen --id my-id --out ~/keys/my_key.pem"))
def keygen(
    identifier: Annotated[str, typer.Option("--id", help="Your id, as the allow-list names it.")],
    out: Annotated[Path, typer.Option(help="File for your private key, outside the workspace.")],
    root: Root = Path(),
) -> int:
    """Make your key, and print your entry for reviewers.yaml.

    The private key is readable by you alone and is never replaced. Whoever
    reviews the change of reviewers.yaml must know that the key is yours.
    """
    from pydantic import TypeAdapter, ValidationError

    from gates.card.key_files import make_key
    from gates.card.people import ALLOW_LIST, ROLES, PersonId
    from genpolicy.errors import ConfigError

    try:
        TypeAdapter(PersonId).validate_python(identifier)
    except ValidationError as error:
        raise ConfigError(
            where="--id",
            found=repr(identifier),
            expected="lower-case letters, digits, dots and dashes",
            action="Choose an id of that form.",
        ) from error
    public = make_key(out.expanduser(), root=root)
    print(f"Wrote your private key to {out}. Keep it; nobody else may read it.")
    print(
        f"Your entry for {ALLOW_LIST}; you can sign once it is complete and committed, in review:"
    )
    roles = f"{', '.join(ROLES[:-1])} or {ROLES[-1]}"
    print(
        f"- id: {identifier}\n  name: \n  role:   # {roles}\n  public_key: {public}\n  emails: []"
    )
    return 0


@card.command(
    epilog=examples(
        "genpolicy card fill --out completed.json",
        "genpolicy card fill --out completed.json --set spotter=sam",
    )
)
def fill(
    out: Annotated[Path, typer.Option(help="Completed card to write.")],
    given: Annotated[
        list[str] | None, typer.Option("--set", help="An answer, name=value; not asked again.")
    ] = None,
    root: Root = Path(),
) -> int:
    """Fill the drafted card, question by question.

    Nothing is answered for you but what the draft proposes; a wrong answer is
    told at once. Without a terminal every answer must be given by --set.
    """
    from gates.card.card import card_bytes
    from gates.card.filling import filled, require_fillable, rules_of
    from gates.exceptions import utc_today
    from genpolicy.errors import ConfigError
    from genpolicy.integrity.atomic import write_bytes

    if out.exists():
        raise ConfigError(
            where="--out",
            found=f"{out}, which is there already",
            expected="a new file",
            action="Name another file, or remove the old card.",
        )
    rules = rules_of(root, utc_today())
    require_fillable(rules)
    answers = dict(_pair(text) for text in given or [])
    if sys.stdin.isatty():
        answers = _asked(rules, answers)
    completed = filled(rules, answers)
    write_bytes(out, card_bytes(completed))
    print(f"Wrote {out}, with {len(completed.caveats)} caveats that a signer signs in spite of:")
    for caveat in completed.caveats:
        print(f"- {caveat}")
    print("Read them. Then the reviewer and the four owners each sign this very file:")
    print(f"genpolicy card sign --card {out} --key KEY --reviewer ID")
    return 0


def _asked(rules: "Rules", answers: dict[str, str]) -> dict[str, str]:
    """Answers of the person at the terminal, each asked until it holds."""
    from gates.card.filling import answer, questions
    from genpolicy.errors import ConfigError

    values: dict[str, object] = {}
    for question in questions(rules):
        name = question.name
        while True:
            said = answers.get(name)
            if said is None:
                said = typer.prompt(f"{name}: {question.text}", default=question.proposed)
            try:
                values[name] = answer(rules, name, str(said), values)
            except ConfigError as error:
                print(error, file=sys.stderr)
                answers.pop(name, None)
                continue
            answers[name] = str(said)
            break
    return answers


def _pair(text: str) -> tuple[str, str]:
    from genpolicy.errors import ConfigError

    name, sign_, value = text.partition("=")
    if not sign_:
        raise ConfigError(
            where="--set", found=repr(text), expected="name=value", action="Write it so."
        )
    return name, value
