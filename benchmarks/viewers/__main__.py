"""What public viewers make of an exported rollout: every channel read, the picture drawn.

`python -m benchmarks.viewers watch.mcap --modules node_modules --out pictures` opens a file that
`genpolicy export rollout … --to foxglove` wrote, with the layout beside it, in Foxglove's viewer,
and then the same file with one schema broken: a viewer that told nothing of that would tell nothing
of ours. `--rerun COMMAND` lets Rerun's own loader read the file and each further `--journal`.
`docs/viewers.md` says what to install first; nothing is downloaded here.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from mcap.reader import make_reader

from benchmarks.viewers.broken import with_a_broken_schema
from benchmarks.viewers.foxglove import Seen, seen

NO_PROBLEM = "No problems found"


def topics_of(file: Path) -> dict[str, int]:
    """Messages of each channel of a file, by the public reader of the format."""
    with file.open("rb") as stream:
        summary = make_reader(stream, validate_crcs=True).get_summary()
    if summary is None or summary.statistics is None:
        raise ValueError(f"{file} has no summary")
    counts = summary.statistics.channel_message_counts
    return {channel.topic: counts.get(n, 0) for n, channel in summary.channels.items()}


def faults(file: Path, shown: Seen) -> list[str]:
    """What the viewer lacks or complains of; of a good file nothing."""
    found = [] if NO_PROBLEM in shown.problems else ["it lists problems"]
    words = set(shown.text.split())
    lacking = [topic for topic, count in topics_of(file).items() if count and topic not in words]
    found += [f"not listed: {', '.join(lacking)}"] if lacking else []
    return found + [said for said in shown.said if not said.startswith("warn:")]


def read_by_rerun(command: str, file: Path) -> int:
    """Let Rerun convert a file and verify what it made of it; its exit code."""
    with tempfile.TemporaryDirectory() as name:
        made = Path(name, "made.rrd")
        for words in (
            ["mcap", "convert", str(file), "-o", str(made)],
            ["rrd", "verify", str(made)],
        ):
            done = subprocess.run([command, *words], capture_output=True, check=False)
            if done.returncode:
                return done.returncode
    return 0


def main() -> int:
    """Open, compare, print; 0 where the viewers read all and tell the broken file."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.viewers", description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--modules", type=Path, help="folder node_modules with the viewer")
    parser.add_argument("--rerun", default="", help="Rerun's command")
    parser.add_argument("--journal", type=Path, action="append", default=[])
    parser.add_argument("--at", type=float, action="append", help="moment of a picture, s")
    parser.add_argument("--out", type=Path, default=Path())
    asked = parser.parse_args()
    wrong = 0
    print(f"{asked.file.name}: {len(topics_of(asked.file))} channels")
    if asked.modules is not None:
        asked.out.mkdir(parents=True, exist_ok=True)
        layout = asked.file.with_suffix(".layout.json")
        moments = asked.at or [2.0]
        shown = seen(asked.modules, asked.file, layout, at_s=moments, pictures=asked.out)
        told = faults(asked.file, shown)
        print("foxglove  " + ("; ".join(told) or "every channel with messages listed, no problem"))
        with tempfile.TemporaryDirectory() as name:
            broken = Path(name, "broken.mcap")
            topic = with_a_broken_schema(asked.file, broken)
            shown = seen(asked.modules, broken, layout, at_s=moments[:1], pictures=Path(name))
            noticed = NO_PROBLEM not in shown.problems
        print(f"foxglove  {topic} with a schema of two types: {'told' if noticed else 'NOT TOLD'}")
        wrong += bool(told) + (not noticed)
    for file in [asked.file, *asked.journal] if asked.rerun else []:
        code = read_by_rerun(asked.rerun, file)
        print(f"rerun     {file.name}: {'read and verified' if code == 0 else f'exit {code}'}")
        wrong += code != 0
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
