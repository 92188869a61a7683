"""Settings of the audit are strict."""

import pytest

from genpolicy.audit.settings import AuditSettings


def test_settings_are_strict():
    from pydantic import ValidationError

    with pytest.raises(ValidationError):
        AuditSettings(radius="6")
    with pytest.raises(ValidationError):
        AuditSettings(neighbors=10)
