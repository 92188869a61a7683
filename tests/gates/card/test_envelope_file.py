"""The envelope of a card, part by part: what is of another form is refused by its name."""

import re

import pytest

from gates.card.envelope_file import AS_WRITTEN, PAYLOAD_TYPE, dsse_envelope, parse_envelope
from genpolicy.errors import BadInputError
from genpolicy.integrity.documents import canonical_json

SIGNED = {"payload": "", "payloadType": PAYLOAD_TYPE, "signatures": [
    {"keyid": "k", "sig": ""},
]}  # fmt: skip


@pytest.mark.parametrize(("changes", "found"), [
    ({"payloadType": "p" * 80}, "payloadType is '" + "p" * 59 + ", "),
    ({"payloadType": "p" * 57}, "payloadType is '" + "p" * 57 + "', "),
    ({"signatures": [{"keyid": [1] * 80, "sig": ""}]}, "keyid is [" + "1, " * 19 + "1,, "),
    ({"signatures": []}, "signatures is empty, "), ({"signatures": "k"}, "signatures is empty, "),
    ({"signatures": [SIGNED["signatures"][0], 3]}, "signatures is another form, "),
    ({"signatures": [{"keyid": "k"}]}, "signatures is another form, "),
    ({"signatures": [{"keyid": "k", "sig": "?"}]}, "sig is not base64, "),
    ({"signatures": [{"keyid": "k", "sig": 3}]}, "sig is not base64, "),
    ({"payload": "?"}, "payload is not base64, "), ({"more": 1}, "c is another document, "),
])  # fmt: skip
def test_an_envelope_of_another_form_is_refused_by_its_part(changes, found):
    whole = canonical_json({**SIGNED, **changes})
    assert parse_envelope(canonical_json(SIGNED), "c") == (b"", SIGNED["signatures"])
    with pytest.raises(BadInputError, match=re.escape(found)) as refused:
        parse_envelope(whole, "c")
    assert refused.value.action == AS_WRITTEN


def test_two_signatures_by_one_key_are_refused():
    one = SIGNED["signatures"][0]
    assert len(dsse_envelope(b"", [one], "c").signatures) == 1
    with pytest.raises(BadInputError, match="signatures is two of one key") as refused:
        dsse_envelope(b"", [one, one], "c")
    assert refused.value.action == AS_WRITTEN
