"""The package names its entry points and imports none of them before it is asked."""

import subprocess
import sys

import pytest

import genpolicy.audit


def test_whoever_needs_only_the_rows_does_not_import_the_audit():
    code = (
        "import sys, genpolicy.audit.rows; "
        "assert not {'numpy', 'scipy', 'genpolicy.audit.run'} & set(sys.modules); "
        "from genpolicy.audit import AuditReport, audit, propose_settings; "
        "assert audit.__module__ == 'genpolicy.audit.standalone'"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_package_names_its_entry_points_only():
    with pytest.raises(AttributeError, match="no attribute 'audti'"):
        _ = genpolicy.audit.audti
