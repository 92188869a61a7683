"""A `.pt2` archive without what could run code: no pickle is opened, and none is written.

`torch.export.load` of torch 2.13 unpickles sample inputs, every weight or constant that says
`use_pickle`, custom objects and older archives; it evaluates symbolic sizes and guards as Python,
takes operators from anywhere below `torch`, and imports modules that a structure of arguments
names. So an archive is never given to it as it came. A copy is made of numbers and of a graph
whose every word was looked at; sample inputs are left out, for nobody needs them.
"""

import io
import json
import re
import zipfile
from typing import Any, NoReturn

from genpolicy.errors import BadInputError, IntegrityError
from genpolicy.integrity.documents import parse_json

GRAPH = "models/model.json"
SAMPLES = "data/sample_inputs/model.pt"
PAYLOADS = {
    "data/weights/": ("model_weights_config.json", re.compile(r"weight_\d+")),
    "data/constants/": ("model_constants_config.json", re.compile(r"tensor_\d+")),
}
FORMAT = {
    "archive_format": b"pt2",
    "archive_version": b"0",
    "byteorder": b"little",
    ".data/version": b"6\n",
}
MAXIMUM_BYTES = 1 << 30
OPERATOR = re.compile(r"torch\.ops\.aten\.\w+\.\w+|_operator\.getitem")
READS_FILES = ("torch.ops.aten.from_file",)
WORD = re.compile(r"[A-Za-z0-9_.:-]*")
"""A name, an operator, a type, `-Infinity`: nothing that calls when it is evaluated."""
FREE_TEXT = {"as_string", "torch_version"}
"""Texts that stay texts: an argument of an operator, and who wrote the archive."""
STRUCTURES = {"in_spec", "out_spec"}
STRUCTURE_TYPES = {"builtins.tuple", "builtins.list", "builtins.dict", None}
WRITTEN_AT = (1980, 1, 1, 0, 0, 0)


def without_code(data: bytes, *, where: str) -> bytes:
    """A copy of an archive that `torch.export.load` can open without running anything.

    Args:
        data: Bytes of the archive.
        where: Its path, for the error text.

    Raises:
        IntegrityError: No archive of an exported program, one that holds a weight, constant or
            object that would be unpickled, or a graph that says more than a graph.
    """
    members = _members(data, where)
    graph = _graph(_member(members, GRAPH, where), where)
    kept = {**FORMAT, GRAPH: json.dumps(graph, sort_keys=True).encode(), SAMPLES: b""}
    for folder, (config, pattern) in PAYLOADS.items():
        text = _member(members, folder + config, where)
        kept[folder + config] = text
        for name, payload in _map(_parsed(text, where).get("config"), where).items():
            path = str(_map(payload, where).get("path_name"))
            if payload.get("use_pickle") is not False or not pattern.fullmatch(path):
                _refuse(where, f"{name!r} stored as a pickle ({folder}{path})")
            kept[folder + path] = _member(members, folder + path, where)
    return _archive(kept)


def _members(data: bytes, where: str) -> dict[str, bytes]:
    """Contents by name below the one folder of the archive."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(info.file_size for info in archive.infolist()) > MAXIMUM_BYTES:
                _refuse(where, f"an archive of more than {MAXIMUM_BYTES} bytes")
            return {
                info.filename.partition("/")[2]: archive.read(info) for info in archive.infolist()
            }
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        _refuse(where, f"no archive ({error})", cause=error)


def _member(members: dict[str, bytes], name: str, where: str) -> bytes:
    if name not in members:
        _refuse(where, f"without {name}")
    return members[name]


def _parsed(text: bytes, where: str) -> dict[str, Any]:
    try:
        found = parse_json(text, where=where)
    except BadInputError as error:
        _refuse(where, error.found, cause=error)
    return _map(found, where)


def _map(found: Any, where: str) -> dict[str, Any]:
    if not isinstance(found, dict):
        _refuse(where, "a part of the archive that is no map")
    return found


def _graph(text: bytes, where: str) -> dict[str, Any]:
    """The graph, without what the authors' source looked like, and without guards."""
    graph = _parsed(text, where)
    if graph.get("range_constraints"):
        _refuse(where, "a program whose sizes are not fixed")
    graph["guards_code"] = []
    _look(graph, where)
    return graph


def _look(found: Any, where: str) -> None:
    """Every word of the graph; metadata are emptied in place."""
    if isinstance(found, list):
        for item in found:
            _look(item, where)
    elif isinstance(found, dict):
        if isinstance(found.get("metadata"), dict):
            found["metadata"] = {}
        if "as_expr" in found or "as_graph" in found or "as_custom_obj" in found:
            _refuse(where, f"a graph with {min(found)}, where numbers and arrays are expected")
        if "target" in found:
            _operator(str(found["target"]), where)
        for key, item in found.items():
            _word(key, where)
            if key in STRUCTURES and isinstance(item, str):
                _structure(item, where)
            elif key not in FREE_TEXT or not isinstance(item, str):
                _look(item, where)
    elif isinstance(found, str):
        _word(found, where)


def _word(text: str, where: str) -> None:
    if not WORD.fullmatch(text):
        _refuse(where, f"a graph that says {text[:80]!r}, which is no name")


def _operator(target: str, where: str) -> None:
    if not OPERATOR.fullmatch(target) or target.startswith(READS_FILES):
        _refuse(where, f"a program that calls {target[:80]!r}, which is no arithmetic of torch")


def _structure(text: str, where: str) -> None:
    def look(found: Any) -> None:
        if isinstance(found, list):
            for item in found:
                look(item)
        elif isinstance(found, dict):
            if found.get("type") not in STRUCTURE_TYPES:
                _refuse(where, f"a program that takes or gives {found.get('type')!r}")
            if not _names_only(found.get("context")):
                _refuse(where, "a structure of arguments that says more than names")
            look(found.get("children_spec"))

    try:
        look(json.loads(text))
    except ValueError as error:
        _refuse(where, "a structure of arguments that is none", cause=error)


def _names_only(context: Any) -> bool:
    """Whether a context is none, or the list of a map's names: torch imports what others name."""
    found = json.loads(context) if isinstance(context, str) else context
    if found is None:
        return True
    return isinstance(found, list) and all(isinstance(name, str) for name in found)


def _archive(members: dict[str, bytes]) -> bytes:
    """The same bytes for the same members."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(members):
            archive.writestr(zipfile.ZipInfo(f"program/{name}", WRITTEN_AT), members[name])
    return stream.getvalue()


def _refuse(where: str, found: str, *, cause: Exception | None = None) -> NoReturn:
    raise IntegrityError(
        where=where,
        found=found,
        expected="an exported program of plain numbers and torch's own operators",
        action="Export it with `torch.export.save`, with fixed sizes and plain tensors.",
    ) from cause
