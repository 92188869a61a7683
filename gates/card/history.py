"""What only the history of the repository knows: what came first, and who committed.

Asked by the commands `card sign`, `card verify`, `gates check --through E`, not by the judge: the
same evidence gives the same report, whatever is committed afterwards.

Git shows the order of commits, not when a run took place or whose hands typed. What was measured
and left out of the history until the plan was committed looks like evidence that came after it.
"""

import re
from collections.abc import Sequence
from itertools import chain
from pathlib import Path

from gates.card.people import ALLOW_LIST, AllowList, load_allow_list
from gates.card.signing import read_draft
from gates.git import git
from gates.overriders import made_by
from gates.overrides import OVERRIDES, Override, entries_of, placed
from gates.pipeline import LOCK, RUNGS
from gates.preregistration import PREREGISTRATION, asked_by
from gates.report import GATES, Gate
from genpolicy.errors import GenpolicyError, IntegrityError
from genpolicy.integrity.documents import parse_yaml, read_yaml
from genpolicy.integrity.hashing import sha256_bytes_of

MADE = (
    "task", "record", "ingest", "train_baselines", "train_factors", "candidates",
    "train_generators", "monitors", "failure_search", "card",
)  # fmt: skip
"""Stages that make what is measured, only report, or make the card: no figure of theirs is held
against a limit."""
MEASURED: dict[str, Gate] = {
    stage: gate for gate, stages in RUNGS.items() for stage in stages if stage not in MADE
}
"""Stages whose evidence a plan has to precede, and the gate that judges it."""
CANDIDATE = ("genpolicy", "gates", "stages", "params.yaml", "dvc.yaml")
"""Whoever committed to these made the candidate, or the yardstick that it is held against."""
MAKERS = "a <%ae>%nc <%ce>%n%(trailers:key=Co-authored-by,valueonly,unfold,separator=%x0A)"
"""Per commit: who wrote it, who committed it, and who is named as having helped."""
FORGE = "noreply@github.com"
"""Commits what is merged by a button; nobody's own address."""
FULL = ("--full-history", "-m", "--format=%H")
"""Commits of every side of a merge: git leaves out a side that the merge did not take."""
PLAN_FIRST = "Plan, commit, run, commit, and have it reviewed by somebody else; then sign."
SAY_SO = (
    f"Whoever overrides a limit commits the entry of {OVERRIDES} with their own hands; one that "
    "somebody else brought once, with another reason or last day."
)
NAME_ALL = (
    f"Name all who made it in `card.authors`, by their addresses on {ALLOW_LIST}; let others sign."
)


def require_history(root: Path) -> None:
    """Require of the draft below `root` that its plan came first and its makers are its authors.

    And that whoever overrides a limit has said so in a commit of their own.

    Raises:
        IntegrityError: As `require_registered_first`, `require_makers_known`,
            `require_author_of_brought` and `require_said_by_themselves`.
        BadInputError: The draft is missing or malformed.
        ConfigError: A malformed allow-list.
    """
    require_registered_first(root)
    draft, allowed = read_draft(root), load_allow_list(root)
    require_makers_known(root, draft.authors, allowed)
    require_author_of_brought(root, draft.candidate, draft.authors, allowed)
    require_said_by_themselves(root, allowed)


def require_registered_first(root: Path) -> None:
    """Require that the plan was committed before the evidence that it is held against.

    Of the plan counts what the gate of the evidence and those below it judge by: a limit of Gate D
    may be planned after the audit, and not after the first rollout. Evidence is dated by the
    commits that brought its hash into the lock file, the oldest of them included: who has seen
    these bytes once has seen them, and the same run gives the same bytes.

    Raises:
        IntegrityError: No git history or not all of it, the plan or the evidence is not committed,
            or the plan is no older than the evidence of a stage.
    """
    _require_whole(root)
    if git(root, "diff", "--quiet", "HEAD", "--", PREREGISTRATION) is None:
        _refuse(PREREGISTRATION, "not committed as it lies here", "committed before the evidence")
    digests, versions = evidence_digests(root), _versions(root)
    if not versions:
        _refuse(PREREGISTRATION, "not committed", "committed before the evidence")
    after = {gate: _after(root, versions, gate) for gate in RUNGS}
    for stage, gate in MEASURED.items():
        evidence, digest = f"artifacts/{stage}", digests.get(stage)
        brought = commits_of(root, digest) if digest else set()
        if not brought:
            _refuse(f"{LOCK}: {evidence}", "not committed", "committed after the plan")
        if not brought <= after[gate]:
            text = f"no older than {evidence}"
            _refuse(f"{PREREGISTRATION}, what gate {gate} judges by", text, "committed before it")


def require_makers_known(root: Path, authors: Sequence[str], allowed: AllowList) -> None:
    """Require that nobody but the authors committed to what makes the candidate.

    Since an address belongs to one person of the list, and authors sign nothing, nobody who signs
    has made it, as reviewer or as owner.

    Args:
        root: Repository root.
        authors: Identifiers that the card names.
        allowed: The allow-list; everybody on it needs an address, so that none of theirs can stand
            under the name of an author.

    Raises:
        IntegrityError: No git history or not all of it, a file of the candidate that is not
            committed, somebody on the list without an address, or a commit by another than the
            authors.
    """
    _require_whole(root)
    for person in allowed.people:
        if not person.emails:
            found = "without addresses"
            _refuse(f"{ALLOW_LIST}: {person.id}", found, "those of their commits", NAME_ALL)
    changed = git(root, "status", "--porcelain", "--untracked-files=all", "--", *CANDIDATE)
    committed = git(root, "log", f"--format={MAKERS}", "--", *CANDIDATE)
    if changed or not committed:
        name = str(changed).splitlines()[0].split(maxsplit=1)[-1] if changed else "the candidate"
        _refuse(name, "not committed as it lies here", "a commit that says who made it")
    for mail in _addresses(str(committed)):
        if who := _no_author(mail, authors, allowed):
            found = f"by {who}, who committed as {mail or 'nobody: the address is empty'}"
            expected = f"commits of its authors alone ({', '.join(authors) or 'none is named'})"
            _refuse("the candidate", found, expected, NAME_ALL)


def require_author_of_brought(
    root: Path, candidate: str, authors: Sequence[str], allowed: AllowList
) -> None:
    """Require that whoever made a candidate that was brought is named among its authors.

    No commit of this repository says who made it; its entry does.

    Args:
        root: Repository root.
        candidate: Who is promoted.
        authors: Identifiers that the card names.
        allowed: The allow-list.

    Raises:
        IntegrityError: The author of its entry is nobody on the list, or no author of the card.
    """
    mail = made_by(root).get(candidate)
    if mail is None:
        return
    if who := _no_author(mail, authors, allowed):
        found = f"by {who}, whom its entry names as {mail}"
        expected = f"one of the authors of the card ({', '.join(authors) or 'none is named'})"
        _refuse(f"the candidate {candidate}", found, expected, NAME_ALL)


def require_said_by_themselves(root: Path, allowed: AllowList) -> None:
    """Require that each exception to a limit was committed by the person whom it names.

    By the author of the commits alone: whom a trailer names as having helped has not said so.
    Every commit counts that ever brought it, so that nobody revives what was withdrawn.

    Args:
        root: Repository root.
        allowed: The allow-list; everybody on it needs an address.

    Raises:
        IntegrityError: No git history or not all of it, exceptions that are not committed, or one
            that was brought by somebody else.
        ConfigError: The file is malformed.
    """
    path = root / OVERRIDES
    entries = entries_of(sha256_bytes_of(path, keep=True)[1]) if path.is_file() else ()
    if not entries:
        return
    _require_whole(root)
    if git(root, "diff", "--quiet", "HEAD", "--", OVERRIDES) is None:
        _refuse(OVERRIDES, "not committed as it lies here", "committed by whom it names", SAY_SO)
    for entry, commits in brought_by(root, entries):
        person = allowed.find(entry.by)
        own = person.mails if person else frozenset()
        mails = [(git(root, "log", "-1", "--format=%ae", one) or "").casefold() for one in commits]
        if not commits or not own.issuperset(mails):
            others = ", ".join(mail or "nobody" for mail in sorted({*mails} - own))
            found = f"committed by {others}" if commits else "in no commit"
            _refuse(placed(entry), found, f"a commit of {entry.by}, whom it names", SAY_SO)


def brought_by(root: Path, entries: Sequence[Override]) -> list[tuple[Override, list[str]]]:
    """Each exception with all commits that ever brought it as it stands, the newest first.

    A merge brings what none of its parents holds, and what one of them withdrew: an exception that
    one side had taken out and the other keeps is said by whoever decided between them.
    """
    listed = git(root, "log", "--full-history", "-m", "--format=%H %P", "--", OVERRIDES) or ""
    commits = [line.split() for line in dict.fromkeys(listed.splitlines())]
    known = {commit: _exceptions_at(root, commit) for commit in {*chain(*commits)}}
    changed = [commit for commit, *_ in commits]
    behind = {
        parent: {*(git(root, "log", *FULL, parent, "--", OVERRIDES) or "").split()}
        for _, *parents in commits
        if len(parents) > 1
        for parent in parents
    }

    def brings(entry: Override, commit: str, parents: Sequence[str]) -> bool:
        lacking = [parent for parent in parents if entry not in known[parent]]
        if entry not in known[commit] or len(lacking) == len(parents):
            return entry in known[commit]
        return any(entry in known[one] for at in lacking for one in changed if one in behind[at])

    return [
        (entry, [c for c, *parents in commits if brings(entry, c, parents)]) for entry in entries
    ]


def _exceptions_at(root: Path, commit: str) -> tuple[Override, ...]:
    try:
        return entries_of((git(root, "show", f"{commit}:./{OVERRIDES}") or "").encode())
    except GenpolicyError:
        return ()  # what could not be read overrode nothing


def _no_author(mail: str, authors: Sequence[str], allowed: AllowList) -> str:
    """Whose address it is, where it is none of the authors'; empty where it is.

    Args:
        mail: The address, without regard to case.
        authors: Identifiers that the card names.
        allowed: The allow-list; an address belongs to one person of it.
    """
    owner = {own.casefold(): person.id for person in allowed.people for own in person.emails}
    who = owner.get(mail, f"somebody not on {ALLOW_LIST}")
    return "" if owner.get(mail) in authors else who


def _addresses(makers: str) -> list[str]:
    """Addresses of authors, committers and co-authors, a line each; empty where one has none."""
    found = set()
    for line in filter(str.strip, makers.splitlines()):
        # In brackets, or a commit without an address would be none.
        match = re.search(r"<([^<>]*)>\s*$", line)
        role, mail = line[0], (match[1] if match else "").casefold()
        if (role, mail) != ("c", FORGE):
            found.add(mail)
    return sorted(found)


def _versions(root: Path) -> list[tuple[str, dict[str, object]]]:
    """Commits that changed the plan, the newest first, each with the plan as it left it."""
    commits = (git(root, "log", "--format=%H", "--", PREREGISTRATION) or "").split()
    found = []
    for commit in commits:
        text = git(root, "show", f"{commit}:{PREREGISTRATION}") or ""
        try:
            plan = parse_yaml(text.encode(), where=PREREGISTRATION)
        except GenpolicyError:
            plan = None  # what could not be read was another plan than the one that can
        known = plan.items() if isinstance(plan, dict) else ()
        found.append((commit, {place: value for place, value in known if isinstance(place, str)}))
    return found


def _after(root: Path, versions: Sequence[tuple[str, dict[str, object]]], gate: Gate) -> set[str]:
    """Commits behind the one that last moved what a gate, or one below it, judges by."""
    reached = GATES[: GATES.index(gate) + 1]
    parts = [{p: v for p, v in plan.items() if asked_by(p) in reached} for _, plan in versions]
    same = next((n for n, part in enumerate(parts) if part != parts[0]), len(parts))
    planned = versions[same - 1][0]
    return {*(git(root, "rev-list", "--ancestry-path", f"{planned}..HEAD") or "").split()}


def commits_of(root: Path, digest: str) -> set[str]:
    """Commits that brought a hash into the lock file or took it out, on whatever branch."""
    found = git(root, "log", *FULL, f"-S{digest}", "--", LOCK)
    return {*(found or "").split()}


def evidence_digests(root: Path) -> dict[str, str]:
    """Hash of the evidence of each stage, as the lock file records it; none where it does not."""
    lock = read_yaml(root / LOCK)
    stages = lock.get("stages") if isinstance(lock, dict) else None
    digests = {}
    for name, stage in stages.items() if isinstance(stages, dict) else ():
        for out in (stage.get("outs") or ()) if isinstance(stage, dict) else ():
            if isinstance(out, dict) and out.get("path") == f"artifacts/{name}":
                digests[name] = str(out.get("md5") or "")
    return digests


def unknown_history(root: Path) -> tuple[str, str]:
    """Why git cannot say what came first, and what it takes; both empty where it can."""
    cut = git(root, "rev-parse", "--is-shallow-repository")
    if cut is None:
        return "without git history", "one that says what was committed first, and by whom"
    if cut != "false":
        return "a shallow clone", "the whole history (`git fetch --unshallow`)"
    return "", ""


def _require_whole(root: Path) -> None:
    """Require a repository of git whose history goes back to its beginning."""
    found, expected = unknown_history(root)
    if found:
        _refuse("the repository", found, expected)


def _refuse(where: str, found: str, expected: str, action: str = PLAN_FIRST) -> None:
    raise IntegrityError(where=where, found=found, expected=expected, action=action)
