"""Every definition is read by a line of the product: code that only its tests know is none."""

import sys
from functools import cache
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from dead_code import PRODUCT, Tree, parse, tree

# Definition: why nothing of ours reads it. An entry that is read, or gone, is an error too.
YAML = "PyYAML calls it of every loader or dumper"
IMPORTS = "Python's import system asks a loader for it"
ALLOWED: dict[str, str] = {
    "genpolicy.candidates.hosts.scripted:_Pinned.get_data": IMPORTS,
    "genpolicy.candidates.hosts.scripted:_Pinned.get_filename": IMPORTS,
    "genpolicy.cli.shell:Registered.get_command": "typer asks its groups for it",
    "genpolicy.data.formats.contract:_Dumper.ignore_aliases": YAML,
    "genpolicy.data.formats.contract:_Dumper.represent_mapping": YAML,
    "genpolicy.data.formats.contract:_Dumper.represent_sequence": YAML,
    "genpolicy.execution.recovery:Recovery.human_resolved": (
        "the way out of `ask_human`: a person's, so nothing of ours may take it"
    ),
    "genpolicy.compiled:HashedFolder.get_cache_path": ("numba asks its locators for it"),
    "genpolicy.integrity.documents:_QuickLoader.get_single_node": YAML,
    "genpolicy.integrity.documents:_StrictLoader.compose_node": YAML,
    "genpolicy.integrity.documents:_UniqueKeys.construct_mapping": YAML,
    "genpolicy.robot.collision:CollisionModel.in_collision": (
        "for the worlds of tasks outside the tree; the one of the tests asks it at every tick"
    ),
}


@cache
def product() -> Tree:
    return tree()


def dead(
    *points: str, templates: str = "", kept: tuple[str, ...] = (), **sources: str
) -> list[str]:
    """What nothing reads in modules `p.name`, begun at some points."""
    modules = {f"p.{name}": parse(source) for name, source in sources.items()}
    return Tree(modules, frozenset(templates.split()), points).dead(kept)


def test_every_definition_is_read_by_the_product() -> None:
    assert product().dead(ALLOWED) == [], "wire it, remove it, or allow it with a reason"


def test_every_allowed_definition_is_still_there_and_still_not_read() -> None:
    assert sorted(set(ALLOWED) - set(product().dead())) == []
    assert all(reason.strip() for reason in ALLOWED.values())


def test_the_benchmarks_are_no_users() -> None:
    assert "benchmarks" not in PRODUCT
    assert not any(name.startswith("benchmarks") for name in product().modules)


def test_a_definition_planted_in_the_product_is_found() -> None:
    """Its name is read in other modules, as that of a method, a constant and a local variable."""
    planted = parse("class Ahead:\n    def unheard_of(self): ...\ndef reads(left): ...\nleft = 1")
    grown = Tree({**product().modules, "gates.planted": planted}, product().templates,
                 product().points)  # fmt: skip
    assert set(grown.dead(ALLOWED)) == {
        "gates.planted:Ahead", "gates.planted:Ahead.unheard_of", "gates.planted:left",
        "gates.planted:reads",
    }  # fmt: skip


@pytest.mark.parametrize(
    "source",
    [
        "def f(): ...\nf()",
        "def f(): ...\ndef g(x: 'f | None'): ...\ng(0)",
        "f: int = 1\nprint(f)",
        "f, g = 1, 2\nprint(f, g)",
        "class f:\n    def m(self): ...\nprint(f().m)",
        "class f:\n    @model_validator(mode='after')\n    def m(self): ...\nprint(f)",
        "@app.command()\ndef f(): ...",
        "def f(): ...\nregister(f'{__name__}:f')",
    ],
)
def test_read_in_its_own_module(source: str) -> None:
    assert dead(a=source) == []


@pytest.mark.parametrize(
    "reader",
    [
        "from p.a import f\nf()",
        "from p.a import f as g\ng()",
        "from p import a\na.f()",
        "import p.a\np.a.f()",
        "import p.a as b\nb.f()",
        "def _g():\n    from p.a import f\n    return f()\n_g()",
        "def _g():\n    from p.a import f\n    return lambda: f()\n_g()",
        "start('p.a:f')",
        "module = import_module('p.a')\nmodule.f()",
    ],
)
def test_read_from_another_module(reader: str) -> None:
    assert dead(a="def f(): ...", b=reader) == []
    assert dead(a="def f(): ...") == ["p.a:f"]


def test_read_through_a_package_and_from_outside() -> None:
    package = "from p.a import f\n__all__ = ['f']"
    assert dead(a="def f(): ...", face=package) == ["p.a:f"]
    assert dead(a="def f(): ...", face=package, b="from p.face import f\nf()") == []
    assert dead("p.face:f", a="def f(): ...", face=package) == []
    assert dead(a="def f(): ...", face="from p.face import f\nf()") == ["p.a:f"]  # from itself


@pytest.mark.parametrize(
    "other",
    [
        "f = 1\nprint(f)",  # a definition of its own
        "def _g(f):\n    return f\n_g(f=1)",  # a parameter and a keyword
        "def _g():\n    f = 1\n    return f\n_g()",  # a local variable
        "print(x.f)",  # an attribute of an object
        "print('f')",  # a word
        "from q import f\nprint(f)",  # another library's
        "import numpy as np\nprint(np.f)",
        "from p.a import f",  # imported, and not read
    ],
)
def test_the_same_name_of_something_else_is_no_read(other: str) -> None:
    assert dead(a="def f(): ...", b=other) == ["p.a:f"]


def test_a_local_variable_hides_a_definition_of_its_module() -> None:
    assert dead(a="left = 1\ndef _g(left):\n    return left\n_g(0)") == ["p.a:left"]


def test_code_that_only_dead_code_reads_is_dead() -> None:
    assert dead(a="def f(): f()") == ["p.a:f"]
    both = "def f(): g()\ndef g(): f()\nLIMIT = 1\nclass C:\n    def m(self): return LIMIT"
    assert dead(a=both) == ["p.a:C", "p.a:C.m", "p.a:LIMIT", "p.a:f", "p.a:g"]
    assert dead(a=both, kept=("p.a:f", "p.a:C", "p.a:C.m")) == []


METHOD = "class C:\n    def m(self): ...\nC()"


@pytest.mark.parametrize("other", ["x.m()", "print(C.m)", "def _g(x: 'C'): x.m\n_g(0)"])
def test_a_method_is_read_as_an_attribute(other: str) -> None:
    assert dead(a=METHOD, b=other) == []
    assert dead(a=METHOD, templates="m") == []


@pytest.mark.parametrize(
    "other",
    [
        "m = 1\nprint(m)",  # a variable
        "print(m=1)",  # a keyword
        "print('m')",  # a word
        "x.m = 1",  # written, not read
        "import numpy as np\nnp.m()",  # a function of a library
        "import numpy as np\nnp.linalg.m()",
        "from pathlib import Path\nPath.m()",
        "class D:\n    def m(self): self.inner.m()\nD()",  # hands on to its like
    ],
)
def test_a_method_is_not_read_by_a_name_of_another_kind(other: str) -> None:
    assert "p.a:C.m" in dead(a=METHOD, b=other)
