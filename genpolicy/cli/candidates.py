"""`genpolicy check-candidate`: somebody's policy in a process of its own, and what is found."""

import json
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path

from genpolicy.candidates.brought import require_horizons
from genpolicy.candidates.conformance.check import Conformance, Question, check, question
from genpolicy.candidates.conformance.finding import Finding
from genpolicy.candidates.conformance.findings import Admissible
from genpolicy.candidates.conformance.recorded_starts import (
    RecordedStarts,
    recorded_starts,
    require_contract,
)
from genpolicy.candidates.conformance.stated import DatasetHashes, stated
from genpolicy.candidates.hosts.kinds import TrainedEntry, read_entry
from genpolicy.candidates.hosts.loadable import require_loadable
from genpolicy.candidates.hosts.translation import as_server
from genpolicy.candidates.mapped import require_map
from genpolicy.candidates.wire.entry import Entry, ServerEntry, verify_files
from genpolicy.candidates.wire.launched import Launched
from genpolicy.candidates.wire.remote import RemotePolicy
from genpolicy.cli.task_checks import task_checks
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.observation import ObservationContract
from genpolicy.contract.settings import parse_settings
from genpolicy.data.dataset import load_dataset
from genpolicy.errors import BadInputError
from genpolicy.evidence.split import split_sha256
from genpolicy.integrity.documents import read_json, read_yaml

REFUSED = 3
PARAMS = Path("params.yaml")
MOMENTS_SEED = 0
"""Of the moments of a check; the ladder's are drawn from its own root seed."""
NO_VERDICT = (
    "Nothing here is a gate's verdict: name the entry in params.yaml (candidates) for those."
)
ASKED_LATER = {
    "B": "asked there besides: matching or an exception, what is declared, cold and warm times",
    "C": "asked there besides: corrupted observations, what reaches the stub, both modes",
    "D": "asked there: success beside the best simple policy in every condition, and its costs",
}
"""By gate, what a check of recorded moments cannot say."""


@dataclass(frozen=True)
class CheckOptions:
    """What the user asked for.

    Attributes:
        dataset: Verified dataset whose held-out episodes are asked about.
        candidates: Chunks of an invocation.
        deadline_s: What an answer may take, s.
        earlier: Report of an earlier check, to be compared with; None for none.
    """

    dataset: Path
    candidates: int
    deadline_s: float
    earlier: Path | None = None


def run_check(path: Path, options: CheckOptions, *, as_json: bool) -> int:
    """Check a candidate; print what was found. Returns the exit code.

    Raises:
        BadInputError: The entry, the dataset or the earlier report is missing or wrong.
        IntegrityError: A file of the candidate is another one.
        PolicyError: The policy's process does not start.
    """
    entry, folder = read_entry(path), path.resolve().parent
    data = load_dataset(options.dataset)
    require_contract(data, entry.horizons, candidate=entry.name)
    contract = data.observation_contract
    _require_horizons_of_the_ladder(entry, path)
    starts = recorded_starts(data, entry.horizons, seed=MOMENTS_SEED)
    checks = task_checks(data, task=None, chunk_rows=entry.horizons.prediction_horizon)
    what = question(starts, dataset=data.manifest_sha256, candidates=options.candidates)
    earlier = _earlier(options.earlier, what)
    hashes = DatasetHashes(data.manifest_sha256, split_sha256(data.manifest))
    asked = _Asked(
        starts, what, options.deadline_s, earlier, checks.admissible, checks.scene,
        tuple(stated(entry, hashes)),
    )  # fmt: skip
    verify_files(entry, folder)
    require_map(entry, contract, checks.scene)
    if isinstance(entry, TrainedEntry):  # all that differs is more than a server's last words
        require_loadable(entry, path, contract)
    found = _found(as_server(entry, path, contract), folder, contract, asked)
    if as_json:
        print(json.dumps(found.as_json(), indent=2, sort_keys=True))
    else:
        print(_text(found, hashes))
    return REFUSED if found.failed else 0


def _require_horizons_of_the_ladder(entry: Entry, path: Path) -> None:
    """Where settings of a ladder are at hand; elsewhere nobody can tell."""
    if not PARAMS.is_file():
        return
    params = read_yaml(PARAMS)
    said = params.get("horizons") if isinstance(params, dict) else None
    if isinstance(said, dict):
        horizons = parse_settings(HorizonConfig, said, where=f"{PARAMS}: horizons")
        require_horizons(entry, path, horizons)


def _found(
    entry: ServerEntry, folder: Path, contract: ObservationContract, asked: "_Asked"
) -> Conformance:
    """Of a server that is started here, if it is to be, and ended in any case."""
    with ExitStack() as stack:
        running = stack.enter_context(Launched(entry, folder))

        def policy_of(server: Launched) -> RemotePolicy:
            policy = RemotePolicy(
                entry, server.address, contract, scene=asked.scene, ended=server.died
            )
            stack.callback(policy.close)
            return policy

        def restarted() -> RemotePolicy:
            running.end()
            return policy_of(stack.enter_context(Launched(entry, folder)))

        return check(
            policy_of(running), asked.starts, asked=asked.what, deadline_s=asked.deadline_s,
            restarted=restarted if entry.command is not None else None, earlier=asked.earlier,
            admissible=asked.admissible, said=asked.said,
        )  # fmt: skip


@dataclass(frozen=True)
class _Asked:
    starts: RecordedStarts
    what: Question
    deadline_s: float
    earlier: str | None
    admissible: Admissible | None
    scene: Path | None
    said: tuple[Finding, ...]


def _earlier(path: Path | None, now: Question) -> str | None:
    """The answers of an earlier check, if it asked the same."""
    if path is None:
        return None
    said = read_json(path)
    digest = said.get("answers_sha256") if isinstance(said, dict) else None
    before = said.get("asked") if isinstance(said, dict) else None
    if not isinstance(digest, str) or not isinstance(before, dict):
        raise BadInputError(
            where=str(path),
            found="no report of a check whose answers repeated",
            expected="what `genpolicy check-candidate --json` printed, with answers_sha256",
            action="Name the report of an earlier check.",
        )
    for name, value in asdict(now).items():
        if before.get(name) != value:
            raise BadInputError(
                where=f"{path}: asked.{name}",
                found=f"{before.get(name)!r}",
                expected=f"{value!r}, as is asked now",
                action="Check on the dataset of the earlier check, with its --candidates; answers "
                "to other questions are not to be compared.",
            )
    return digest


def _text(found: Conformance, data: DatasetHashes) -> str:
    width = max(len(finding.name) for finding in found.findings)
    lines = [
        f"{found.candidate}: {found.asked.candidates} chunks at each of {found.asked.moments} "
        f"recorded moments of {found.asked.episodes} episodes.",
        f"Serves {found.checkpoint or 'an unknown checkpoint'}; its answers are "
        f"{found.answers_sha256 or 'named by no hash (see repeats)'}.",
        f"Of who was trained on this dataset, `declared` says dataset: {data.manifest}",
        f"and split: {data.split}",
        "",
        *(
            f"{finding.judged:8}{finding.gate}  {finding.name:{width}}  {finding.said}"
            for finding in found.findings
        ),
        "",
        *(_of_gate(found, gate) for gate in ASKED_LATER),
        "",
        NO_VERDICT,
    ]
    if found.failed:
        names = ", ".join(f"{one.name} (gate {one.gate})" for one in found.failed)
        lines.append(f"Refused: {names}.")
    return "\n".join(lines)


def _of_gate(found: Conformance, gate: str) -> str:
    """What a gate will be able to say of it, as far as the findings tell."""
    said = []
    for judged, words in (("fails", "here it fails"), ("unknown", "not known is")):
        names = [one.name for one in found.findings if (one.gate, one.judged) == (gate, judged)]
        if names:
            said.append(f"{words} {', '.join(names)}")
    if not said and any(one.gate == gate for one in found.findings):
        said.append("nothing against it here")
    return f"Gate {gate}: {'; '.join([*said, ASKED_LATER[gate]])}."
