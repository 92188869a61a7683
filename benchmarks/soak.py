"""Random events and random chunks for hours, in parts that add up.

    python -m benchmarks.soak events --wanted 20000000 [--seed 0] [--minutes 10]
    python -m benchmarks.soak chunks --wanted 10000

`events` are those of `tests/execution/soak.py`, `chunks` those of `tests/feasibility/dense.py`. A
part is named by seed and number and depends on no other, and each is a line of `--out` when it is
done; so a run that is cut, or was given some minutes, goes on with the next part. What other code
left does not count: a line holds the hash of the code that it was of. The exit code is 1 where
anything was wrong, 3 where nothing was and parts are left.
"""

import argparse
import json
import runpy
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.statistics.intervals import clopper_pearson

ROOT = Path(__file__).parents[1]
LEFT = 3
"""Exit code where nothing was wrong and parts are left."""


@dataclass(frozen=True)
class Part:
    """What one part left.

    Attributes:
        kind: events or chunks.
        code: Hash of the code.
        seed: Whose part it is.
        number: Which of its parts.
        done: Events, or chunks, of it.
        at_risk: Of how many things something could be wrong: commands, or chunks.
        wrongs: What was wrong.
    """

    kind: str
    code: str
    seed: int
    number: int
    done: int
    at_risk: int
    wrongs: list[str] = field(default_factory=list)


Found = tuple[int, int, list[str]]
"""Done, at risk and wrongs of a part."""


def events_of(soak: Callable[..., Any], seed: int, number: int) -> Found:
    """Random events against executor, stub and supervisor."""
    found = soak(f"{seed}.{number}", 50_000)
    return found.events, found.commands, found.wrongs


def chunks_of(look: Callable[..., Any], seed: int, number: int) -> Found:
    """Random chunks that are just admitted, at every millisecond."""
    found = look([seed, number], 250)
    return found.admitted.total(), found.admitted.total(), found.wrongs


KINDS: dict[str, tuple[str, str, Callable[[Callable[..., Any], int, int], Found], str]] = {
    "events": ("tests/execution/soak.py", "soak", events_of, "commands"),
    "chunks": ("tests/feasibility/dense.py", "look", chunks_of, "chunks"),
}


def code_of(script: str) -> str:
    """Hash of the library and of the script."""
    files = [*sorted((ROOT / "genpolicy").rglob("*.py")), ROOT / script]
    named = [f"{file.relative_to(ROOT)} {sha256_bytes(file.read_bytes())}" for file in files]
    return sha256_bytes("\n".join(named).encode())


def parts_in(out: Path, like: Part) -> dict[int, Part]:
    """Parts of the same kind, code and seed that a file holds, by number."""
    lines = out.read_text().splitlines() if out.is_file() else []
    parts = [Part(**json.loads(line)) for line in lines]
    same = (like.kind, like.code, like.seed)
    return {p.number: p for p in parts if (p.kind, p.code, p.seed) == same}


def go_on(
    part_of: Callable[[int], Found],
    like: Part,
    *,
    wanted: int,
    out: Path,
    more: Callable[[], bool] = lambda: True,
) -> list[Part]:
    """Parts until so many are done, something is wrong, or `more` says that there is no time.

    Args:
        part_of: Plays the part of a number.
        like: Kind, code and seed of all of them.
        wanted: Events or chunks in all, those of earlier runs among them.
        out: Where each part goes when it is done.
        more: Asked before each part.
    """
    found = parts_in(out, like)
    number = 0
    while sum(part.done for part in found.values()) < wanted and more():
        if any(part.wrongs for part in found.values()):
            break
        while number in found:
            number += 1
        done, at_risk, wrongs = part_of(number)
        found[number] = Part(like.kind, like.code, like.seed, number, done, at_risk, wrongs)
        out.parent.mkdir(parents=True, exist_ok=True)
        with out.open("a") as lines:
            lines.write(json.dumps(asdict(found[number])) + "\n")
    return list(found.values())


def said(kind: str, parts: list[Part]) -> str:
    """What all parts left, with the exact upper bound."""
    done, at_risk = sum(p.done for p in parts), sum(p.at_risk for p in parts)
    wrongs = [f"part {p.number}: {wrong}" for p in parts for wrong in p.wrongs]
    upper = clopper_pearson(min(len(wrongs), at_risk), at_risk)[1]
    of = KINDS[kind][3]
    text = f"{done} {kind} in {len(parts)} parts, {at_risk} {of}, {len(wrongs)} wrong; "
    return "\n".join([f"{text}at most {upper:.2g} of the {of} (95 %)", *wrongs])


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("kind", choices=[*KINDS])
    parser.add_argument("--wanted", type=int, required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=float("inf"))
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "soak.jsonl")
    asked = parser.parse_args()
    script, name, part_of, _ = KINDS[asked.kind]
    play = runpy.run_path(str(ROOT / script), run_name="soaked")[name]
    end = time.monotonic() + 60 * asked.minutes
    parts = go_on(
        lambda number: part_of(play, asked.seed, number),
        Part(asked.kind, code_of(script), asked.seed, 0, 0, 0),
        wanted=asked.wanted,
        out=asked.out,
        more=lambda: time.monotonic() < end,
    )
    print(said(asked.kind, parts))
    if any(part.wrongs for part in parts):
        return 1
    return 0 if sum(part.done for part in parts) >= asked.wanted else LEFT


if __name__ == "__main__":
    sys.exit(main())
