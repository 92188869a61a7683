"""What a run is asked to do: there and back, and nothing that is none."""

import json

import pytest
from arranged import request_of

from genpolicy.errors import ConfigError, IntegrityError
from genpolicy.wall_clock.request import REQUEST, read_request


def test_a_request_comes_back(standing, tmp_path):
    request = request_of(tmp_path, standing)
    request.write(tmp_path)
    assert read_request(tmp_path) == request


@pytest.mark.parametrize(
    "change", [{"method": 3}, {"limits": "other"}, {"checkpoint": "x" * 999}, {"replay": None}]
)
def test_another_document_is_refused(change, standing, tmp_path):
    request_of(tmp_path, standing).write(tmp_path)
    document = json.loads((tmp_path / REQUEST).read_text())
    (tmp_path / REQUEST).write_text(json.dumps(document | change))
    with pytest.raises(ConfigError, match=f"{REQUEST}.{next(iter(change))}"):
        read_request(tmp_path)


def test_no_document_is_refused(tmp_path):
    with pytest.raises(IntegrityError):
        read_request(tmp_path)
