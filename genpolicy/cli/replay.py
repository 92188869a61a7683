"""`genpolicy replay`: one session of a journal as a file for a 3-D viewer."""

from pathlib import Path

from genpolicy.errors import BadInputError, ConfigError
from genpolicy.replay.replay import write_replay


def check_out(journal: Path, out: Path, *, force: bool) -> None:
    """Refuse an output that would take the place of something.

    Raises:
        BadInputError: It is the journal itself.
        ConfigError: It is there already, and may not be replaced, or it is a folder.
    """
    try:
        there, same = out.exists(), out.exists() and journal.exists() and out.samefile(journal)
    except OSError as error:
        raise ConfigError(
            where=str(out),
            found=f"not readable ({error.strerror or error})",
            expected="a file in a folder that you may write to",
            action="Name another file.",
        ) from error
    if same:
        raise BadInputError(
            where="--out",
            found=f"{out}, the journal itself",
            expected="a new file",
            action="Name another file; a journal is evidence, and was not touched.",
        )
    if out.is_dir() or (there and not force):
        raise ConfigError(
            where=str(out),
            found="a folder" if out.is_dir() else "there already",
            expected="a new file",
            action="Name another file" + ("." if out.is_dir() else ", or give --force."),
        )


def run_replay(
    journal: Path, out: Path, *, session: str | None, task: str | None, force: bool
) -> int:
    """Write the replay, and print what it holds.

    Raises:
        BadInputError: Input or output is wrong; nothing was written.
    """
    check_out(journal, out, force=force)
    done = write_replay(journal, out, session=session, task=task)
    print(f"replay    {out}")
    print(f"session   {done.session}")
    print(f"journal   {done.events} messages, byte for byte")
    for topic, count in done.topics.items():
        print(f"added     {topic} ({count})")
    print("open it in Foxglove: a 3D panel with the frame robot_base, a Log panel on /replay/log")
    return 0
