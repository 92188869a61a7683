"""Which evidence is followed: neighbours, unless only the learned shows modes."""

from types import SimpleNamespace

from genpolicy.audit.sides import chosen_view


def view(kind, modes):
    return SimpleNamespace(kind=kind, modes=modes)


def test_neighbours_are_followed_unless_only_the_learned_evidence_shows_modes():
    for local, learned, followed in (
        (True, True, "local"), (True, False, "local"), (False, True, "learned"),
        (False, False, "local"),
    ):  # fmt: skip
        assert chosen_view((view("local", local), view("learned", learned))).kind == followed
