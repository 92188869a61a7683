"""Which tests are left out, and which files begin first of several processes that take one each.

Tests marked `long` take minutes and look at the whole of what others look at in parts: they run
where the environment says LONG (`make long`), and are counted as deselected elsewhere.

A process that has nothing left waits for the one that took a long file last. So the long ones come
first. The first of them builds the ladder that the others of its folder copy; those before the next
of its folder need none, so that nobody waits while it is built.
"""

from pathlib import Path
from typing import Protocol, TypeVar

TESTS = Path(__file__).parent
LONG = "LONG"
FIRST = (
    "ladder/test_repro.py",
    "wall_clock/test_run.py",
    "gates/test_criteria.py",
    "gates/test_commands_of_a_ladder.py",
    "gates/test_bad_documents.py",
    "stages/test_only_the_admitted_run.py",
    "flows/test_ladder.py",
    "audit/test_written.py",
    "candidates/exports/test_unrolled.py",
    "candidates/hosts/test_loadable.py",
    "stages/test_gate_stages.py",
    "stages/test_outputs.py",
    "cli/test_recorded.py",
    "feasibility/test_dense.py",
    "contracts/test_dead_code.py",
    "execution/test_soak.py",
    "wall_clock/test_proxy.py",
    "audit/test_run.py",
    "audit/semantics/test_brought.py",
    "audit/test_columns.py",
    "audit/test_looks.py",
    "gates/test_rederive_shadow.py",
    "wall_clock/test_clocks.py",
    "audit/test_predictability.py",
    "ladder/test_whole_way.py",
    "ladder/test_kills.py",
    "ladder/test_who_failed_stays_out.py",
    "ladder/test_refusals.py",
    "ladder/test_bundle.py",
    "ladder/test_truth.py",
    "ladder/test_settings.py",
)
"""Files of half a minute and more, and those of the ladder; those that need none go on while it is
built, and are longer than that takes."""


class Item(Protocol):
    """What is asked of a test."""

    path: Path

    def get_closest_marker(self, name: str) -> object: ...


T = TypeVar("T", bound=Item)


def longest_first(items: list[T]) -> None:
    """Sort tests by their file: the long ones as listed, then the others as they were."""
    places = {TESTS / name: place for place, name in enumerate(FIRST)}
    items.sort(key=lambda item: places.get(item.path, len(places)))


def leave_out_long(items: list[T]) -> list[T]:
    """Take out those marked `long`; returns them."""
    left = [item for item in items if item.get_closest_marker("long")]
    items[:] = [item for item in items if not item.get_closest_marker("long")]
    return left
