"""The rows under a gate's numbers, as small CSV files in a folder beside its page.

One file for each table or document that a criterion read; of a table with a column `method`, one
for each method. They hold the judged bytes and nothing else: columns that hold lists are left out,
a hash is its first digits, and a larger table is a sample that says so. `criteria.csv` names, for
each criterion, what was measured and in which of these files its rows stand.
"""

import csv
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path, PurePosixPath
from types import SimpleNamespace
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from gates.report import Answer, GateReport, report_path
from gates.stress.rollouts import ROLLOUTS, STRESS
from genpolicy.errors import GenpolicyError
from genpolicy.integrity.documents import parse_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_bytes_of, sha256_file
from genpolicy.integrity.tables import table_of

LARGEST_BYTES = 100_000
"""Of one file: 300 rollouts with all their columns are half of it, and git keeps every version."""
HASH = re.compile(r"[0-9a-f]{64}")
SHOWN_HASH = 12
UNPLAIN = re.compile(r"[^A-Za-z0-9_-]")
DOCUMENT = pa.schema([("place", pa.string()), ("value", pa.string())])
KEPT_TABLES = 48
"""Every page is printed several times in a process; the same bytes are written out once."""
CRITERIA = "criteria.csv"
ARTIFACTS = "artifacts/"
COMPARED = (ROLLOUTS,)
"""Tables in which a candidate is held against others, so that rows of all methods count."""
ROLLOUT = ("method", "perturbation", "start")
"""What names a rollout, in the order of its name."""
MISSING = "missing, it is not built here"
ALTERED = "what lies here has other bytes than were judged"
OTHERS = "none of a candidate of this gate"
UNREADABLE = "it cannot be read"
FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""How a text begins that a spreadsheet would run."""
HEAD = (
    "criterion", "candidate", "measured", "low", "high", "comparison", "limit", "verdict",
    "counted", "rows",
)  # fmt: skip


@dataclass(frozen=True)
class RowsFile:
    """Rows of one table or document, or of one method in it.

    Attributes:
        path: Of the evidence.
        method: Whose rows they are; empty where the table does not tell methods apart.
        name: Of the file in its folder.
        kept: Rows that it holds.
        of: Rows that there are.
        data: Its bytes.
    """

    path: str
    method: str
    name: str
    kept: int
    of: int
    data: bytes = field(repr=False)

    @property
    def said(self) -> str:
        """How many rows it holds, and of how many where it holds not all."""
        if self.kept == self.of:
            return f"{self.of:,} row{'' if self.of == 1 else 's'}"
        return f"a sample of {self.kept:,} of {self.of:,} rows"

    @property
    def title(self) -> str:
        """Its evidence without folder and ending, for a link."""
        stem = PurePosixPath(self.path).stem.replace("_", " ")
        return f"{stem} of {self.method}" if self.method else stem


@dataclass(frozen=True)
class Rows:
    """All files of rows of one gate.

    Attributes:
        folder: Name of their folder, which lies beside the page.
        files: By path of the evidence, then by method.
        lacking: Why a table or document that a criterion read has none, by its path.
    """

    folder: str
    files: tuple[RowsFile, ...]
    lacking: Mapping[str, str] = field(default_factory=dict)

    def of(self, path: str) -> list[RowsFile]:
        """Files of one table or document; none where it is not evidence that lies here."""
        return [file for file in self.files if file.path == path]

    def by_method(self, path: str) -> dict[str, RowsFile]:
        """Files of one table by the method whose rows they hold."""
        return {file.method: file for file in self.of(path)}

    def under(self, answer: Answer) -> list[RowsFile]:
        """Files under one number: of a candidate its own rows, where the table tells them apart."""
        found = [file for path in answer.evidence for file in self.of(path)]
        if answer.candidate is None:
            return found
        return [file for file in found if file.method in ("", answer.candidate)]


def rows_folder(gate: str) -> str:
    """Folder of a gate's rows, relative to the repository."""
    return report_path(gate).removesuffix(".json")


def rows_of(root: Path, report: GateReport) -> Rows:
    """Files of rows under the numbers of a report, from the evidence that it names.

    What is missing below `root`, or has other bytes than were judged, has no file and says so.
    """
    asked: dict[str, set[str | None]] = {}
    for answer in report.criteria:
        for path in answer.evidence:
            asked.setdefault(path, set()).add(answer.candidate)
    played = frozenset(path for path in report.materials if path.endswith(".mcap"))
    found: list[RowsFile] = []
    lacking: dict[str, str] = {}
    for path, whose in sorted(asked.items()):
        if path.startswith(ARTIFACTS) and path.endswith((".parquet", ".json")):
            # What is asked of the gate may compare all methods; of a candidate, its own is asked.
            compares = None in whose or path in COMPARED
            only = frozenset[str]() if compares else frozenset(filter(None, whose))
            files = _files(root / path, path, report.materials.get(path, ""), played, only)
            if isinstance(files, str):
                lacking[path] = files
            else:
                found += files
    return Rows(PurePosixPath(rows_folder(report.gate)).name, tuple(found), lacking)


def printed_rows(rows: Rows, report: GateReport) -> dict[str, bytes]:
    """Every file of the folder by its name, that of the criteria among them."""
    lines = [
        (
            answer.id,
            answer.candidate,
            *(_exact(value) for value in (answer.measured, *(answer.interval or (None, None)))),
            answer.comparison,
            _exact(answer.threshold),
            str(answer.verdict),
            answer.counted,
            " ".join(file.name for file in rows.under(answer)),
        )
        for answer in report.criteria
    ]
    files = {file.name: file.data for file in rows.files}
    return {CRITERIA: b"".join(_lines(HEAD, *lines)), **files}


def _exact(value: float | None) -> str:
    """A number as the report writes it."""
    return "" if value is None else json.dumps(value)


def _files(
    file: Path, path: str, judged: str, played: frozenset[str], only: frozenset[str]
) -> tuple[RowsFile, ...] | str:
    """Files of what lies there, of these methods or of all; or why there are none."""
    if not file.is_file():
        return MISSING
    try:
        if sha256_file(file) != judged:
            return ALTERED
        return _split(file, path, judged, played, only) or OTHERS
    except GenpolicyError:
        return UNREADABLE


@lru_cache(maxsize=KEPT_TABLES)
def _split(
    file: Path, path: str, judged: str, played: frozenset[str], only: frozenset[str]
) -> tuple[RowsFile, ...]:
    """Files of one table or document, of the bytes that were judged."""
    digest, data = sha256_bytes_of(file, keep=True)
    if digest != judged:
        return ()
    base = str(PurePosixPath(path.removeprefix(ARTIFACTS)).with_suffix("")).replace("/", ".")
    if path.endswith(".json"):
        places = [*_places(parse_json(data, where=path))]
        return (_sampled(path, "", f"{base}.csv", pa.Table.from_pylist(places, schema=DOCUMENT)),)
    table = table_of(data, where=path)
    names = [field.name for field in table.schema if not pa.types.is_nested(field.type)]
    table = table.select(names)
    if path.startswith(f"{STRESS}/") and set(ROLLOUT) <= set(names):
        table = table.append_column("rollout", [_rollouts(table, played)])
    if "method" not in names:
        return (_sampled(path, "", f"{base}.csv", table),)
    found = []
    for method in sorted({str(value) for value in pc.unique(table.column("method")).to_pylist()}):
        if method in only or not only:
            own = table.filter(pc.equal(table.column("method"), method))
            found.append(_sampled(path, method, f"{base}.{_plain(method)}.csv", own))
    return tuple(found)


def _plain(method: str) -> str:
    """A name that can stand in that of a file, and is no other method's."""
    plain = UNPLAIN.sub("_", method)
    return plain if plain == method else f"{plain}-{sha256_bytes(method.encode())[:8]}"


def _rollouts(table: pa.Table, played: frozenset[str]) -> pa.Array:
    """Name of each row's rollout, where its journal is evidence; empty elsewhere."""
    names = [
        f"{method}/{condition}/{start}"
        if f"{STRESS}/journals/{method}__{condition}.mcap" in played
        else ""
        for method, condition, start in zip(
            *(table.column(name).to_pylist() for name in ROLLOUT), strict=True
        )
    ]
    return pa.array(names, pa.string())


def _places(value: Any, place: str = "") -> Iterator[dict[str, str]]:
    """Every value of a document with its place: `rules[2].name`."""
    if isinstance(value, dict) and value:
        for key, item in value.items():
            yield from _places(item, f"{place}.{key}" if place else str(key))
    elif isinstance(value, list) and value:
        for number, item in enumerate(value):
            yield from _places(item, f"{place}[{number}]")
    else:
        text = value if isinstance(value, str) else json.dumps(value)
        yield {"place": place, "value": text}


def _sampled(path: str, method: str, name: str, table: pa.Table) -> RowsFile:
    """All rows with their numbers in the table, or as many as the bound allows.

    Which ones is drawn by their numbers, so that no condition or candidate is favoured by the
    order of the table, and the same rows are drawn again.
    """
    numbers: list[int] = list(range(table.num_rows))
    most = LARGEST_BYTES // (2 * table.num_columns)  # a cell and its comma are two bytes or more
    if len(numbers) > most:
        numbers = sorted(numbers, key=_drawn)[:most]
    taken = table.take(pa.array(numbers, pa.int64()))
    cells = [[_cell(value) for value in column.to_pylist()] for column in taken.columns]
    counted = [number + 1 for number in numbers]
    head, *lines = _lines(["row", *table.column_names], *zip(counted, *cells, strict=True))
    kept = dict(zip(numbers, lines, strict=True))
    if sum(map(len, lines)) > LARGEST_BYTES - len(head):
        kept = _within(kept, LARGEST_BYTES - len(head))
    data = head + b"".join(kept[number] for number in sorted(kept))
    return RowsFile(path, method, name, len(kept), table.num_rows, data)


def _drawn(number: int) -> bytes:
    """Place of a row in the draw."""
    return sha256_bytes(str(number).encode()).encode()


def _within(lines: Mapping[int, bytes], most: int) -> dict[int, bytes]:
    """As many lines as fit, in the order in which they are drawn."""
    found: dict[int, bytes] = {}
    for number in sorted(lines, key=_drawn):
        most -= len(lines[number])
        if most < 0:
            break
        found[number] = lines[number]
    return found


def _cell(value: Any) -> str:
    """A cell: nine digits of a number, the first ones of a hash, a text that no program runs."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.9g}"
    text = str(value)
    if HASH.fullmatch(text):
        return text[:SHOWN_HASH]
    return f"'{text}" if isinstance(value, str) and text.startswith(FORMULA) else text


def _lines(*rows: Sequence[Any]) -> list[bytes]:
    """Each row as its line of a CSV file."""
    texts: list[str] = []
    csv.writer(SimpleNamespace(write=texts.append), lineterminator="\n").writerows(rows)
    return [text.encode() for text in texts]
