import numpy as np
import pytest

from genpolicy.candidates.hosts.scripted import scripted_function
from genpolicy.errors import ConfigError, ContractError
from tests.candidates.hosts.conftest import PLANNER


def loaded(source, path="planner.py", name="plan"):
    return scripted_function(source.encode(), path=str(path), name=name)


def test_a_function_is_called_with_the_named_inputs():
    found = loaded(PLANNER)({"observation": np.ones((2, 24))})
    assert (found == 48.0).all()


def test_what_runs_is_what_was_hashed_and_nothing_beside_it(tmp_path):
    path = tmp_path / "planner.py"
    path.write_text("raise SystemExit('the file was read again')")
    (tmp_path / "beside.py").write_text("x = 1")
    assert loaded(PLANNER, path)({"observation": np.zeros(1)}).shape == (16, 10)
    assert not (tmp_path / "__pycache__").exists()
    with pytest.raises(ConfigError, match="No module named 'beside'"):
        loaded("import beside", path)


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("def plan(:", "SyntaxError"),
        ("1 / 0", "ZeroDivisionError"),
        ("plan = 3", "without the function plan"),
        ("", "without the function plan"),
    ],
)
def test_a_module_that_is_none_is_refused_at_the_start(source, found):
    with pytest.raises(ConfigError) as error:
        loaded(source)
    assert found in error.value.found


@pytest.mark.parametrize("answer", ["'go'", "None", "[['a']]"])
def test_an_answer_that_is_no_array_is_refused(answer):
    with pytest.raises(ContractError, match="the answer of plan"):
        loaded(f"def plan(given):\n    return {answer}")({})
