"""Section `source`: where the recordings of the ladder come from, and that nothing of it is lost.

Recordings of one's own stay where they are: the stages read them and write only their own folders.
"""

from pathlib import Path
from typing import Any, Literal

from pydantic import model_validator

from genpolicy.contract.settings import Settings
from genpolicy.errors import BadInputError, ConfigError
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.hashing import sha256_file
from stages._stage import ARTIFACTS

SOURCE_FILE = "source.json"
INDEX_FILE = "index.json"
MANIFEST_FILE = "manifest.json"
KEPT_BY_INGEST = (MANIFEST_FILE, "frames.parquet", "episodes.parquet", "refusals.json")


class SourceSection(Settings):
    """Section `source`.

    Attributes:
        kind: `embedded`: the stage `record` demonstrates the task. `recordings`: a folder of MCAP
            files under the task's contract. `dataset`: a folder that `genpolicy ingest` wrote.
        path: That folder, from the root of the workspace; none where the task is demonstrated.
    """

    kind: Literal["embedded", "recordings", "dataset"]
    path: str | None = None

    @model_validator(mode="after")
    def _path_belongs_to_kind(self) -> "SourceSection":
        if (self.kind == "embedded") != (self.path is None):
            raise ValueError(
                "path names the folder of recordings or of a dataset; embedded has none"
            )
        return self

    @property
    def folder(self) -> Path:
        """The folder of one's own.

        Raises:
            ConfigError: It is none, or lies where a stage writes.
        """
        assert self.path is not None, "embedded has no folder"  # kept apart by the validator
        folder = Path(self.path)
        if not folder.is_dir():
            raise ConfigError(
                where="params.yaml: source.path",
                found=f"{self.path}, which is no folder",
                expected=f"a folder with the {self.kind}",
                action="Correct the path; it counts from the root of the workspace.",
            )
        if folder.resolve().is_relative_to(ARTIFACTS.resolve()):
            raise ConfigError(
                where="params.yaml: source.path",
                found=f"{self.path}, where the stages write",
                expected="a folder of your own",
                action=f"Move it out of {ARTIFACTS}/: a stage replaces its folder as a whole.",
            )
        return folder


def source_document(source: SourceSection) -> dict[str, Any]:
    """What the ladder's recordings are, by hash; it changes exactly when they do.

    Raises:
        ConfigError: The folder is missing, empty, or lies where a stage writes.
    """
    if source.kind == "embedded":
        return {"kind": source.kind}
    return {"kind": source.kind, "files": {p.name: sha256_file(p) for p in source_files(source)}}


def source_files(source: SourceSection) -> list[Path]:
    """The files of one's own that the ladder reads, by name.

    Raises:
        ConfigError: The folder is missing, holds none, or lies where a stage writes.
    """
    folder = source.folder
    recordings = source.kind == "recordings"
    files = sorted(folder.glob("*.mcap") if recordings else folder.iterdir())
    if not files or not (recordings or (folder / MANIFEST_FILE).is_file()):
        raise ConfigError(
            where=f"params.yaml: source.path: {folder}",
            found="without " + ("any *.mcap" if recordings else MANIFEST_FILE),
            expected="MCAP recordings" if recordings else "what `genpolicy ingest` wrote",
            action="Correct kind or path; `genpolicy ingest` reads the other layouts.",
        )
    return files


def require_unchanged(source: SourceSection) -> list[Path]:
    """The files of one's own, if they are still those that the stage `task` saw.

    Raises:
        BadInputError: A file came, went or changed since.
    """
    if read_json(ARTIFACTS / "task" / SOURCE_FILE) != source_document(source):
        raise BadInputError(
            where=str(source.folder),
            found="other files than at the start of the ladder",
            expected="recordings that stay as they are while it runs",
            action="Run `dvc repro` again when nobody writes there any more.",
        )
    return source_files(source)


def refuse_foreign_files() -> None:
    """Stop before a stage replaces a folder in which somebody has put files of their own.

    Raises:
        BadInputError: A file in the folder of `record` or `ingest` that the stage did not write.
    """
    index = ARTIFACTS / "record" / INDEX_FILE
    listed = read_json(index) if index.is_file() else None
    files = listed.get("files") if isinstance(listed, dict) else None
    own: dict[str, Any] = files if isinstance(files, dict) else {}
    for path in _files(ARTIFACTS / "record"):
        name = path.relative_to(index.parent).as_posix().removeprefix("episodes/")
        if path != index and own.get(name) != sha256_file(path):
            _foreign(path, "record")
    for path in _files(ARTIFACTS / "ingest"):
        if path.relative_to(ARTIFACTS / "ingest").as_posix() not in KEPT_BY_INGEST:
            _foreign(path, "ingest")


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def _foreign(path: Path, stage: str) -> None:
    raise BadInputError(
        where=str(path),
        found=f"a file that the stage {stage} did not write",
        expected=f"nothing else: {stage} replaces the folder {path.parent} as a whole",
        action="Move it to a folder of your own and name that in params.yaml: source "
        "{kind: recordings, path: ...}.",
    )
