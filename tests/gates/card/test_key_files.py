import stat

import pytest
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from gates.card.key_files import make_key
from gates.card.keys import key_weakness
from genpolicy.errors import BadInputError


@pytest.fixture
def root(tmp_path):
    (tmp_path / "workspace").mkdir()
    return tmp_path / "workspace"


def test_a_key_is_its_owners_alone_and_new_each_time(root, tmp_path):
    publics = [make_key(tmp_path / name, root=root) for name in ("a.pem", "b.pem")]
    assert publics[0] != publics[1]
    for name, public in zip(("a.pem", "b.pem"), publics, strict=True):
        path = tmp_path / name
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        key = load_pem_private_key(path.read_bytes(), password=None)
        assert key.public_key().public_bytes_raw().hex() == public
        assert key_weakness(bytes.fromhex(public)) == ""


def test_no_key_is_replaced(root, tmp_path):
    make_key(tmp_path / "a.pem", root=root)
    before = (tmp_path / "a.pem").read_bytes()
    with pytest.raises(BadInputError, match="there already"):
        make_key(tmp_path / "a.pem", root=root)
    (tmp_path / "link.pem").symlink_to(tmp_path / "elsewhere.pem")
    with pytest.raises(BadInputError, match="there already"):
        make_key(tmp_path / "link.pem", root=root)
    assert (tmp_path / "a.pem").read_bytes() == before
    assert not (tmp_path / "elsewhere.pem").exists()


def test_no_key_lies_where_it_would_be_committed(root, tmp_path):
    for place in (root / "my.pem", root / "keys" / ".." / "my.pem"):
        with pytest.raises(BadInputError, match="inside the workspace"):
            make_key(place, root=root)
    (tmp_path / "way-in").symlink_to(root)
    with pytest.raises(BadInputError, match="inside the workspace"):
        make_key(tmp_path / "way-in" / "my.pem", root=root)
    assert list(root.iterdir()) == []


def test_a_folder_that_is_not_there(root, tmp_path):
    with pytest.raises(BadInputError, match="not writable"):
        make_key(tmp_path / "none" / "my.pem", root=root)
