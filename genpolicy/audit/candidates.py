"""Which recorded columns are held against the modes: groups, measures, and what cannot be either.

Columns that say the same are one question, called by the most meaningful of their names. What is
another in every episode names the episode and cannot be its reason.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from genpolicy.audit.data import NOT_RECORDED, Array, AuditInput, Integers, recorded
from genpolicy.audit.parts import Columns, number_of, parts
from genpolicy.audit.variable import Values, Variable, numbered
from genpolicy.data.variables import Runs, stored

# More different numbers than this are a measure, fewer are groups.
MOST_GROUPS = 12
# Whole numbers without repetition that fill their range to two thirds are counted through.
COUNTED_THROUGH = 1.5
# A value of which fewer episodes have a second one names the episode.
SHARED = 0.5
IDENTIFIERS = {"uuid", "id", "index", "idx", "number", "seed", "hash", "name", "count", "counter"}
ENDS = re.compile(r"_?(index|idx|id|uuid|number|code)$", re.IGNORECASE)
# What the audit itself calls a variable; a column of that name is told apart.
RESERVED = {
    *("phase", "episode_order", "time_in_episode", "recording_sequence", "history"),
    *("everything_together", "recorded_columns", "every_other_episode"),
    *("previous_episodes", "previous_episodes_of_operator"),
}
LABELS = ("operator", "object", "calibration_epoch")
PREFIXES = ("mode_of_", "start_position.")
TASK, FILE, FOLDER, CALLED = "task", "file", "folder", "file name"
PLACES = (FILE, FOLDER, CALLED)
NUMBER = re.compile(r"\d+")
# In these layouts files are filled one after the other: which one an episode is in is its place.
FILLED_IN_TURN = ("lerobot",)
EVERY_EPISODE = "another value in nearly every episode: it names the episode"
COUNTED = "whole numbers, another in every episode: it counts or names the episodes"
SAME_AS_OUTCOME = "says the same as the outcome"


@dataclass(frozen=True)
class Candidates:
    """Columns of a dataset as possible reasons.

    Attributes:
        variables: Those held against the modes, in an order that rests on what they say.
        left_out: Name of each that cannot be, and why.
        phase_name: What the column of the phase is called.
    """

    variables: tuple[Variable, ...]
    left_out: tuple[tuple[str, str], ...]
    phase_name: str


def with_candidates(
    data: AuditInput, table: pd.DataFrame, manifest: Mapping[str, object]
) -> AuditInput:
    """The same data with what was recorded of its episodes; see `candidates`."""
    found = candidates(table, manifest, data)
    return replace(
        data, variables=found.variables, left_out=found.left_out, phase_name=found.phase_name
    )


def candidates(table: pd.DataFrame, manifest: Mapping[str, object], data: AuditInput) -> Candidates:
    """Every recorded column that may be why demonstrations differ.

    Args:
        table: The dataset's episodes.
        manifest: The dataset's manifest.
        data: Rows and episodes in canonical order.
    """
    place = {str(uuid): number for number, uuid in enumerate(table["episode_uuid"])}
    order = [place[str(uuid)] for uuid in data.episodes.uuid]
    found: list[Variable] = []
    left: list[tuple[str, str]] = []
    columns = _columns(table, manifest)
    for name, runs in {**parts(columns, without=PLACES), **columns}.items():
        made = _variable(name, [runs[number] for number in order], data)
        if isinstance(made, Variable):
            found.append(made)
        elif made:
            left.append((name, made))
    return _distinct(found, left, data, _recorded_name(manifest, "phase"))


def _columns(table: pd.DataFrame, manifest: Mapping[str, object]) -> Columns:
    """The stored columns, the task, and where each episode came from."""
    found = stored(table)
    if TASK in table:
        found.setdefault(_recorded_name(manifest, TASK), _whole(table[TASK].tolist()))
    if "source_file" in table and manifest.get("source_kind") not in FILLED_IN_TURN:
        files = [str(text).split("#")[0] for text in table["source_file"]]
        folders = [text.rpartition("/")[0] for text in files]
        found.setdefault(FILE, _whole(files))
        found.setdefault(FOLDER, _whole(folders))
        # `ada_003` and `ada_004` are of one collector.
        called = [NUMBER.sub("", text.rpartition("/")[2]) for text in files]
        found.setdefault(CALLED, _whole(called))
    return found


def _whole(values: Sequence[object]) -> list[Runs | None]:
    return [Runs((0,), ("" if value is None else str(value),)) for value in values]


def _variable(name: str, runs: list[Runs | None], data: AuditInput) -> Variable | str:
    """The column as a variable; why it cannot be one; "" where it is the same everywhere."""
    by_row = any(len(item.rows) > 1 for item in runs if item is not None)
    texts, counts = _expanded(runs, data)
    known = np.array([str(text).strip().lower() not in NOT_RECORDED for text in texts])
    if not known.any() or len(set(texts[known].tolist())) + (not known.all()) < 2:
        return ""
    numbers = _numbers(texts, known)
    values: Values
    if numbers is None:
        words = np.where(known, texts.astype(str), "")
        values, why = numbered(words), _names_episodes(words)
    else:
        why = COUNTED if _is_counted(name, numbers[known]) else ""
        few = len(np.unique(numbers[known])) <= MOST_GROUPS
        values = numbered(np.where(known, numbers, np.inf)) if few else numbers
    if not by_row and why:
        return "" if name in PLACES else why
    spread = values[np.repeat(np.arange(len(values)), counts)] if by_row else values
    final = spread if spread.dtype.kind == "f" else numbered(spread)
    return Variable(_called(name, data), final, by_row)


def _expanded(runs: list[Runs | None], data: AuditInput) -> tuple[NDArray[np.object_], Integers]:
    """Every value, "" where there is none, and how many rows it holds."""
    missing = Runs((0,), ("",))
    kept = [missing if item is None else item for item in runs]
    values = np.array([value for item in kept for value in item.values], dtype=object)
    lengths = np.bincount(data.episode, minlength=len(data.episodes))
    counts = [np.diff([*item.rows, n]) for item, n in zip(kept, lengths, strict=True)]
    return values, np.asarray(np.concatenate(counts), dtype=np.int64)


def _numbers(texts: NDArray[np.object_], known: NDArray[np.bool_]) -> Array | None:
    """The values as numbers, NaN where missing; None where one of them is no number or time."""
    result = np.full(len(texts), np.nan)
    for number, text in enumerate(texts.tolist()):
        if known[number]:
            value = text if isinstance(text, float) else number_of(text.strip())
            if value is None or not np.isfinite(value):
                return None
            result[number] = value
    return result


def _is_counted(name: str, numbers: Array) -> bool:
    """Whether whole numbers count or name the episodes instead of measuring them."""
    distinct = np.unique(numbers)
    if len(distinct) < len(numbers) or not np.all(distinct == np.round(distinct)):
        return False
    words = set(re.split(r"[^a-z]+", name.lower()))
    dense = distinct[-1] - distinct[0] + 1.0 <= COUNTED_THROUGH * len(distinct)
    return bool(dense or words & IDENTIFIERS)


def _names_episodes(values: NDArray[np.str_]) -> str:
    """Why text cannot be the reason, where few episodes share their value with another."""
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    return EVERY_EPISODE if np.mean(counts[place.reshape(-1)] > 1) < SHARED else ""


def _called(name: str, data: AuditInput) -> str:
    """The name, told apart from what the audit itself calls by it."""
    if name in LABELS:
        return f"{name} (column)" if recorded(getattr(data.episodes, name)) else name
    taken = name in RESERVED or name in data.observation_names or name.startswith(PREFIXES)
    return f"{name} (column)" if taken else name


def _distinct(
    found: list[Variable], left: list[tuple[str, str]], data: AuditInput, phase_name: str
) -> Candidates:
    """Columns that say the same as one; labels that the audit knows stay what they are."""
    known = {_says(_of_label(data, label)) for label in LABELS}
    outcome, phase = _says(_of_label(data, "outcome")), _says_phase(data)
    groups: dict[bytes, list[Variable]] = {}
    for item in sorted(found, key=lambda item: item.is_measure):
        says = _says(item)
        if item.is_measure and says not in groups:
            says = _orders(item)
        if says == outcome:
            left.append((item.name, SAME_AS_OUTCOME))
        elif says == phase:
            phase_name = min(item.name, phase_name, key=_meaning)
        elif says not in known:
            groups.setdefault(says, []).append(item)
    result = []
    for same in groups.values():
        # Groups say more than the same numbers as a measure.
        best = min(same, key=lambda item: (item.is_measure, _meaning(item.name)))
        names = sorted((item.name for item in same), key=_meaning)
        result.append(replace(best, name=names[0], also=tuple(names[1:])))
    result.sort(key=lambda item: item.key)
    return Candidates(tuple(result), tuple(sorted(left)), phase_name)


def _of_label(data: AuditInput, label: str) -> Variable:
    return Variable(label, numbered(getattr(data.episodes, label)))


def _says(item: Variable) -> bytes:
    """What a variable tells apart, whatever its values are called."""
    return bytes([item.by_row]) + numbered(_comparable(item.values)).tobytes()


def _orders(item: Variable) -> bytes:
    """How a measure orders episodes or rows, whatever its unit and sign."""
    ranks = [
        np.unique(sign * item.values, return_inverse=True, equal_nan=True)[1].reshape(-1)
        for sign in (1.0, -1.0)
    ]
    orders: list[bytes] = [rank.astype(np.int64).tobytes() for rank in ranks]
    return bytes([2 + item.by_row]) + min(orders)


def _says_phase(data: AuditInput) -> bytes | None:
    return None if data.phase_observed else _says(Variable("phase", numbered(data.phase), True))


def _comparable(values: Values) -> Values:
    """NaN as one value."""
    return np.where(np.isnan(values), np.inf, values) if values.dtype.kind == "f" else values


def _meaning(name: str) -> tuple[bool, bool, int, str]:
    """Words before numbers of words, recorded columns before where the file lay."""
    return name in PLACES, ENDS.search(name) is not None, len(name), name


def _recorded_name(manifest: Mapping[str, object], label: str) -> str:
    """What the recordings called a label."""
    contract = manifest.get("import_contract")
    labels = contract.get("labels") if isinstance(contract, dict) else None
    name = labels.get(label) if isinstance(labels, dict) else None
    return str(name or label)
