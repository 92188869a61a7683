"""The shell of every command: one help, one line per error, one meaning per exit code.

0 done, 1 a fault of ours, 2 bad configuration, bad input or bad usage, 3 refused by a gate,
130 interrupted.

Commands of the packages above this one are found by the entry-point group `genpolicy.commands`
(name = "package.module:object", a function or a `typer.Typer`), so that imports run one way.
A module that is named there stays light: what a command needs, it imports when it runs.
"""

import sys
import traceback
from collections.abc import Callable, Sequence
from importlib.metadata import EntryPoint, entry_points
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from genpolicy.cli.encoding import escape_what_it_lacks
from genpolicy.errors import BadInputError, GenpolicyError

GROUP = "genpolicy.commands"
FAULT, BAD_USAGE, INTERRUPTED = 1, 2, 130
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]


def new_app(description: str, *, cls: type[TyperGroup] | None = None) -> typer.Typer:
    """A group of commands in the house style: plain help, no completion, our own errors."""
    return typer.Typer(
        cls=cls,
        help=description,
        add_completion=False,
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
    )


def examples(*lines: str) -> str:
    """The epilogue of a help text, kept line by line."""
    return "\n".join(["\b", "Examples:", *(f"  {line}" for line in lines)])


class Registered(TyperGroup):
    """A group that also holds the commands of other packages; each is imported when asked for."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self._points = {point.name: point for point in entry_points(group=GROUP)}
        for name in sorted(set(self._points) - set(self.commands)):
            self.add_command(TyperCommand(name, rich_markup_mode=None), name)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command of this name, loaded; None if there is none."""
        if cmd_name not in self._points:
            return super().get_command(ctx, cmd_name)
        try:
            return loaded(self._points[cmd_name])
        except BadInputError as error:  # the help still lists the others
            return _broken(cmd_name, error)


def loaded(point: EntryPoint) -> Any:
    """The command that an entry point names.

    Raises:
        BadInputError: The package that registered it cannot be imported, or names no command.
    """
    try:
        target = point.load()
    except (ImportError, AttributeError) as error:
        raise BadInputError(
            where=f"command {point.name}",
            found=f"{point.value}, which cannot be loaded ({error})",
            expected="a function or a typer.Typer",
            action="Install again the package that registers it.",
        ) from error
    return as_command(target, point.name)


def as_command(target: typer.Typer | Callable[..., Any], name: str) -> Any:
    """A command of a function, or of a group of them; examples come from `target.examples`."""
    if isinstance(target, typer.Typer):
        command: Any = get_command(target)
    else:
        app = new_app("")
        app.command(name, epilog=getattr(target, "examples", None))(target)
        command = get_command(app)
    command.name = name
    return command


def with_examples(*lines: str) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Decorate a command with the examples that stand below its help."""

    def decorate(command: Callable[..., int]) -> Callable[..., int]:
        command.examples = examples(*lines)  # type: ignore[attr-defined]
        return command

    return decorate


def run_program(
    target: typer.Typer | Callable[..., Any] | str,
    program: str,
    arguments: Sequence[str] | None = None,
) -> int:
    """Run a command with all that can end it, as one line on standard error and an exit code.

    Args:
        target: The command, or "package.module:object" as an entry point names it.
        program: What the user has typed to get here, for usage and errors.
        arguments: Words after it; those of the process if absent.

    Returns:
        The exit code.
    """
    escape_what_it_lacks((sys.stdout, sys.stderr))
    words = list(sys.argv[1:] if arguments is None else arguments)
    place = program
    try:
        if isinstance(target, str):
            command = loaded(EntryPoint(program, target, GROUP))
        else:
            command = as_command(target, program)
        if isinstance(command, TyperGroup) and words and not words[0].startswith("-"):
            place = f"{program} {words[0]}"
        code = int(command.main(args=words, prog_name=program, standalone_mode=False) or 0)
    except GenpolicyError as error:
        return _failed(place, str(error), error.exit_code)
    except PermissionError as error:  # the machine's answer about a place that the user named
        said = (
            f"{error.filename or 'a file'} is not accessible ({error.strerror or error}), expected "
            "a place that you may read and write. Check its permissions."
        )
        return _failed(place, said, BAD_USAGE)
    except typer.TyperException as error:
        return _bad_usage(place, error)
    except typer.Abort:
        code = INTERRUPTED
    except Exception:
        traceback.print_exc()
        said = "this is a fault of genpolicy, not of your input. Report the lines above."
        return _failed(place, said, FAULT)
    if code == INTERRUPTED:
        _failed(place, "interrupted; nothing was written", INTERRUPTED)
    return code


def _broken(name: str, error: BadInputError) -> TyperCommand:
    def refuse() -> None:
        raise error

    return TyperCommand(
        name,
        callback=refuse,
        help="(cannot be loaded)",
        rich_markup_mode=None,
        context_settings={"ignore_unknown_options": True, "allow_extra_args": True},
    )


def _bad_usage(place: str, error: typer.TyperException) -> int:
    said = error.format_message()
    if said.startswith("Usage:"):  # nothing was asked for: the help is the answer
        print(said, file=sys.stderr)
        return BAD_USAGE
    context = getattr(error, "ctx", None)
    place = place if context is None else context.command_path
    return _failed(place, f"{' '.join(said.split())} See `{place} --help`.", BAD_USAGE)


def _failed(place: str, sentence: str, code: int) -> int:
    print(f"{place}: {sentence}", file=sys.stderr)
    return code
