"""What evidence states against what is derived again: rows by their keys, documents by their keys.

The first difference is refused by name, with both values.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NoReturn, TypeVar

from pydantic import BaseModel

from gates.report import Gate, report_path
from gates.settings import PARAMS_FILE, section_of
from genpolicy.contract.settings import parse_settings
from genpolicy.errors import ConfigError, RefusedError
from genpolicy.verification.rollouts import differences

Model = TypeVar("Model", bound=BaseModel)
Row = Mapping[str, Any]
Key = tuple[Any, ...]
LONGEST = 120  # characters of a value in a message


def section(params: Mapping[str, Any], name: str, model: type[Model]) -> Model:
    """Section `name` of `params.yaml` as its model.

    Raises:
        ConfigError: Missing, an unknown key or a wrong value.
    """
    return parse_settings(model, section_of(params, name), where=f"{PARAMS_FILE}: {name}")


def training_seed(params: Mapping[str, Any]) -> object:
    """Number of the training seed that gates C and D judge; None where none is named."""
    seeds = section_of(params, "policy").get("seeds")
    return seeds[0] if isinstance(seeds, list) and seeds else None


def device_of(params: Mapping[str, Any]) -> str:
    """Torch device on which what is trained here is asked.

    Raises:
        ConfigError: The section is missing, or names none.
    """
    device = section_of(params, "compute").get("device")
    if not isinstance(device, str):
        raise ConfigError(
            where=f"{PARAMS_FILE}: compute.device",
            found=repr(device),
            expected="the name of a device",
            action="Restore the file from version control.",
        )
    return device


def root_seed(params: Mapping[str, Any]) -> int:
    """Root seed of the workspace.

    Raises:
        ConfigError: It is no whole number.
    """
    seed = params.get("seed")
    if not isinstance(seed, int) or isinstance(seed, bool):
        raise ConfigError(
            where=f"{PARAMS_FILE}: seed",
            found=repr(seed),
            expected="a whole number",
            action="Restore the file from version control.",
        )
    return seed


def compare_rows(
    gate: Gate,
    path: str,
    keys: Sequence[str],
    stated: Sequence[Row],
    derived: Sequence[Row],
    *,
    seed: object,
    origin: str = "its journal",
) -> None:
    """Each row that a table states is what its journal says, and neither is without the other.

    Args:
        gate: Whose evidence it is.
        path: The table, from the root of the workspace; its stem names a row in messages.
        keys: Columns by which a row is known.
        stated: Rows of the table.
        derived: The same rows, as journals say.
        seed: What the column `seed` must hold, where the table has one; no journal names it.
        origin: What says so, for messages.

    Raises:
        RefusedError: They differ, or a row is stated twice.
    """
    name = path.rpartition("/")[2].partition(".")[0]
    what = {"recoveries": "recovery"}.get(name, name.removesuffix("s"))

    def by_key(rows: Sequence[Row]) -> dict[Key, Row]:
        found: dict[Key, Row] = {}
        for row in rows:
            key = tuple(row.get(column) for column in keys)
            if key in found:
                refuse(gate, f"{what} {_joined(key)}", "stated twice", "one row")
            found[key] = row
        return found

    told, expected = by_key(stated), by_key(derived)
    for key in sorted({*told, *expected}, key=repr):
        where = f"{what} {_joined(key)}"
        if key not in told or key not in expected:
            plain = origin.replace("its ", "a ")
            found = f"without {plain}" if key in told else f"only in {plain}"
            refuse(gate, where, found, f"one row of {path} and what {plain} says")
        row = dict(told[key])
        own = {**expected[key], **({"seed": seed} if "seed" in row else {})}
        for column in differences(row, own)[:1]:
            text = f"{own[column]!r}, as {origin} says"
            refuse(gate, f"{where}: {column}", f"{row.get(column)!r}", text)


def compare_keys(gate: Gate, path: str, stated: Row, derived: Row, how: str) -> None:
    """Each key of a document is what is derived again.

    Raises:
        RefusedError: One is not; `how` says where the expected value is from.
    """
    for key in sorted({*stated, *derived}):
        if stated.get(key) != derived.get(key):
            text = f"{short(derived.get(key))}, {how}"
            refuse(gate, f"{path}: {key}", short(stated.get(key)), text)


def mapping(document: Any) -> dict[str, Any]:
    """A document as a mapping; empty where it is none, so that what is missing is refused."""
    return document if isinstance(document, dict) else {}


def short(value: object) -> str:
    """A value in few words."""
    if isinstance(value, list) and any(isinstance(entry, dict) for entry in value):
        return f"{len(value)} entries"
    text = str(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"


def refuse(gate: Gate, criterion: str, measured: str, limit: str) -> NoReturn:
    """Refuse evidence that is not what lies under it.

    Raises:
        RefusedError: Always.
    """
    raise RefusedError(
        gate=gate,
        criterion=criterion,
        measured=measured,
        limit=limit,
        report=report_path(gate),
        action="The evidence was not written by its stage. Run it again (`dvc repro -f`).",
    )


def _joined(key: Key) -> str:
    return "/".join(map(str, key))
