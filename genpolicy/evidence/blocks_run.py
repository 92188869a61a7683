"""What stage `stress` says of the blocks that it ran, made from its rows alone.

The gate and the proof make it again by the same function, and hold it against what lies there.
"""

from collections.abc import Mapping

from genpolicy.evidence.documents.stress import Blocks
from genpolicy.statistics.planned_blocks import Rule
from genpolicy.statistics.possible import Seen, first_out


def blocks_document(rule: Rule, seen: Mapping[str, Seen]) -> Blocks:
    """Which block was the last of each method, and why; content of `blocks.json`.

    Args:
        rule: What is planned.
        seen: Rollouts by method.

    Returns:
        Of a method whose starts end with no block, 0 stands for the number of its last one.
    """
    candidates = [name for name in seen if name not in rule.simple]
    found = {name: first_out(rule, seen, name) for name in candidates}
    return Blocks(
        block=rule.block,
        starts=rule.starts,
        last={name: rule.number(own.starts) or 0 for name, own in seen.items()},
        out={name: out[1].criterion for name, out in found.items() if out},
    )
