"""The description of a LeRobot dataset, v2.0, v2.1 and v3.0: what it claims, read strictly.

Only the known placeholders of `data_path` are replaced, by a regular expression: it is never
formatted, since a format string of others can read attributes of objects.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from genpolicy.data.formats.leaves import text_of
from genpolicy.data.formats.source import Column, refuse
from genpolicy.data.formats.tables import documents, is_plain, open_table, read_columns
from genpolicy.errors import BadInputError
from genpolicy.integrity.documents import parse_json, read_json

VERSIONS = ("v2.0", "v2.1", "v3.0")
INFO = "meta/info.json"
EPISODES_V2 = "meta/episodes.jsonl"
EPISODES_V3 = "meta/episodes"
TASKS_V2 = "meta/tasks.jsonl"
TASKS_V3 = "meta/tasks.parquet"
# What the layout itself says of an episode: statistics, and where its rows and pictures lie.
OWN = ("stats/", "data/", "meta/", "videos/")
FILES = (
    *(INFO, EPISODES_V2, TASKS_V2, TASKS_V3, "meta/stats.json", "meta/episodes_stats.jsonl"),
    *("meta/modality.json", "meta/subtasks.parquet"),
)
FOLDERS = (f"{EPISODES_V3}/", "videos/", "images/")
DEFAULT_PATH = {
    "v2": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
    "v3": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
}
PLACEHOLDERS = {
    "{episode_chunk:03d}": r"(?P<chunk>\d{3,})",
    "{episode_index:06d}": r"(?P<number>\d{6,})",
    "{chunk_index:03d}": r"(?P<chunk>\d{3,})",
    "{file_index:03d}": r"(?P<number>\d{3,})",
}
MAXIMUM_LINES_BYTES = 512 << 20
NUMBERS = ("float16", "float32", "float64", "int8", "int16", "int32", "int64", "uint8", "bool")
ACTION = "Correct meta/info.json, or export the dataset again."


@dataclass(frozen=True)
class Info:
    """What `meta/info.json` claims.

    Attributes:
        version: `v2.0`, `v2.1` or `v3.0`.
        rate_hz: Frames per second.
        pattern: Of the data files, relative POSIX paths; groups `chunk` and `number`.
        features: Numeric and text features that live in the data files.
        skipped: The other features (video, images).
        episodes: Number of episodes claimed, if it is.
        frames: Number of frames claimed, if it is.
        robot: Type of the robot claimed.
    """

    version: str
    rate_hz: float
    pattern: re.Pattern[str]
    features: tuple[Column, ...]
    skipped: tuple[str, ...]
    episodes: int | None
    frames: int | None
    robot: str


def read_info(root: Path) -> Info:
    """The description, checked.

    Raises:
        BadInputError: Another version, no rate, an unknown placeholder, a path that leaves the
            dataset, or features that are not described.
    """
    where = str(root / INFO)
    info = read_json(root / INFO)
    if not isinstance(info, dict):
        refuse(where, f"a {type(info).__name__}", "a mapping", ACTION)
    version = info.get("codebase_version")
    if version not in VERSIONS:
        refuse(f"{where}: codebase_version", repr(version)[:40], f"one of {VERSIONS}", ACTION)
    rate = info.get("fps")
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0 < rate <= 100_000:
        refuse(f"{where}: fps", repr(rate)[:40], "a rate above 0 Hz", ACTION)
    template = info.get("data_path") or DEFAULT_PATH[version[:2]]
    features = info.get("features")
    if not isinstance(features, dict) or not features:
        refuse(f"{where}: features", repr(features)[:40], "a mapping of features", ACTION)
    columns = {
        name: _feature(name, value, f"{where}: features.{name}") for name, value in features.items()
    }
    return Info(
        version=version,
        rate_hz=float(rate),
        pattern=path_pattern(template, where=f"{where}: data_path"),
        features=tuple(column for column in columns.values() if column is not None),
        skipped=tuple(name for name, column in columns.items() if column is None),
        episodes=_count(info.get("total_episodes")),
        frames=_count(info.get("total_frames")),
        robot=str(info.get("robot_type") or "")[:80],
    )


def path_pattern(template: Any, *, where: str) -> re.Pattern[str]:
    """The regular expression of the files that a `data_path` template names.

    Raises:
        ContractError: Not a text, an unknown placeholder, or a path that leaves the dataset.
    """
    if not isinstance(template, str):
        refuse(where, repr(template)[:60], "a path", ACTION)
    parts = re.split(r"(\{[^{}]*\})", template)
    text = "".join(PLACEHOLDERS.get(part, re.escape(part)) for part in parts)
    unknown = [part for part in parts if part not in PLACEHOLDERS and set("{}") & set(part)]
    if unknown or text.count("(?P<number>") != 1 or text.count("(?P<chunk>") > 1:
        found = repr(template)[:80]
        refuse(where, found, f"once each of {tuple(PLACEHOLDERS)[:2]} or of v3's", ACTION)
    path = PurePosixPath(template)
    inside = not path.is_absolute() and ".." not in path.parts and "\\" not in template
    if not inside or "\x00" in template or ":" in re.sub(r"\{[^{}]*\}", "", template):
        refuse(where, repr(template)[:80], "a relative path inside the dataset", ACTION)
    return re.compile(text)


def data_files(root: Path, info: Info) -> list[tuple[int, Path]]:
    """Data files by number (episode in v2; in v3 the order of chunk and file), sorted.

    Raises:
        ContractError: A link leads out of the dataset.
    """
    found: list[tuple[int, int, Path]] = []
    for path in sorted(root.rglob("*.parquet")):
        match = info.pattern.fullmatch(path.relative_to(root).as_posix())
        if match is None:
            continue
        if not path.resolve().is_relative_to(root.resolve()):
            refuse(str(path), "a link that leads out of the dataset", "a file inside it")
        chunk = int(match.groupdict().get("chunk") or 0)
        found.append((chunk, int(match["number"]), path))
    if info.version.startswith("v2"):
        return sorted((number, path) for _, number, path in found)
    return [(place, path) for place, (_, _, path) in enumerate(sorted(found))]


def is_of_layout(name: str) -> bool:
    """Whether a file is one that the layout has beside its data, by its relative POSIX path."""
    return name in FILES or name.startswith(FOLDERS)


def read_lines(path: Path) -> Iterator[dict[str, Any]]:
    """The documents of a `.jsonl` file; none where the file is absent.

    Raises:
        BadInputError: Too large, or a line is not a mapping.
    """
    if not path.is_file():
        return
    if path.stat().st_size > MAXIMUM_LINES_BYTES:
        refuse(str(path), f"{path.stat().st_size} bytes", f"at most {MAXIMUM_LINES_BYTES}")
    with path.open("rb") as stream:
        for number, line in enumerate(stream):
            if not line.strip():
                continue
            document = parse_json(line, where=f"{path}, line {number + 1}")
            if not isinstance(document, dict):
                refuse(f"{path}, line {number + 1}", "no mapping", "one mapping per line")
            yield document


def read_tasks(root: Path, info: Info) -> dict[int, str]:
    """Text of each task by its number; empty where they are not described."""
    if info.version.startswith("v2"):
        documents = read_lines(root / TASKS_V2)
        return {int(d["task_index"]): str(d["task"]) for d in documents if _is_task(d)}
    path = root / TASKS_V3
    if not path.is_file():
        return {}
    with open_table(path, label=TASKS_V3) as table:
        texts = [name for name, column in table.columns.items() if column.kind == "text"]
        if "task_index" not in table.columns or not texts:
            return {}
        values = read_columns(table, ["task_index", texts[-1]])
    pairs = zip(values["task_index"].tolist(), values[texts[-1]].tolist(), strict=True)
    return {int(index): str(text) for index, text in pairs}


def read_episodes(root: Path, info: Info) -> tuple[dict[int, dict[str, str]], list[str]]:
    """What the metadata say of each episode, by name, as texts that `leaves` takes apart; notes.

    An unreadable list is a note: the data decide, not their description.
    """
    result: dict[int, dict[str, str]] = {}
    strange: set[str] = set()
    notes: list[str] = []
    try:
        for document in _episode_documents(root, info, strange):
            number = document.get("episode_index")
            if isinstance(number, int) and not isinstance(number, bool):
                said = {key: text_of(value) for key, value in document.items()}
                result[number] = {key: text for key, text in said.items() if text is not None}
    except BadInputError as error:
        notes.append(f"The list of episodes could not be read: {error}")
    if strange:
        names = ", ".join(sorted(strange))
        notes.append(f"Not read from the list of episodes: {names} (no plain values).")
    return result, notes


def _episode_documents(root: Path, info: Info, strange: set[str]) -> Iterator[dict[str, Any]]:
    """What is said of each episode, without what the layout itself writes there."""
    if info.version.startswith("v2"):
        for document in read_lines(root / EPISODES_V2):
            yield {name: value for name, value in document.items() if not _is_own(name)}
        return
    for path in sorted((root / EPISODES_V3).rglob("*.parquet")):
        label = path.relative_to(root).as_posix()
        with open_table(path, label=label) as table:
            # Statistics and offsets stand in hundreds of columns.
            names = [name for name in table.file.schema_arrow.names if not _is_own(name)]
            plain = [name for name in names if is_plain(table.file.schema_arrow.field(name).type)]
            strange |= set(names) - set(plain)
            yield from documents(table, plain)


def _is_own(name: str) -> bool:
    return name.startswith(OWN)


def _is_task(document: dict[str, Any]) -> bool:
    return isinstance(document.get("task_index"), int) and "task" in document


def _count(value: Any) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def _feature(name: str, value: Any, where: str) -> Column | None:
    """A feature as a column; None for pictures and whatever has more than one axis."""
    if not isinstance(value, dict) or not isinstance(value.get("dtype"), str):
        refuse(where, repr(value)[:60], "a mapping with a dtype", ACTION)
    kind, shape = value["dtype"], value.get("shape")
    if kind == "string":
        return Column(name, None, "text")
    if kind not in NUMBERS:
        return None
    sized = isinstance(shape, list) and all(isinstance(n, int) and n > 0 for n in shape)
    if not sized or shape is None:
        refuse(f"{where}.shape", repr(shape)[:60], "a list of sizes", ACTION)
    if len(shape) > 1:
        return None
    return Column(name, shape[0] if shape else None, components=flat_names(value.get("names")))


def flat_names(names: Any) -> tuple[str, ...]:
    """Names of the numbers of a feature, however deep they are nested; empty if not given.

    Seen: `["x", "y"]`, `[["x", "y"]]`, `{"motors": ["x", "y"]}`, `{"x": 0, "y": 1}`, null.
    """
    if isinstance(names, str):
        return (names,)
    if isinstance(names, list):
        return tuple(name for part in names for name in flat_names(part))
    if isinstance(names, dict):
        if names and all(isinstance(v, int) and not isinstance(v, bool) for v in names.values()):
            return tuple(sorted(names, key=lambda key: int(names[key])))
        return tuple(name for part in names.values() for name in flat_names(part))
    return ()
