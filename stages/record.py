"""Stage `record`: scripted operators demonstrate the task; every episode becomes one MCAP file."""

from pydantic import Field

from genpolicy.contract.settings import Settings
from genpolicy.integrity.atomic import output_folder, write_bytes
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_tree
from genpolicy.tasks.demonstrations import record_session
from stages._source import INDEX_FILE, SourceSection
from stages._stage import ARTIFACTS, Params, main


class RecordSection(Settings):
    """Section `record`.

    Attributes:
        episodes: How many demonstrations.
        shares: Share of each kind of episode; the rest is the task's plain success.
    """

    episodes: int = Field(ge=1, le=100_000)
    shares: dict[str, float]


def work(params: Params) -> None:
    """Record the session and its index; nothing where the recordings are one's own."""
    section = params.section("record", RecordSection)
    embedded = params.section("source", SourceSection).kind == "embedded"
    with output_folder(ARTIFACTS / "record") as folder:
        episodes = folder / "episodes"
        episodes.mkdir()
        if embedded:
            record_session(
                params.task.name,
                root_seed=params.seed,
                episodes=section.episodes,
                shares=section.shares,
                folder=episodes,
                workers=params.compute.workers,
                scheduler=params.compute.scheduler,
            )
        index = {"task": params.task.name, "files": sha256_tree(episodes)}
        write_bytes(folder / INDEX_FILE, canonical_json(index))


if __name__ == "__main__":
    main("record", work)
