"""A folder in which only this user may write: others, their files and links are refused, as root and as a user."""

import os
import subprocess
import sys
import textwrap

import pytest

from jounce.base.private_folder import PrivateFolder
from jounce.errors import OutputError

OTHER = 54321  # a user that need not exist
root = pytest.mark.skipif(getattr(os, "geteuid", lambda: 1)() != 0, reason="only root may give files away")


@pytest.fixture
def folder(tmp_path):
    return PrivateFolder(tmp_path / "programs")


def test_what_was_put_there_comes_back(folder):
    assert folder.read("a") is None
    folder.write("a", b"one")
    folder.write("a", b"two")
    assert folder.read("a") == b"two"
    assert folder.path.stat().st_mode & 0o777 == 0o700
    assert (folder.path / "a").stat().st_mode & 0o777 == 0o600
    assert [name for _, _, name in folder.files("")] == ["a"]
    folder.remove("a")
    assert folder.read("a") is None


@pytest.mark.parametrize("mode", [0o1777, 0o777, 0o775, 0o702])
def test_a_folder_that_others_may_write_is_refused(tmp_path, mode):
    tmp_path.chmod(mode)
    try:
        with pytest.raises(OutputError, match="may be written by others"):
            PrivateFolder(tmp_path)
    finally:
        tmp_path.chmod(0o700)


def test_a_folder_below_one_that_others_may_write_is_refused(tmp_path):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    with pytest.raises(OutputError, match="in which others may write"):
        PrivateFolder(shared / "programs")
    shared.chmod(0o1777)  # others cannot put another folder in its place
    PrivateFolder(shared / "programs").write("a", b"one")


def test_a_file_that_others_may_write_is_absent(folder):
    folder.write("a", b"one")
    (folder.path / "a").chmod(0o666)
    assert folder.read("a") is None
    folder.write("a", b"two")
    assert folder.read("a") == b"two"


def test_links_are_not_followed(folder, tmp_path):
    target = tmp_path / "target"
    (folder.path / "a").symlink_to(target)
    assert folder.read("a") is None
    folder.write("a", b"one")  # takes the place of the link
    assert not target.exists()
    assert not (folder.path / "a").is_symlink()
    assert folder.read("a") == b"one"
    target.write_bytes(b"of another")
    (folder.path / "b").symlink_to(target)
    assert folder.read("b") is None


def test_a_folder_put_in_its_place_is_not_looked_into(folder):
    folder.write("a", b"one")
    folder.path.rename(folder.path.with_name("moved"))
    folder.path.mkdir()
    (folder.path / "a").write_bytes(b"of another")
    assert folder.read("a") == b"one"


@root
def test_what_belongs_to_another_user_is_refused(folder):
    folder.write("a", b"one")
    os.chown(folder.path / "a", OTHER, OTHER)
    assert folder.read("a") is None
    os.chown(folder.path, OTHER, OTHER)
    with pytest.raises(OutputError, match="belongs to another user"):
        PrivateFolder(folder.path)


@root
def test_a_user_takes_nothing_of_root_or_of_another(tmp_path):
    for name in ("own", "roots", "open"):
        PrivateFolder(tmp_path / name).write("a", b"planted")
    os.chown(tmp_path, OTHER, OTHER)
    os.chown(tmp_path / "own", OTHER, OTHER)
    os.chown(tmp_path / "open", OTHER, OTHER)
    (tmp_path / "open").chmod(0o1777)
    program = textwrap.dedent(f"""
        import os, pathlib
        from jounce.errors import OutputError
        from jounce.base.private_folder import PrivateFolder
        for folder in pathlib.Path({str(tmp_path)!r}).parents:  # those of the tests, which only root may enter
            if folder.stat().st_mode & 0o777 == 0o700:
                folder.chmod(0o711)
        os.setgid({OTHER}); os.setuid({OTHER})
        path = pathlib.Path({str(tmp_path)!r})
        own = PrivateFolder(path / "own")
        assert own.read("a") is None  # of root
        own.write("a", b"mine")
        assert own.read("a") == b"mine"
        for name in ("roots", "open"):
            try:
                PrivateFolder(path / name)
            except OutputError:
                continue
            raise SystemExit(name)
    """)
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
