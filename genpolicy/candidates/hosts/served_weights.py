"""Weights that a server's command names by their folder: `files` must name them, or nobody knows.

An entry that pins one training and whose command serves another one says a hash that is not of
what answers, and each later start serves whatever lies there by then.
"""

from pathlib import Path

from genpolicy.candidates.wire.entry import ServerEntry
from genpolicy.errors import ConfigError

WEIGHTS = (".safetensors", ".onnx", ".pt2", ".pt", ".pth", ".ckpt")


def require_served_weights(entry: ServerEntry, folder: Path) -> None:
    """Refuse a server that pins files, and not the weights in a folder that its command names.

    Looked at are words that are a folder below that of the entry, also behind `--x=`, and what lies
    in it by the endings of `WEIGHTS`. An entry that pins nothing fails Gate B by name.

    Args:
        entry: What it is.
        folder: Of the entry's file.

    Raises:
        ConfigError: It pins others.
    """
    if not entry.files:
        return
    for word in entry.command or ():
        named = Path(word.partition("=")[2] if word.startswith("-") else word)
        if named.is_absolute() or ".." in named.parts or not named.parts:
            continue
        for path in sorted((folder / named).glob("*")):
            name = (named / path.name).as_posix()
            if path.suffix in WEIGHTS and name not in entry.files:
                raise ConfigError(
                    where=f"files of the candidate {entry.name}",
                    found=f"without {name}, weights in a folder that its command names",
                    expected="the SHA-256 of the weights that it serves",
                    action=f"Write `{name}: <sha256>` into `files`, or name another folder.",
                )
