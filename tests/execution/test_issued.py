"""Only feasibility issues chunks; who asks need not load it, and nothing raises."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

from genpolicy.evidence.shadow.rig import Rig
from genpolicy.execution.issued import MAKER, issued_by_feasibility


class Liar:
    def verify(self):
        return None


@pytest.mark.parametrize("chunk", [None, 3, Liar(), SimpleNamespace(), Rig().chunk()])
def test_what_feasibility_did_not_make_is_not_issued(chunk):
    assert MAKER in sys.modules
    assert issued_by_feasibility(chunk) is False


def test_a_genuine_chunk_that_was_bent_is_not_issued_and_raises_nothing():
    for bent in (None, 3, object()):
        chunk = object.__new__(sys.modules[MAKER].Admitted)
        sys.modules[MAKER]._ISSUED.add(chunk)
        object.__setattr__(chunk, "projected", bent)
        assert issued_by_feasibility(chunk) is False


def test_without_the_maker_nothing_was_made():
    code = (
        "import sys; from genpolicy.execution.issued import issued_by_feasibility as ask; "
        "print(ask(object()), any('feasibility' in m for m in sys.modules))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "False"]
