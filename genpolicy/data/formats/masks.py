"""Masks of a robomimic file: lists of demonstrations under a name, `mask/<name>`.

Some say who demonstrated, some how the file is split for training; any other says something of its
demonstrations that a person found worth a name, and is asked as a reason.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import h5py

from genpolicy.data.formats.hdf5_single import check_storage, member

OPERATOR = re.compile(r".*operator[_ ]?\w*")
SPLITS = re.compile(r"all|train|valid|validation|val|test|\d+(_(percent|demos?))?(_(train|valid))?")
HELD_OUT = re.compile(r"(.+)_(train|valid)")
"""Who splits a file for training writes these; `better_train` is `better` without the held out."""
IN, OUT = "1", "0"
Members = Mapping[str, set[str]]


def read_masks(masks: Any, where: str, notes: list[str]) -> dict[str, set[str]]:
    """Demonstrations by the name of the mask; what is no list of names is a note.

    Args:
        masks: The group of the masks.
        where: What texts call it.
        notes: Gets a sentence for what is not read.

    Raises:
        ContractError: A mask reaches out of the file.
    """
    result: dict[str, set[str]] = {}
    strange: list[str] = []
    for name in sorted(masks):
        data = member(masks, name, where)
        plain = isinstance(data, h5py.Dataset) and data.ndim == 1 and data.dtype.kind in "SO"
        if not plain:
            strange.append(name)
            continue
        check_storage(data, f"{where}/{name}")
        result[name] = {v.decode("utf-8", "replace") for v in data[...] if isinstance(v, bytes)}
    if strange:
        notes.append(f"Not read of the masks: {', '.join(strange)} (no list of demonstrations).")
    return result


def say(
    masks: Members, demos: Sequence[str], notes: list[str]
) -> tuple[dict[str, str], dict[str, dict[str, str]]]:
    """What masks say of each demonstration.

    Args:
        masks: Demonstrations by the name of the mask.
        demos: Every demonstration of the file.
        notes: Gets a sentence for what is left out.

    Returns:
        Operator by demonstration, where masks named after operators share all of them out; and by
        demonstration whether it is in each mask that is neither an operator's nor a split.
    """
    known = set(demos)
    unknown = {name for members in masks.values() for name in members} - known
    if unknown:
        notes.append(f"Masks name {len(unknown)} demonstrations that are not there.")
    operators: dict[str, str] = {}
    for name in sorted(filter(OPERATOR.fullmatch, masks)):
        operators |= dict.fromkeys(sorted(masks[name] & known), name)
    operators = operators if set(operators) == known else {}
    splits = [name for name in sorted(masks) if _is_split(name, masks)]
    if splits:
        notes.append(f"Masks not looked at as a reason, splits for training: {', '.join(splits)}.")
    asked = [
        name
        for name in sorted(masks)
        if name not in splits and not (operators and OPERATOR.fullmatch(name))
    ]
    said = {
        demo: {f"mask/{name}": IN if demo in masks[name] else OUT for name in asked}
        for demo in demos
    }
    return operators, said if asked else {}


def _is_split(name: str, masks: Members) -> bool:
    half = HELD_OUT.fullmatch(name)
    return SPLITS.fullmatch(name) is not None or (half is not None and half[1] in masks)
