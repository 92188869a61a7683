"""What a versioned page cannot say: when the ladder ran, at which commit, whether it is proved now.

The same evidence has to give the same page, so nothing of the clock or of git stands there. Asked
here, each time anew, of the times that stages left, of git, and of the bytes.
"""

import base64
import datetime
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from gates.change_control import control_of
from gates.git import git
from gates.moved import Moved, moved, moved_text
from gates.overview import TIMES, overview
from gates.past import reports_of
from gates.proof import Rung
from gates.report import Gate, GateReport, report_bytes
from gates.settings import read_params
from genpolicy.errors import GenpolicyError
from genpolicy.integrity.documents import parse_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.progress import duration

CARDS = ("cards/*.dsse.json", "cards/**/*.dsse.json")
NEVER = "never: no signed card is in the history of this repository"


@dataclass(frozen=True)
class Reviewed:
    """The last run that people reviewed: the one of the newest card in the history.

    Attributes:
        commit: That brought the card; empty without one.
        said: In one sentence.
        moved: What moved from its reports to those that lie here; empty where nobody can say.
    """

    commit: str
    said: str
    moved: tuple[Moved, ...]


@dataclass(frozen=True)
class Status:
    """One run, beside what its pages say.

    Attributes:
        task: Name of the task, of `params.yaml`.
        authors: Who made the candidate, likewise.
        candidate: The promoted method; empty where none is.
        ran: When the newest of its stages ended here, and how long all took.
        committed: Which commit holds the reports, from when and by whom.
        proved: What a proof of every byte says now, by gate.
        limits: How many moved after their evidence was there, and how many are overridden.
        reviewed: The last reviewed run.
    """

    task: str
    authors: str
    candidate: str
    ran: str
    committed: str
    proved: Mapping[str, str]
    limits: str
    reviewed: Reviewed


def status_of(root: Path, rungs: list[Rung]) -> Status:
    """The status of the run whose reports lie there.

    Args:
        root: Repository root.
        rungs: Every gate, as proved just now.

    Raises:
        ConfigError: `params.yaml` is missing or malformed.
    """
    params = read_params(root)
    try:
        reports = reports_of(str(root), root)
    except GenpolicyError:
        reports = {}
    named = (params.get("card") or {}).get("authors") or ()
    return Status(
        task=str((params.get("task") or {}).get("name", "")),
        authors=", ".join(map(str, named)),
        candidate=(reports["D"].promoted or "") if "D" in reports else "",
        ran=_ran(root, rungs),
        committed=_committed(root),
        proved={rung.gate: _proved(rung) for rung in rungs},
        limits=_limits(root),
        reviewed=_reviewed(root, reports),
    )


def status_text(status: Status) -> str:
    """For a terminal."""
    lines = [
        f"task       {status.task or 'not named in params.yaml'}",
        f"candidate  {status.candidate or 'none promoted'}",
        f"authors    {status.authors or 'nobody is named in params.yaml: card.authors'}",
        f"ran        {status.ran}",
        f"committed  {status.committed}",
        *(f"proved {gate}   {said}" for gate, said in status.proved.items()),
        f"limits     {status.limits}",
        f"reviewed   {status.reviewed.said}",
    ]
    if status.reviewed.moved:
        lines += ["since then", moved_text(list(status.reviewed.moved))]
    return "\n".join(lines)


def _ran(root: Path, rungs: list[Rung]) -> str:
    known = {line.stage: line.seconds for line in overview(root, rungs) if line.seconds is not None}
    if not known:
        return "not in this checkout: no stage left its time here"
    newest = max((root / TIMES / f"{stage}.json").stat().st_mtime for stage in known)
    ended = datetime.datetime.fromtimestamp(newest, datetime.UTC)
    in_all = duration(sum(known.values()))
    return f"ended {ended:%Y-%m-%d %H:%M} UTC; {len(known)} stages, {in_all} in all"


def _committed(root: Path) -> str:
    said = git(root, "log", "-1", "--format=%h, %cI, %an", "--", "reports")
    if not said:
        return "the reports are in no commit"
    changed = git(root, "status", "--porcelain", "--", "reports")
    return f"{said}; changed since, not committed" if changed else said


def _proved(rung: Rung) -> str:
    if rung.verdict == "REFUSED":
        return f"not proved: {rung.note}"
    if rung.verdict == "NOT JUDGED":
        return "not judged"
    return f"now, {rung.verdict}: every byte is as the report says"


def _limits(root: Path) -> str:
    """Who moved what stands at length elsewhere."""
    try:
        control = control_of(root)
    except GenpolicyError as error:
        return f"unknown: {error}"
    known = f"{len(control.shifted)} moved after their evidence"
    if control.unknown:
        known = f"who moved one is unknown, {control.unknown}"
    overridden = f", {len(control.overrides)} OVERRIDDEN" if control.overrides else ""
    return f"{known}{overridden}; by whom: `genpolicy report limits`"


def _reviewed(root: Path, reports: Mapping[Gate, GateReport]) -> Reviewed:
    found = git(root, "log", "-1", "--diff-filter=AMR", "--format=%H", "--", *CARDS)
    if not found:
        return Reviewed("", NEVER, ())
    said = f"by the card of commit {found[:7]} (its signatures: `genpolicy card verify`)"
    try:
        then = reports_of(found, root)
        if _signed(root, found) != {
            g: sha256_bytes(report_bytes(then[g])) for g in "ABCD" if g in then
        }:
            return Reviewed(found, f"{said}, which names other reports than that commit holds", ())
    except (GenpolicyError, KeyError, TypeError, ValueError, AttributeError) as error:
        return Reviewed(found, f"{said}, which cannot be compared: {error}", ())
    return Reviewed(found, said, tuple(moved(then, reports)))


def _signed(root: Path, commit: str) -> dict[str, str]:
    """SHA-256 of the reports that the card of a commit was signed over."""
    names = git(root, "show", "--format=", "--name-only", "--relative", commit, "--", *CARDS)
    text = git(root, "show", "--end-of-options", f"{commit}:./{(names or '').splitlines()[0]}")
    envelope = parse_json((text or "").encode(), where="the card")
    payload = parse_json(base64.b64decode(envelope.get("payload")), where="the card")
    return {
        str(gate): str(digest) for gate, digest in payload.get("predicate").get("reports").items()
    }
