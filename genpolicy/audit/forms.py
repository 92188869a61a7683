"""Commands in the form of places: a change or a rate is added up from where the episode begins.

What an action does is a path, whatever it is written as. A chunk of changes begins where it stood
when it was sent, so that the same recording gives the same chunks in every form; what nothing
observed answers is added up from 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from genpolicy.audit.settings import AuditSettings
from genpolicy.errors import ContractError

if TYPE_CHECKING:
    from genpolicy.audit.data import AuditInput

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

ADDED_UP = ("change", "rate")


@dataclass(frozen=True)
class Forms:
    """How each number of the action moves what it commands. Arrays of shape (D_a,).

    Attributes:
        added: A change or a rate: it is added up.
        gain: Motion per unit of the command, and per row where it is added up.
        offset: What a place of 0 commands.
        partner: Observed number that it moves; -1 for none.
    """

    added: Flags
    gain: Array
    offset: Array
    partner: Integers


def forms_of(
    settings: AuditSettings, components: Sequence[str], partners: dict[str, int]
) -> Forms | None:
    """The forms that the settings name; None where every number is a plain place.

    Args:
        settings: Forms, gains and offsets by component of the action.
        components: Names of the action's numbers.
        partners: Column of the observation that a component moves.

    Raises:
        ContractError: A component that does not exist.
    """
    named = {*settings.action_forms, *settings.action_gains, *settings.action_offsets}
    unknown = sorted(named - set(components))
    if unknown:
        raise ContractError(
            where="params: audit.action_forms",
            found=f"naming the component {unknown[0]}",
            expected=f"one of {', '.join(components)}",
            action="Name components of the dataset's action contract.",
        )
    added = [settings.action_forms.get(name, "place") in ADDED_UP for name in components]
    gain = [settings.action_gains.get(name, 1.0) for name in components]
    offset = [settings.action_offsets.get(name, 0.0) for name in components]
    if not any(added) and all(g == 1.0 for g in gain) and not any(offset):
        return None
    return Forms(
        added=np.array(added, dtype=bool),
        gain=np.array(gain, dtype=np.float64),
        offset=np.array(offset, dtype=np.float64),
        partner=np.array([partners.get(name, -1) for name in components], dtype=np.int64),
    )


def in_place(action: Array, observation: Array, episode: Integers, forms: Forms) -> Array:
    """The action with every number as a place.

    Args:
        action: As recorded. Shape (N, D_a).
        observation: Shape (N, D_o).
        episode: Episode of each row; the rows of one stand together, in order. Shape (N,).
        forms: What the numbers mean.

    Returns:
        Places; of a change, where it has come to at the end of its row. Shape (N, D_a).
    """
    moved = action * forms.gain + np.where(forms.added, 0.0, forms.offset)
    if not forms.added.any() or not len(action):
        return np.asarray(moved)
    first = _first_rows(episode)
    steps = moved[:, forms.added]
    # Summed within episodes, so that no sum carries the rounding of all those before.
    total = np.concatenate([np.cumsum(part, axis=0) for part in np.split(steps, np.unique(first))])
    moved[:, forms.added] = total + _begins(observation, first, forms.partner[forms.added])
    return np.asarray(moved)


def before(data: "AuditInput", columns: Integers, rows: Integers) -> Array:
    """Where the added-up numbers stood before the commands of `rows`. Shape (n, columns)."""
    forms = data.forms
    if forms is None:
        return np.zeros((len(rows), len(columns)))
    placed = data.placed[np.ix_(rows, columns)]
    return np.asarray(placed - data.action[np.ix_(rows, columns)] * forms.gain[columns])


def _first_rows(episode: Integers) -> Integers:
    """First row of the episode of each row. Shape (N,)."""
    begins = np.flatnonzero(np.diff(episode, prepend=episode[0] - 1))
    lengths = np.diff(np.append(begins, len(episode)))
    return np.asarray(np.repeat(begins, lengths), dtype=np.int64)


def _begins(observation: Array, first: Integers, partners: Integers) -> Array:
    """Where each number begins in its episode: as observed, or at 0. Shape (N, columns)."""
    known = np.where(partners >= 0, partners, 0)
    seen = observation[np.ix_(first, known)]
    return np.where(partners >= 0, seen, 0.0)
