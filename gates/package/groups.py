"""The eleven groups of artifacts that every candidate comes with, and whether all are there.

The chapter lists them (section 8). A part is a file of the run; where it holds rows or entries of
several candidates, there must be some of this one, or the group is not complete.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pyarrow.compute as pc

from gates.ledger.claims import LEDGER
from gates.report import GATES, report_path
from gates.reproducibility.settings import BROUGHT_FOLDER, RELOAD
from gates.settings import PARAMS_FILE
from genpolicy.errors import BadInputError, IntegrityError
from genpolicy.evidence.documents.brought import BROUGHT
from genpolicy.evidence.documents.reproducibility import CANDIDATES
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.tables import read_table

LATENCY, SHADOW, STRESS = "artifacts/latency", "artifacts/shadow", "artifacts/stress"
GENERATORS, BASELINES = "artifacts/train_generators", "artifacts/train_baselines"
MEASURED, MONITORS = "artifacts/measure_baselines", "artifacts/monitors"
PROBED = tuple(
    f"{MONITORS}/{name}.parquet" for name in ("alarms", "scores", "thresholds", "unavailable")
)
"""What the stage that runs out-of-distribution probes writes; without rows where none is asked."""
IDENTITY = f"{RELOAD}/{CANDIDATES.file}"
A, B, C, D, _ = (report_path(gate) for gate in GATES)


@dataclass(frozen=True)
class Part:
    """One file of a group, or several.

    Attributes:
        path: From the root of the workspace, a glob; `{candidate}` stands for its name.
        speaks: Where it must speak of the candidate: in the rows of a table, in an entry of a
            document, or nowhere in particular.
    """

    path: str
    speaks: Literal["rows", "entry", ""] = ""


@dataclass(frozen=True)
class Unmeasured:
    """What a team may leave out, and the table whose rows say that it did not.

    Attributes:
        table: Path of the table.
        text: What is said where it has no row of the candidate.
    """

    table: str
    text: str


@dataclass(frozen=True)
class Group:
    """One group.

    Attributes:
        number: In the chapter's order, from 1.
        title: The chapter's words, shortened.
        parts: What it consists of.
        unmeasured: What of it may not have been measured; said with the bundle where it was not.
    """

    number: int
    title: str
    parts: tuple[Part, ...]
    unmeasured: Unmeasured | None = None

    def lacks(self, root: Path, candidate: str) -> str:
        """What of it was not measured of a candidate; empty where all of it was.

        Args:
            root: Of the workspace, where the group is complete.
            candidate: Its name.
        """
        asked = self.unmeasured
        if asked is None or candidate in _spoken_of(root / asked.table, asked.table, "rows"):
            return ""
        return asked.text


def _rows(*paths: str) -> tuple[Part, ...]:
    return tuple(Part(path, "rows") for path in paths)


OWN = Part(IDENTITY, "entry")
CHECKPOINT = Part(f"{GENERATORS}/{{candidate}}/*/*")
ENTRY = Part(f"{BROUGHT_FOLDER}/{BROUGHT.file}", "entry")
GROUPS = (
    Group(1, "dataset and split, action semantics, calibration epoch",
          (Part("artifacts/ingest/*"), Part("artifacts/task/*.json"), OWN)),
    Group(2, "report of the matched baselines",
          (Part(A), Part(f"{BASELINES}/matched.json"), Part(f"{BASELINES}/*/*/*"),
           Part(f"{MEASURED}/*"))),
    Group(3, "architecture, checkpoint, training seed, config hash", (CHECKPOINT, OWN)),
    Group(4, "sampler, schedule or path, NFE, precision, warm-up",
          (OWN, *_rows(f"{RELOAD}/samples.parquet", f"{RELOAD}/variations.parquet",
                       f"{RELOAD}/nfe.parquet"), Part(B))),
    Group(5, "horizons, invocation rate, controller deadline",
          (OWN, Part(PARAMS_FILE), Part("limits.yaml"))),
    Group(6, "latency by component, action age",
          _rows(f"{LATENCY}/latency.parquet", f"{LATENCY}/model.parquet",
                f"{LATENCY}/machine.parquet",
                f"{STRESS}/ages.parquet", f"{STRESS}/invocations.parquet")),
    Group(7, "diversity, mode coverage, feasibility rejection, projection",
          _rows(f"{RELOAD}/modes.parquet", f"{SHADOW}/candidates.parquet")),
    Group(8, "temporal jerk, replacement, stale, dropped and reordered chunks",
          (*_rows(f"{SHADOW}/candidates.parquet", f"{SHADOW}/counts.parquet",
                  f"{SHADOW}/stub.parquet", f"{STRESS}/counts.parquet",
                  f"{STRESS}/conservation.parquet", f"{STRESS}/stub.parquet"), Part(C))),
    Group(9, "success, recovery, intervention, reset, with intervals",
          (*_rows(f"{STRESS}/rollouts.parquet"), Part(D))),
    Group(10, "fallback transitions, watchdog, safety events",
          (*_rows(f"{SHADOW}/holds.parquet"), Part(f"{SHADOW}/journal.mcap"),
           Part(f"{SHADOW}/checker.json"), Part(f"{SHADOW}/mutants.json"),
           Part(f"{STRESS}/checker.json"), Part(f"{STRESS}/journals/{{candidate}}__*.mcap"),
           *map(Part, PROBED)),
          Unmeasured(PROBED[0], "out-of-distribution probes: none was run of this candidate")),
    Group(11, "matched comparison and unmatched-evidence caveats",
          (Part(f"{GENERATORS}/matched.json"), Part(f"{STRESS}/power.json"),
           *_rows(f"{STRESS}/rollouts.parquet"), Part(f"{STRESS}/journals/*.mcap"),
           Part(B), Part(D), Part(LEDGER))),
)  # fmt: skip


def contents(root: Path, candidate: str, *, brought: bool) -> Mapping[int, tuple[str, ...]]:
    """Files of each group, by its number.

    Args:
        root: Of the workspace.
        candidate: Its name.
        brought: Whether an entry names its weights; else they were trained here.

    Raises:
        BadInputError: A part is missing, or says nothing of the candidate; all such are named.
    """
    found: dict[int, tuple[str, ...]] = {}
    missing: list[str] = []
    for group in GROUPS:
        files: dict[str, None] = {}
        for part in group.parts:
            here = _files(root, ENTRY if brought and part == CHECKPOINT else part, candidate)
            if isinstance(here, str):
                missing.append(f"{group.number} ({group.title}): {here}")
            else:
                files |= dict.fromkeys(here)
        found[group.number] = tuple(files)
    if missing:
        raise BadInputError(
            where=f"the bundle of {candidate!r}",
            found=f"without {'; '.join(missing)}",
            expected="all eleven groups of artifacts",
            action="Run the ladder until Gate D judges this candidate; nothing was written.",
        )
    return found


def _files(root: Path, part: Part, candidate: str) -> tuple[str, ...] | str:
    """Files of a part, or what is wrong with it."""
    pattern = part.path.format(candidate=candidate)
    files = sorted(path for path in root.glob(pattern) if path.is_file())
    if not files:
        return f"no {pattern}"
    names = tuple(path.relative_to(root).as_posix() for path in files)
    if part.speaks and candidate not in _spoken_of(files[0], names[0], part.speaks):
        return f"nothing of it in {names[0]}"
    return names


def _spoken_of(path: Path, name: str, where: str) -> set[str]:
    if where == "entry":
        document = read_json(path)
        return set(document) if isinstance(document, dict) else set()
    table = read_table(path)
    if "method" not in table.column_names:
        raise IntegrityError(
            where=name,
            found="a table without the column `method`",
            expected="the table that its stage writes",
            action="Run `dvc repro`, which writes it again.",
        )
    return {str(value) for value in pc.unique(table.column("method")).to_pylist()}
