"""Any recordings to a dataset folder: find out what they are, propose a contract, import them."""

from importlib import import_module
from pathlib import Path
from typing import Any, Literal, get_args

from genpolicy.data.assemble import MANIFEST_FILE
from genpolicy.data.contract import SplitRule
from genpolicy.data.formats.collect import import_source
from genpolicy.data.formats.contract import Format, ImportContract
from genpolicy.data.formats.detect import DATASET, detect
from genpolicy.data.formats.ingested import open_ingested
from genpolicy.data.formats.mcap import import_recordings, propose_recordings
from genpolicy.data.formats.proposal import propose_contract
from genpolicy.data.formats.result import Opened
from genpolicy.data.formats.source import Progress, Source
from genpolicy.errors import ConfigError

FormatOption = Literal["auto", "mcap", "zarr", "lerobot", "robomimic", "parquet"]
FORMATS: tuple[str, ...] = get_args(FormatOption)
EXTRAS = {"zarr": "zarr", "h5py": "hdf5"}
READERS = {
    "zarr": "genpolicy.data.formats.zarr_buffer",
    "lerobot": "genpolicy.data.formats.lerobot",
    "robomimic": "genpolicy.data.formats.robomimic",
    "parquet": "genpolicy.data.formats.parquet",
}


def open_dataset(
    path: Path,
    *,
    out: Path,
    format: str = "auto",
    contract: ImportContract | None = None,
    task: str | None = None,
    split: SplitRule | None = None,
    progress: Progress | None = None,
) -> Opened:
    """Recordings of any known layout as a verified dataset folder.

    Args:
        path: File or folder of the recordings, or a dataset folder, which is used as it is.
        out: The dataset folder to write; whole or not at all, an old one is replaced.
        format: One of `FORMATS`.
        contract: How to read them; proposed from the recordings if absent.
        task: Name of the task: overrides the one of a proposed contract, and for MCAP names the
            registered task whose contract to use.
        split: Shares of the splits in the order of recording; 70 / 15 / 15 if absent.
        progress: Called with episodes done and, where known, how many there are.

    Raises:
        BadInputError: No such layout, an unreadable one, a contract that does not fit, or too few
            episodes accepted.
    """
    kind = _kind(path, format, contract)
    if kind == DATASET:
        return open_ingested(path, contract)
    check_target(path, out)
    if kind == "mcap":
        rules = contract or propose_recordings(path, task=task)
        return import_recordings(path, contract=rules, out=out, split=split)
    source = open_source(path, kind)
    rules = contract or _proposed(source, kind, task)
    return import_source(source, rules, out=out, split=split or SplitRule(), progress=progress)


def propose(path: Path, *, format: str = "auto", task: str | None = None) -> ImportContract:
    """The contract that `open_dataset` would use if none is given.

    Raises:
        BadInputError: No such layout, or nothing in it that could be an observation or an action.
    """
    kind = _kind(path, format, None)
    if kind == DATASET:
        return open_ingested(path, None).contract
    if kind == "mcap":
        return propose_recordings(path, task=task)
    return _proposed(open_source(path, kind), kind, task)


def open_source(path: Path, kind: Format) -> Source:
    """The recordings, opened and described.

    Raises:
        BadInputError: Not of that layout, or its library is not installed.
    """
    try:
        module = import_module(READERS[kind])
    except ModuleNotFoundError as error:
        name = error.name or ""
        if name not in EXTRAS:
            raise
        raise ConfigError(
            where=f"format {kind}",
            found=f"without the library {name}",
            expected="an installed reader",
            action=f"Install it: pip install 'genpolicy[{EXTRAS[name]}]'.",
        ) from error
    source: Source = module.open_source(path)
    return source


def check_target(path: Path, out: Path) -> None:
    """Refuse a place whose content would be lost: the old folder is removed before the new one.

    Raises:
        ConfigError: `out` overlaps the recordings, or holds something else than a dataset.
    """
    source, target = path.resolve(), out.resolve()
    if source.is_relative_to(target) or target.is_relative_to(source):
        found = f"{out}, in or around the recordings {path}"
    elif out.is_symlink() or (out.exists() and not out.is_dir()):
        found = f"{out}, not a folder"
    elif out.is_dir() and any(out.iterdir()) and not (out / MANIFEST_FILE).is_file():
        found = f"{out}, which holds something else than a dataset"
    else:
        return
    raise ConfigError(
        where="the dataset folder to write",
        found=found,
        expected="a new folder, or that of an earlier dataset, which is replaced",
        action="Name another folder; nothing was removed.",
    )


def _kind(path: Path, format: str, contract: ImportContract | None) -> Any:
    if format not in FORMATS:
        raise ConfigError(
            where="--format",
            found=repr(format)[:40],
            expected=f"one of {', '.join(FORMATS)}",
            action="Name the layout of the recordings, or leave it to `auto`.",
        )
    if contract is not None and format not in ("auto", contract.format):
        raise ConfigError(
            where="contract: format",
            found=contract.format,
            expected=f"{format}, as given by --format",
            action="Leave out --format, or give the contract of these recordings.",
        )
    found = detect(path) if format == "auto" else format
    if contract is not None and found not in (contract.format, DATASET):
        raise ConfigError(
            where=str(path),
            found=f"recordings of the layout {found}",
            expected=f"{contract.format}, as the contract says",
            action="Give the contract of these recordings.",
        )
    return found


def _proposed(source: Source, kind: Format, task: str | None) -> ImportContract:
    """The contract of a layout that is known by heart, or one guessed from the columns."""
    known = source.known
    if known is None:
        return propose_contract(source, kind, task=task)
    return known.model_copy(update={"task": task}) if task else known
