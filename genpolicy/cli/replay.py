"""`genpolicy replay` and `export recording`: what a 3-D viewer plays."""

from pathlib import Path

from genpolicy.errors import BadInputError, ConfigError
from genpolicy.replay.recording_file import write_viewable
from genpolicy.replay.replay import layout_file, write_replay


def check_out(source: Path, out: Path, *, force: bool) -> None:
    """Refuse an output that would take the place of something.

    Args:
        source: What is read, a journal or a recording.
        out: What is to be written.
        force: Whether an old file may be replaced.

    Raises:
        BadInputError: It is the source itself.
        ConfigError: It is there already, and may not be replaced, or it is a folder.
    """
    try:
        there, same = out.exists(), out.exists() and source.exists() and out.samefile(source)
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
            found=f"{out}, the file that is read",
            expected="a new file",
            action="Name another file; what is read is evidence, and was not touched.",
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
    for file in (out, layout_file(out)):
        check_out(journal, file, force=force)
    done = write_replay(journal, out, session=session, task=task)
    print(f"replay    {out}")
    print(f"session   {done.session}")
    print(f"journal   {done.events} messages, byte for byte")
    for topic, count in done.topics.items():
        print(f"added     {topic} ({count})")
    print(f"layout    {layout_file(out)}")
    print("open both in Foxglove or Lichtblick: the file, then its layout")
    return 0


def run_export_recording(recording: Path, out: Path, *, force: bool) -> int:
    """Write a recording with schemas that viewers read, and print what it holds.

    Raises:
        BadInputError: Input or output is wrong; nothing was written.
    """
    check_out(recording, out, force=force)
    topics = write_viewable(recording, out)
    print(f"recording {out}")
    for topic, count in topics.items():
        print(f"topic     {topic} ({count})")
    return 0
