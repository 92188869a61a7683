"""`dvc`, which writes into its lock file the stage that ran and leaves the others as they stand.

Behind each stage DVC reads all of `dvc.lock` and writes it again, in pure Python, which takes most
of what a stage costs beside its work. Here DVC's own writer writes the one stage, and what it wrote
takes the place of what stood there: the file is the same to the byte. A program by its path
(`reproduce` starts it); plain `dvc repro` does the same, slower.
"""

import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dvc import dvcfile
from dvc.cli import main
from dvc.utils.serialize import dumps_yaml

HEAD = "schema: '2.0'\nstages:\n"
STAGE = re.compile(r"^  \S", re.MULTILINE)
"""The first line of a stage; what is said of one stands deeper."""
ANCHOR = re.compile(r"(?<=[:-] [&*]id)\d{3,}$", re.MULTILINE)
"""Number of a value that a stage says twice; DVC counts them through the whole file."""
_whole = dvcfile.Lockfile.dump_stages


def dump_stages(lock: dvcfile.Lockfile, stages: Sequence[Any], **options: Any) -> None:
    """In the place of `Lockfile.dump_stages`, which it calls for a file of another form."""
    path = Path(lock.path)
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    rest = text.removeprefix(HEAD)
    if rest == text or not rest.startswith("  ") or re.search(r"^\S", rest, re.MULTILINE):
        _whole(lock, stages, **options)
        return
    for stage in stages:
        said = dumps_yaml({"stages": dvcfile.serialize.to_lockfile(stage, **options)})
        rest = spliced(rest, said.removeprefix("stages:\n"))
    if HEAD + rest != text:
        dvcfile.logger.info("Updating lock file '%s'", lock.relpath)
        new = path.with_name(f".{path.name}.tmp")
        new.write_text(HEAD + rest, encoding="utf-8")
        os.replace(new, path)
        lock.repo.scm_context.track_file(lock.relpath)


def spliced(stages: str, stage: str) -> str:
    """The stages of a lock file with this one in its place, or behind all others."""
    begins = [found.start() for found in STAGE.finditer(stages)]
    ends = [*begins[1:], len(stages)]
    told = [stages[begin:end] for begin, end in zip(begins, ends, strict=True)]
    names = [one[: one.index("\n")] for one in told]
    name = stage[: stage.index("\n")]
    if name in names:
        told[names.index(name)] = stage
    else:
        told.append(stage)
    return _counted_through(told)


def _counted_through(told: Sequence[str]) -> str:
    """Stages in one text, with their anchors numbered as if written in one go."""
    texts, before = [], 0
    for text in told:
        own = sorted({int(number) for number in ANCHOR.findall(text)})
        numbers = {number: before + place for place, number in enumerate(own, start=1)}

        def counted(found: re.Match[str], to: dict[int, int] = numbers) -> str:
            return f"{to[int(found[0])]:03d}"

        texts.append(ANCHOR.sub(counted, text))
        before += len(own)
    return "".join(texts)


if __name__ == "__main__":
    dvcfile.Lockfile.dump_stages = dump_stages
    sys.exit(main())
