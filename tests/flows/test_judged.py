"""What a gate stage has judged, read from its report."""

from pathlib import Path

import pytest

from flows.judged import judged
from genpolicy.errors import BadInputError


@pytest.mark.parametrize("text", ["{}", "[]", '{"verdict": 1}'])
def test_a_gate_without_a_verdict_is_bad_input(tmp_path: Path, text: str) -> None:
    (tmp_path / "reports").mkdir()
    (tmp_path / "reports" / "gate_a.json").write_text(text)
    with pytest.raises(BadInputError, match="without a verdict"):
        judged(tmp_path, "gate_a")
