"""A sample is bounded, in order, the same for the same bytes, and another for other ones."""

from gates.sampled import salt_of, some


def test_a_sample_follows_from_name_and_salt_and_is_bounded():
    chosen = some(range(1000), 12, name="one", salt="a")
    assert chosen == some(range(1000), 12, name="one", salt="a") == sorted(chosen)
    assert len(set(chosen)) == 12
    assert chosen != some(range(1000), 12, name="other", salt="a")
    assert chosen != some(range(1000), 12, name="one", salt="b")
    assert some("abc", 12, name="one", salt="a") == ["a", "b", "c"]
    assert some([], 12, name="one", salt="a") == []


def test_any_byte_of_any_file_is_in_the_salt(tmp_path):
    paths = [tmp_path / "a", tmp_path / "b"]
    salts = [salt_of(paths)]
    for path, data in ((paths[0], b"1"), (paths[1], b"1"), (paths[0], b"2")):
        path.write_bytes(data)
        salts.append(salt_of(paths))
    assert len(set(salts)) == len(salts)
    assert salt_of(reversed(paths)) == salt_of([*paths, paths[0]]) == salts[-1]
