"""Damaged evidence is refused."""

import pytest

from genpolicy.errors import BadInputError
from genpolicy.pages.audit.evidence import read_evidence


def test_damaged_evidence_is_refused(audits, tmp_path):
    import shutil

    shutil.copytree(audits["one"], tmp_path / "copy")
    (tmp_path / "copy" / "strata.parquet").unlink()
    with pytest.raises(BadInputError):
        read_evidence(tmp_path / "copy")
