"""What one commanded number means: a place, a change per row, a rate, or nobody knows."""

from collections.abc import Iterable, Mapping
from typing import Literal

from pydantic import Field

from genpolicy.contract.settings import Settings
from genpolicy.errors import ConfigError

Form = Literal["place", "change", "rate", "unknown"]


class CommandForm(Settings):
    """How a commanded number moves what it commands.

    Attributes:
        form: `place`: it says where. `change`: it says how far in one row, `rate` how far in one
            second; both are added up from row to row. `unknown`: nothing told; it is read as
            it stands.
        gain: Of a place, its unit in that of what it commands. Of a change or a rate, how far one
            of it moves that in one row (of a rate in 1/s at 10 Hz: 0.1). Dataset units.
        offset: What a place of 0 commands, for normalised places.
    """

    form: Form = "place"
    gain: float = Field(default=1.0)
    offset: float = 0.0

    @property
    def is_plain(self) -> bool:
        """A place in the unit of what it commands."""
        return self.form == "place" and self.gain == 1.0 and self.offset == 0.0


def check_commands(
    pairing: Mapping[str, str] | None,
    forms: Mapping[str, CommandForm],
    *,
    units: Mapping[str, str],
    observed: Mapping[str, str],
    where: str,
) -> None:
    """Pairs are one to one, and plain places have the unit of what they command.

    Args:
        pairing: Component of the action to the observed number; None for none.
        forms: Forms by component; what is absent is a plain place.
        units: Unit of each component of the action, in the dataset.
        observed: Unit of each observed number that may be commanded.
        where: What errors call the contract.

    Raises:
        ConfigError: A name that does not exist, a number twice, two units, or a gain of 0.
    """
    for name, form in forms.items():
        if name not in units:
            _refuse(f"{where}: forms", repr(name), f"one of {_few(units)}")
        if form.gain == 0.0:
            _refuse(f"{where}: forms.{name}.gain", "0", "a gain that moves something")
    if pairing is None:
        return
    place = f"{where}: pairing"
    if not pairing or len(set(pairing.values())) != len(pairing):
        _refuse(place, "empty, or one observed number twice", "one to one; null for no pairing")
    for commanded, seen in pairing.items():
        if commanded not in units or seen not in observed:
            _refuse(place, f"{commanded!r}: {seen!r}", "names of the action and the observation")
        form = forms.get(commanded, CommandForm())
        if form.is_plain and units[commanded] != observed[seen]:
            found = f"{commanded} in {units[commanded]} with {seen} in {observed[seen]}"
            _refuse(place, found, "one unit on both sides, or a form with its gain")


def _few(names: Iterable[str]) -> str:
    return ", ".join(list(names)[:12])


def _refuse(where: str, found: str, expected: str) -> None:
    raise ConfigError(
        where=where,
        found=found,
        expected=expected,
        action="Correct the contract, or let `genpolicy propose` write a new one.",
    )
