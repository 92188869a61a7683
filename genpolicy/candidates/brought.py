"""Policies that somebody brings to the ladder: which entry is whose, and how one is asked.

A brought policy is its entry: what the entry says, and the files that it names by hash. Both are
looked at before anything trains, and the files again each time that its server is started.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import RootModel

from genpolicy.candidates.hosts.forms import require_forms
from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.wire.entry import Entry, ServerEntry, verify_files
from genpolicy.candidates.wire.launched import require_program
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes


class BroughtSection(RootModel[dict[str, str]]):
    """Section `candidates`: path of each entry, from the root of the workspace, by name."""


@dataclass(frozen=True)
class BroughtPolicy:
    """One policy that is measured, compared or promoted, and was not trained here.

    Attributes:
        name: Its name in every table.
        path: Its entry.
        entry: What the entry says.
        sha256: Of what it says, the hashes of its files among it: the identity in every journal.
        seed: Number of the training seed under which it stands in tables, that which is promoted.
    """

    name: str
    path: Path
    entry: Entry
    sha256: str
    seed: int

    @property
    def folder(self) -> Path:
        """Where its files lie, and where its command runs."""
        return self.path.resolve().parent

    @property
    def sampler_sha256(self) -> str:
        """Of what it says of its sampler."""
        said = self.entry.declared.model_dump(mode="json") if self.entry.declared else {}
        sampler = {
            name: said.get(name) for name in ("sampler", "sampler_steps", "eta", "tolerance")
        }
        return sha256_bytes(canonical_json({"entry": self.sha256, **sampler}))

    def sampler_sha256_of(self, name: str | None) -> str:
        """The same of another setting of its entry; of None, of the judged one."""
        if name is None:
            return self.sampler_sha256
        said = self.entry.samplers[name].model_dump(mode="json")
        return sha256_bytes(canonical_json({"entry": self.sha256, "name": name, **said}))


def read_brought(
    section: Mapping[str, str], *, seed: int, root: Path = Path()
) -> list[BroughtPolicy]:
    """The policies of a section, by name; nothing is started and no file of theirs is read.

    Args:
        section: Path of each entry by name.
        seed: Number of the training seed that is promoted.
        root: Of the workspace.

    Raises:
        ConfigError: An entry that cannot be read, or that has another name.
    """
    return [_read(name, root / path, seed) for name, path in sorted(section.items())]


def require_brought(
    section: Mapping[str, str],
    *,
    horizons: HorizonConfig,
    trained: Iterable[str] = (),
    root: Path = Path(),
) -> list[BroughtPolicy]:
    """The same, of the names, horizons, files and programs that the ladder can work with.

    Nothing of theirs is run.

    Args:
        section: Path of each entry by name.
        horizons: Of the ladder.
        trained: Methods that the ladder trains; a name means one policy.
        root: Of the workspace.

    Raises:
        ConfigError: As `read_brought`; a name of a trained method, other horizons, a
            file of another form than its kind needs, or nothing on this machine that runs it.
        IntegrityError: A file that is missing, or another one than its entry says.
    """
    found, taken = read_brought(section, seed=0, root=root), set(trained)
    for policy in found:
        if policy.name in taken:
            raise ConfigError(
                where=f"params.yaml: candidates.{policy.name}",
                found="a name that a trained method has",
                expected="another one: rows of the two could not be told apart",
                action=f"Give it another name, here and in {policy.path}.",
            )
        require_horizons(policy.entry, policy.path, horizons)
        verify_files(policy.entry, policy.folder)
        policy.entry.require_host()
        require_forms(policy.entry, policy.folder)
        if isinstance(policy.entry, ServerEntry):
            require_program(policy.entry, policy.folder)
    return found


def require_horizons(entry: Entry, path: Path, horizons: HorizonConfig) -> None:
    """Refuse an entry of other horizons than the ladder has.

    Raises:
        ConfigError: It has others.
    """
    if entry.horizons != horizons:
        raise ConfigError(
            where=f"{path}: horizons",
            found=_said(entry.horizons),
            expected=f"{_said(horizons)}, as in params.yaml",
            action="Bring a policy of these horizons, or set the horizons of the ladder.",
        )


def _read(name: str, path: Path, seed: int) -> BroughtPolicy:
    entry = read_entry(path)
    if entry.name != name:
        raise ConfigError(
            where=f"params.yaml: candidates.{name}",
            found=f"{path}, the entry of {entry.name}",
            expected=f"the entry of {name}",
            action="Give both the same name.",
        )
    return BroughtPolicy(name, path, entry, entry.sha256, seed)


def _said(horizons: HorizonConfig) -> str:
    return ", ".join(f"{name} {value}" for name, value in horizons.model_dump().items())
