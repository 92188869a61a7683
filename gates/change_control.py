"""Which limits moved after the evidence that they judge was there: by whom, when and which way.

What git says, asked each time anew: in a report it would change the bytes with every commit, and
a bundle has no history to derive it from. A move is one commit, so that a limit that went and came
back shows twice. It came after the evidence unless it lies before every commit that brought the
hash of that evidence into `dvc.lock`: the order of commits is known, the hour of a run is not.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from gates.card.history import MEASURED, brought_by, commits_of, evidence_digests, unknown_history
from gates.floor_history import FLOORS, bound_moves
from gates.git import git
from gates.overrides import placed, read_overrides
from gates.pipeline import LOCK
from gates.preregistration import asked_by, moves, plan_of
from gates.report import GATES, Gate
from gates.settings import PARAMS_FILE, read_params
from genpolicy.errors import GenpolicyError
from genpolicy.integrity.documents import parse_yaml

NOT_COMMITTED = "not committed"
FIELDS = "%H%x00%P%x00%an <%ae>%x00%cs"
"""Of a commit: its hash, its parents, who wrote it and the day on which it was committed."""


@dataclass(frozen=True)
class Shifted:
    """One limit, or another setting of the plan, that one commit moved.

    Attributes:
        gate: The lowest gate that judges by it.
        place: In `params.yaml`, a limit by its gate and criterion; a bound behind its file.
        kind: `loosened`, `tightened`, or `changed` where neither side is stricter.
        before: What stood there.
        now: What the commit put there.
        commit: Its hash; empty for what is not committed.
        day: Of the commit, YYYY-MM-DD; empty likewise.
        by: Who wrote it; empty likewise.
        after: Evidence stages that had written theirs.
    """

    gate: Gate
    place: str
    kind: str
    before: str
    now: str
    commit: str
    day: str
    by: str
    after: tuple[str, ...]


@dataclass(frozen=True)
class Control:
    """What git says of limits and of evidence.

    Attributes:
        unknown: Why it says nothing; empty where it does.
        shifted: Limits that moved after their evidence was there, the newest first; behind them
            bounds of limits.
        undated: Evidence stages whose evidence is in no commit, so that nobody knows what of the
            committed limits is older.
        overrides: Each written exception, and who committed it.
    """

    unknown: str
    shifted: tuple[Shifted, ...]
    undated: tuple[str, ...]
    overrides: tuple[str, ...]


_Moved = tuple[Gate, str, str, str]
"""The lowest gate that judges by a place, how it moved, from what and to what."""


@dataclass(frozen=True)
class _Commit:
    """A commit that changed `params.yaml`; that of the working tree has no hash."""

    sha: str
    parents: tuple[str, ...]
    by: str
    day: str


def control_of(root: Path) -> Control:
    """What moved after its evidence, by the history of the repository around `root`.

    Raises:
        ConfigError: `params.yaml`, `overrides.yaml` or the lock file is malformed.
    """
    params = read_params(root)
    if unknown := _unknown(root):
        said = tuple(f"{placed(entry)}, by {entry.by}" for entry in read_overrides(root, params))
        return Control(unknown, (), (), said)
    known = evidence_digests(root) if (root / LOCK).is_file() else {}
    dated = {stage: commits_of(root, known[stage]) for stage in MEASURED if known.get(stage)}
    behind = {commit: _ancestors(root, commit) for commit in {*chain(*dated.values())}}
    older = {
        stage: set.intersection(*(behind[commit] for commit in commits))
        for stage, commits in dated.items()
        if commits
    }
    shifted: list[Shifted] = []
    for path, moved in ((PARAMS_FILE, _limits_moved), (FLOORS, _bounds_moved)):
        for commit in _commits(root, path):
            there = [stage for stage in dated if commit.sha not in older.get(stage, {commit.sha})]
            if not commit.sha:
                there = list(dated)
            if there:
                shifted += _shifted(root, commit, path, moved, there)
    undated = tuple(stage for stage, commits in dated.items() if not commits)
    return Control("", tuple(shifted), undated, tuple(_exceptions(root, params)))


def control_text(control: Control) -> str:
    """For a terminal: a line for each move, then what nobody knows and what is overridden."""
    if control.unknown:
        lines = [f"Who moved a limit is unknown: {control.unknown}."]
    elif not control.shifted:
        lines = ["No limit moved after its evidence was there."]
    else:
        lines = [f"{len(control.shifted)} moved after their evidence was there:"]
    lines += [_line(shift) for shift in control.shifted]
    lines += [
        f"Unknown of {stage}: its evidence is in no commit, so that a limit may have been "
        "committed behind it."
        for stage in control.undated
    ]
    lines += [f"OVERRIDDEN  {text}" for text in control.overrides]
    return "\n".join(lines)


def _line(shift: Shifted) -> str:
    who = f"{shift.by}, {shift.commit[:10]} of {shift.day}" if shift.commit else NOT_COMMITTED
    return (
        f"{shift.kind:<10} {shift.place}: {shift.before} -> {shift.now}, by {who}; "
        f"after {', '.join(shift.after)}"
    )


def _unknown(root: Path) -> str:
    """Why git says nothing of these limits; empty where it does."""
    if found := unknown_history(root)[0]:
        return f"the repository is {found}"
    if not git(root, "log", "-1", "--format=%H", "--", PARAMS_FILE):
        return f"{PARAMS_FILE} is in no commit"
    return ""


def _exceptions(root: Path, params: Mapping[str, Any]) -> Iterator[str]:
    """Who committed each written exception, and when."""
    for entry, commits in brought_by(root, read_overrides(root, params)):
        asked = (git(root, "log", "-1", "--format=%an <%ae>, %h of %cs", one) for one in commits)
        who = "; ".join(one for one in asked if one)
        yield (
            f"{placed(entry)}: {entry.limit:.6g} by {entry.by} until {entry.expires}, committed "
            f"by {who or f'nobody: {NOT_COMMITTED}'}"
        )


def _commits(root: Path, path: str) -> Iterator[_Commit]:
    """What is not committed, then the commits that changed a file, the newest first."""
    head = git(root, "rev-parse", "HEAD") or ""
    if git(root, "diff", "--quiet", "HEAD", "--", path) is None:
        yield _Commit("", (head,), "", "")
    listed = git(root, "log", "--full-history", f"--format={FIELDS}", "--", path) or ""
    for line in listed.splitlines():
        sha, parents, by, day = line.split("\0")
        yield _Commit(sha, tuple(parents.split()), by, day)


def _shifted(
    root: Path,
    commit: _Commit,
    path: str,
    moved: Callable[[str, str], dict[str, _Moved]],
    there: list[str],
) -> Iterator[Shifted]:
    """What a commit moved that the evidence is judged by: other than with each of its parents."""
    now = _text_at(root, commit.sha, path)
    each = [moved(_text_at(root, parent, path), now) for parent in commit.parents]
    for place, (gate, kind, before, value) in each[0].items() if each else ():
        reached = GATES[GATES.index(gate) :]
        after = tuple(stage for stage in there if MEASURED[stage] in reached)
        if after and all(place in other for other in each):
            yield Shifted(
                gate, place, kind, before, value, commit.sha, commit.day, commit.by, after
            )


def _limits_moved(before: str, now: str) -> dict[str, _Moved]:
    """Limits and other settings of the plan that differ between two texts of the parameters."""
    found = moves(plan_of(_params_in(before)), _params_in(now))
    return {
        move.place: (asked_by(move.place), move.kind, str(move.before), str(move.now))
        for move in found
    }


def _bounds_moved(before: str, now: str) -> dict[str, _Moved]:
    """Bounds of limits that differ between two texts of the module that holds them."""
    return dict(bound_moves(before, now))


def _text_at(root: Path, commit: str, path: str) -> str:
    """A file as a commit left it, or as it lies here; empty where it had none."""
    if commit:
        return git(root, "show", f"{commit}:./{path}") or ""
    file = root / path
    return file.read_text() if file.is_file() else ""


def _params_in(text: str) -> Mapping[str, Any]:
    """Settings; none where the text has none that can be read."""
    try:
        found = parse_yaml(text.encode(), where=PARAMS_FILE)
    except GenpolicyError:
        return {}
    return found if isinstance(found, Mapping) else {}


def _ancestors(root: Path, commit: str) -> set[str]:
    """Commits that lie before one; itself is none of them."""
    return {*(git(root, "rev-list", commit) or "").split()} - {commit}
