"""Blocks of Gate D's starts asked again: each method ran as far as its own rows say it had to.

The rows are held against the journals before; here nothing is believed but them and the plan.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gates.protection import is_rehearsal
from gates.report import stage_of
from gates.settings import Limits, read_settings
from gates.stated import compare_keys, mapping, refuse
from gates.stress.rollouts import ROLLED, STRESS, StressSettings
from genpolicy.errors import ContractError
from genpolicy.evidence.blocks_run import blocks_document
from genpolicy.evidence.documents.stress import BLOCKS
from genpolicy.evidence.rows.stress import RolloutRow
from genpolicy.integrity.documents import read_json
from genpolicy.integrity.rows import read_rows
from genpolicy.statistics.planned_blocks import Rule
from genpolicy.statistics.possible import Seen, due, seen_of


def rederive_blocks(root: Path, params: Mapping[str, Any], further: Sequence[str] = ()) -> None:
    """Hold `blocks.json`, and how many starts each method ran, against the rows.

    Args:
        root: Root of the workspace.
        params: `params.yaml`.
        further: Folders of further trainings, of which each method ran as far as the first.

    Raises:
        RefusedError: A method ran fewer starts, or more, than the rule gives; the document says
            otherwise, or is there without blocks.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A table is no regular file, or has not the columns of its row.
        BadInputError: A file cannot be read.
    """
    path = root / STRESS / BLOCKS.file
    stated = mapping(read_json(path)) if path.is_file() else {}
    rule = _rule(params)
    if rule is None:
        compare_keys("D", f"{STRESS}/{BLOCKS.file}", stated, {}, "all starts are one block")
        return
    seen = _seen(root, STRESS, rule)
    wanted = _wanted(rule, seen)
    for method, starts in wanted.items():
        _require(STRESS, method, seen, starts, f"{starts}, by the rows of the comparison")
    expected = BLOCKS.plain(blocks_document(rule, seen))
    compare_keys("D", f"{STRESS}/{BLOCKS.file}", stated, expected, "by the rows")
    for folder in further:
        own = _seen(root, folder, rule)
        for method in own:
            starts = wanted.get(method, 0)
            _require(folder, method, own, starts, f"{starts}, as with the first training")


def _rule(params: Mapping[str, Any]) -> Rule | None:
    """What the settings of the gate say; of limits nothing but whether they bind."""
    settings = read_settings(params, stage_of("D"), StressSettings)
    return settings.under(Limits(rehearsed=is_rehearsal(params))).rule


def _seen(root: Path, folder: str, rule: Rule) -> dict[str, Seen]:
    try:
        return seen_of(read_rows(root / folder / ROLLED, RolloutRow), rule)
    except ContractError as error:
        refuse("D", f"{folder}: {error.where}", error.found, error.expected)


def _wanted(rule: Rule, seen: Mapping[str, Seen]) -> dict[str, int]:
    return due(rule, seen, [name for name in seen if name not in rule.simple])


def _require(folder: str, method: str, seen: Mapping[str, Seen], starts: int, limit: str) -> None:
    found = seen[method].starts if method in seen else 0
    if found != starts:
        refuse("D", f"{folder}: starts of {method}", str(found), limit)
