"""The rows under a gate's numbers, as small CSV files in a folder beside its page.

One file for each table or document that a criterion read; of a table with a column `method`, one
for each method. They hold the judged bytes and nothing else: columns that hold lists are left out,
a hash is its first digits, and a larger table is a sample that says so. Of a table that is sampled
a second file has what criteria count in it, of all its rows: equal ones in one line, with how many
they are. `criteria.csv` names, for each criterion, what was measured, in which of these files its
rows stand, and how they are counted again.
"""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from gates.pages.rows_files import RowsFile, lines_of, sampled, whole_or_counted
from gates.pages.rows_led_to import led_to
from gates.pages.rows_signed import signature_rows
from gates.readable import rests_on
from gates.report import Answer, GateReport, report_path
from gates.stress.rollouts import ROLLOUTS
from gates.words import number
from genpolicy.errors import GenpolicyError, IntegrityError
from genpolicy.integrity.documents import parse_json
from genpolicy.integrity.hashing import sha256_bytes, sha256_bytes_of, sha256_file
from genpolicy.integrity.tables import table_of

UNPLAIN = re.compile(r"[^A-Za-z0-9_-]")
DOCUMENT = pa.schema([("place", pa.string()), ("value", pa.string())])
KEPT_TABLES = 256
"""Every page is printed several times in a process; the same bytes are written out once. More than
the tables of all gates, or each is dropped before the next page asks for it."""
CRITERIA = "criteria.csv"
ARTIFACTS = "artifacts/"
COMPARED = (ROLLOUTS,)
"""Tables in which a candidate is held against others, so that rows of all methods count."""
MISSING = "missing, it is not built here"
ALTERED = "what lies here has other bytes than were judged"
OTHERS = "none of a candidate of this gate"
UNREADABLE = "it cannot be read"
HEAD = (
    "criterion", "candidate", "measured", "low", "high", "comparison", "limit", "verdict",
    "counted", "rows", "recount", "where", "part", "part_value", "whole", "whole_value",
)  # fmt: skip


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
        return [file for file in self.files if file.path == path and not file.folded]

    def by_method(self, path: str) -> dict[str, RowsFile]:
        """Files of one table by the method whose rows they hold."""
        return {file.method: file for file in self.of(path)}

    def under(self, answer: Answer) -> list[RowsFile]:
        """Files under one number: of a candidate its own rows, where the table tells them apart."""
        found = [file for path in answer.evidence for file in self.of(path)]
        if answer.candidate is None:
            return found
        return [file for file in found if file.method in ("", answer.candidate)]

    def rests_on(self, answer: Answer) -> str:
        """What a number rests on: the units that it counts, else the rows that it was taken from.

        A largest deviation or a question of yes or no counts no units, but was asked of so many
        rows; empty where it counts none and read no table, or none that lies here.
        """
        tables = {file.path: 0 for file in self.under(answer) if file.path.endswith(".parquet")}
        for file in self.under(answer):
            if file.path in tables:
                tables[file.path] += file.of
        if answer.counted or not tables:
            return rests_on(answer.counted)
        found = sum(tables.values())
        rows = f"{number(found)} row{'' if found == 1 else 's'}"
        return rows if len(tables) == 1 else f"{rows} of {len(tables)} tables"

    def recounted(self, answer: Answer) -> RowsFile | None:
        """The file in which a number is counted again: whole, or folded; None where it is not."""
        asked = answer.recount
        if asked is None:
            return None
        own = [
            file for file in self.files if file.path == asked.table and file.method == asked.method
        ]
        every = (file for file in own if file.folded or file.kept == file.of)
        return next(every, None)


def rows_folder(gate: str) -> str:
    """Folder of a gate's rows, relative to the repository."""
    return report_path(gate).removesuffix(".json")


def rows_of(root: Path, report: GateReport) -> Rows:
    """Files of rows under the numbers of a report, from the evidence that it names.

    What is missing below `root`, or has other bytes than were judged, has no file and says so.
    """
    asked: dict[str, set[str | None]] = {}
    counted: dict[str, dict[str, None]] = {}
    for answer in report.criteria:
        for path in answer.evidence:
            asked.setdefault(path, set()).add(answer.candidate)
        if answer.recount is not None:
            counted.setdefault(answer.recount.table, {}).update(
                dict.fromkeys(answer.recount.columns)
            )
    played = frozenset(path for path in report.materials if path.endswith(".mcap"))
    found: list[RowsFile] = []
    lacking: dict[str, str] = {}
    for path, whose in sorted(asked.items()):
        if path.startswith(ARTIFACTS) and path.endswith((".parquet", ".json")):
            # What is asked of the gate may compare all methods; of a candidate, its own is asked.
            compares = None in whose or path in COMPARED
            only = frozenset[str]() if compares else frozenset(filter(None, whose))
            wanted = _Wanted(path, report.materials.get(path, ""), played, only,
                             tuple(counted.get(path, ())), root / path)  # fmt: skip
            files = _files(wanted)
            if isinstance(files, str):
                lacking[path] = files
            else:
                found += files
    if report.gate == "E":
        signed = signature_rows(root, report)
        if signed is not None:
            found.append(signed)
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
            *_recount(rows, answer),
        )
        for answer in report.criteria
    ]
    files = {file.name: file.data for file in rows.files}
    return {CRITERIA: b"".join(lines_of(HEAD, *lines)), **files}


def _recount(rows: Rows, answer: Answer) -> tuple[str, ...]:
    """In which file, what holds of the rows, and what the part and the whole are made of."""
    asked, file = answer.recount, rows.recounted(answer)
    if asked is None or file is None:
        return ("",) * 6
    part = f"sum of {' + '.join(asked.summed)}" if asked.summed else "; ".join(asked.hits)
    whole = f"sum of {asked.of}" if asked.of else "rows"
    where = "; ".join(asked.where)
    return file.name, where, part, _exact(asked.part), whole, _exact(asked.whole)


def _exact(value: float | None) -> str:
    """A number as the report writes it."""
    return "" if value is None else json.dumps(value)


@dataclass(frozen=True)
class _Wanted:
    """What is wanted of one table or document.

    Attributes:
        path: Its path.
        judged: SHA-256 of the bytes that were judged.
        played: Journals that are evidence.
        only: Whose rows; of all methods if empty.
        counted: Columns by which criteria count its rows.
        file: Where it lies; the same bytes elsewhere have the same rows.
    """

    path: str
    judged: str
    played: frozenset[str]
    only: frozenset[str]
    counted: tuple[str, ...]
    file: Path = field(compare=False)


def _files(wanted: _Wanted) -> tuple[RowsFile, ...] | str:
    """Files of what lies there, of these methods or of all; or why there are none."""
    if not wanted.file.is_file():
        return MISSING
    try:
        if sha256_file(wanted.file) != wanted.judged:
            return ALTERED
        return _split(wanted) or OTHERS
    except GenpolicyError:
        return UNREADABLE


@lru_cache(maxsize=KEPT_TABLES)
def _split(wanted: _Wanted) -> tuple[RowsFile, ...]:
    """Files of one table or document, of the bytes that were judged.

    Raises:
        IntegrityError: It has other bytes since it was hashed, or is no whole table.
        BadInputError: Not strict JSON.
    """
    path, only = wanted.path, wanted.only
    digest, data = sha256_bytes_of(wanted.file, keep=True)
    if digest != wanted.judged:
        raise IntegrityError(
            where=path,
            found="changed while it was read",
            expected="the bytes that were judged",
            action="Print the page again when nobody writes.",
        )
    base = str(PurePosixPath(path.removeprefix(ARTIFACTS)).with_suffix("")).replace("/", ".")
    if path.endswith(".json"):
        places = [*_places(parse_json(data, where=path))]
        return (sampled(path, "", f"{base}.csv", pa.Table.from_pylist(places, schema=DOCUMENT)),)
    table = table_of(data, where=path)
    names = [field.name for field in table.schema if not pa.types.is_nested(field.type)]
    table = led_to(path, table.select(names), wanted.played)
    if "method" not in names:
        return tuple(whole_or_counted(path, "", base, table, wanted.counted))
    found: list[RowsFile] = []
    for method in sorted({str(value) for value in pc.unique(table.column("method")).to_pylist()}):
        if method in only or not only:
            own = table.filter(pc.equal(table.column("method"), method))
            found += whole_or_counted(path, method, f"{base}.{_plain(method)}", own, wanted.counted)
    return tuple(found)


def _plain(method: str) -> str:
    """A name that can stand in that of a file, and is no other method's."""
    plain = UNPLAIN.sub("_", method)
    return plain if plain == method else f"{plain}-{sha256_bytes(method.encode())[:8]}"


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
