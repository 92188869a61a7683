"""Figures: every method keeps its colour."""

from gates.pages.figures import METHODS, colours, dashes, in_order


def test_a_method_keeps_its_colour_in_every_figure():
    assert in_order(["flow", "zeta", "act", "bc", "act"]) == ["bc", "act", "flow", "zeta"]
    few, many = colours(["flow", "act"]), colours([*METHODS, "zeta", "eta"])
    assert all(many[name] == METHODS[name] for name in METHODS)
    assert few == {name: METHODS[name] for name in ("act", "flow")}
    assert len(set(colours([*METHODS, "zeta"]).values())) == len(METHODS) + 1
    assert len({str(look) for look in dashes(["act", "flow", "cvae"]).values()}) == 3
