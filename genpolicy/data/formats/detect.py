"""Which layout is this? Told by what is there, never by trying to read it."""

from pathlib import Path
from typing import NoReturn

from genpolicy.data.assemble import FRAMES_FILE, MANIFEST_FILE
from genpolicy.errors import BadInputError

DATASET = "dataset"
HDF5_SUFFIXES = (".hdf5", ".h5", ".hdf")
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
PARQUET_MAGIC = b"PAR1"
MCAP_MAGIC = b"\x89MCAP0\r\n"


def detect(path: Path) -> str:
    """Name of the layout of `path`, or `dataset`.

    Raises:
        BadInputError: Missing, of no known layout, or of several at once.
    """
    if not path.exists():
        _refuse(path, "missing", "a file or folder of recordings")
    found = _folder(path) if path.is_dir() else _file(path)
    if not found:
        _refuse(
            path,
            "of no known layout",
            "a dataset folder, MCAP files, a Zarr replay buffer, a LeRobot dataset, a robomimic "
            "HDF5 file or Parquet files",
        )
    if len(found) > 1:
        _refuse(path, f"of several layouts at once ({', '.join(found)})", "one layout")
    return found[0]


def _folder(path: Path) -> list[str]:
    if (path / MANIFEST_FILE).is_file() and (path / FRAMES_FILE).is_file():
        return [DATASET]
    if (path / "meta" / "info.json").is_file():
        return ["lerobot"]
    if (path / ".zgroup").is_file() or (path / "meta" / "episode_ends").is_dir():
        return ["zarr"]
    found = []
    if any(path.glob("*.mcap")):
        found.append("mcap")
    if any(path.rglob("*.parquet")):
        found.append("parquet")
    return found


def _file(path: Path) -> list[str]:
    try:
        with path.open("rb") as stream:
            head = stream.read(8)
    except OSError as error:
        _refuse(path, f"not readable ({error.strerror})", "a readable file")
    if head == HDF5_MAGIC or path.suffix in HDF5_SUFFIXES:
        return ["robomimic"]
    if head[:4] == PARQUET_MAGIC or path.suffix == ".parquet":
        return ["parquet"]
    if head == MCAP_MAGIC or path.suffix == ".mcap":
        return ["mcap"]
    return []


def _refuse(path: Path, found: str, expected: str) -> NoReturn:
    raise BadInputError(
        where=str(path),
        found=found,
        expected=expected,
        action="Check the path, or name the layout with --format.",
    )
