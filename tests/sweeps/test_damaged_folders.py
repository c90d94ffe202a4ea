"""Sweeps whose folder was altered: each is computed again with a warning, or refused by name; none ends otherwise."""

import json
import os
import pathlib
import shutil
import tempfile
import warnings
from contextlib import contextmanager

import pytest
import xarray

import jounce as jn
from jounce.errors import JounceError, OutputError
from jounce.sweeps import layout, manifest
from jounce.sweeps.store import find
from jounce.sweeps.sweeping import opened, prepare
from tests.problems.waves import ROOT, VARY, Waves, contents, swept

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A sweep of two chunks, its checksum, and its files."""
    folder = tmp_path_factory.mktemp("whole") / "a.zarr"
    return folder, swept(folder), contents(folder)


@pytest.fixture
def copy(whole, tmp_path):
    folder = tmp_path / "a.zarr"
    shutil.copytree(whole[0], folder)
    return folder


def remove(path):
    path.unlink()


def empty(path):
    path.write_bytes(b"")


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def lengthen(path):
    path.write_bytes(path.read_bytes() + b"\0" * 40)


def scramble(path):
    path.write_bytes(bytes(range(256)) * 4)


def turn_bits(path):
    path.write_bytes(bytes(byte ^ 0x10 for byte in path.read_bytes()))


def nest(path):
    path.write_bytes(b"[" * 100_000)


def number(path):
    path.write_bytes(b"17")


def make_folder(path):
    path.unlink()
    path.mkdir()


def fill_folder(path):
    make_folder(path)
    (path / "mine").write_text("mine")


def link_to_nothing(path):
    outside = next(parent.parent for parent in path.parents if parent.suffix == ".zarr")
    path.unlink()
    path.symlink_to(outside / "planted")


def link_to_itself(path):
    path.unlink()
    path.symlink_to(path)


def link_to_pipe(path):
    pipe(path)
    path.rename(path.with_name("pipe"))
    path.symlink_to(path.with_name("pipe"))


def pipe(path):
    path.unlink()
    os.mkfifo(path)


CHANGES = (
    remove, empty, cut, lengthen, scramble, turn_bits, nest, number, make_folder, fill_folder, link_to_nothing,
    link_to_itself, link_to_pipe, pipe,
)  # fmt: skip
FILES = (
    "wave_peak/zarr.json",
    "wave_peak/c/0/0",
    "size/c/1",
    "time/c/0",
    "component/c/0",
    "chunks/digest/zarr.json",
    "chunks/digest/c/0",
)


@contextmanager
def ignored():
    """Ignore warnings of what was found before."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", jn.errors.DamageWarning)
        yield


def assert_mended(folder, whole):
    """The same command warns, and leaves the same files; once more it finds nothing to warn of."""
    with pytest.warns(jn.errors.DamageWarning, match=r"files of .* were lost or changed since"):
        assert swept(folder) == whole[1]
    assert_same(folder, whole)


def assert_same(folder, whole):
    after = contents(folder)
    assert {name: after[name] for name in whole[2]} == whole[2]
    assert swept(folder) == whole[1]
    opened(folder).load()


def assert_refused(folder, match=None):
    before = {path for path in folder.rglob("*") if path.parent.name != "c"}  # but for a digest that is not right
    with pytest.raises(OutputError, match=match) as caught, ignored():
        swept(folder)
    assert str(folder) in str(caught.value)
    assert before <= {*folder.rglob("*")}


@pytest.mark.parametrize("change", CHANGES)
def test_without_its_description_a_folder_is_no_sweep(copy, change):
    change(copy / ROOT)
    assert_refused(copy, r"not a sweep of jounce, or is a damaged one \(zarr.json: ")


QUICK = {
    (name, change) for i, name in enumerate(FILES) for change in CHANGES[i :: len(FILES)]
}  # each file, each change


@pytest.mark.parametrize(
    "name, change",
    [
        pytest.param(name, change, marks=() if (name, change) in QUICK else pytest.mark.slow)
        for change in CHANGES
        for name in FILES
    ],
)
def test_every_alteration_of_a_file_is_mended_or_refused(copy, whole, name, change):
    change(copy / name)
    if change in (make_folder, fill_folder):
        assert_refused(copy, f"{name}: something else takes the place of a file of the sweep; remove it")
        shutil.rmtree(copy / name)
        with ignored():
            assert swept(copy) == whole[1]
        assert_same(copy, whole)
    elif name.endswith("digest/c/0") and change is remove:  # as if the chunk had never been computed
        assert swept(copy) == whole[1]
        assert_same(copy, whole)
    else:
        assert_mended(copy, whole)
    assert not (copy.parent / "planted").exists()


@pytest.mark.parametrize("name", [ROOT, "wave_peak/c/0/0", "chunks/digest/c/0", "time/c/0"])
def test_a_link_to_a_file_that_is_as_it_must_be_is_one(copy, whole, name):
    kept = copy.parent / "kept"
    (copy / name).rename(kept)
    (copy / name).symlink_to(kept)
    assert swept(copy) == whole[1]
    assert_same(copy, whole)


@pytest.mark.parametrize("name", ["wave_peak", "wave_peak/c", "time", "chunks", "chunks/digest", "chunks/digest/c"])
def test_every_alteration_of_a_folder_is_mended_or_refused(copy, whole, name):
    kept, path = copy.parent / "kept", copy / name
    path.rename(kept)
    if not name.startswith("chunks"):
        assert_mended(copy, whole)
    else:  # without its digest no chunk counts as done
        with ignored():
            assert swept(copy) == whole[1]
        assert_same(copy, whole)
    for planted in (lambda: path.write_text("mine"), lambda: path.symlink_to(kept), lambda: os.mkfifo(path)):
        shutil.rmtree(path, ignore_errors=True)
        path.unlink(missing_ok=True)
        before = contents(kept)
        planted()
        assert_refused(copy, f"{name}: takes the place of a folder of the sweep; remove it")
        assert contents(kept) == before


@pytest.mark.parametrize("name", ["5", "007", "\u0663", "9" * 200, "-1", "1.partial", "x"])
def test_other_files_beside_the_digests_are_not_counted(copy, whole, name):
    (copy / "chunks/digest/c" / name).write_bytes(b"x" * 32)
    assert swept(copy) == whole[1]


def set_in(*keys, to):
    """Return what edits a value in the description of an array or the whole."""

    def edit(path):
        content = json.loads(path.read_text())
        place = content
        for key in keys[:-1]:
            place = place[key]
        if to is None:
            del place[keys[-1]]
        else:
            place[keys[-1]] = to
        path.write_text(json.dumps(content))

    return edit


ARRAYS = ("consolidated_metadata", "metadata")
EDITS = (
    ("wave_peak/zarr.json", set_in("zarr_format", to=2)),
    ("wave_peak/zarr.json", set_in("node_type", to="group")),
    ("wave_peak/zarr.json", set_in("shape", to=[3, 10**15])),
    ("wave_peak/zarr.json", set_in("shape", to=[-3, 2])),
    ("wave_peak/zarr.json", set_in("shape", to=None)),
    ("wave_peak/zarr.json", set_in("data_type", to="float32")),
    ("wave_peak/zarr.json", set_in("codecs", to=[{"name": "no_such"}])),
    ("wave_peak/zarr.json", set_in("codecs", 0, "configuration", "endian", to="big")),
    ("wave_peak/zarr.json", set_in("chunk_grid", "configuration", "chunk_shape", to=[0, 0])),
    ("wave_peak/zarr.json", set_in("chunk_key_encoding", "configuration", "separator", to=".")),
    ("wave_peak/zarr.json", set_in("fill_value", to=0.0)),
    ("wave_peak/zarr.json", set_in("attributes", "units", to="mm")),
    ("wave_peak/zarr.json", set_in("attributes", "scale_factor", to=2.0)),
    ("wave_peak/zarr.json", set_in("dimension_names", to=["derivative", "design"])),
    ("time/zarr.json", set_in("shape", to=[2])),
    ("chunks/digest/zarr.json", set_in("shape", to=[1])),
    (ROOT, set_in("zarr_format", to=2)),
    (ROOT, set_in("node_type", to="array")),
    (ROOT, set_in("consolidated_metadata", to=None)),
    (ROOT, set_in("consolidated_metadata", to=[])),
    (ROOT, set_in(*ARRAYS, to=[1])),
    (ROOT, set_in(*ARRAYS, "wave_rms", to=None)),
    (ROOT, set_in(*ARRAYS, "wave_rms", to="x")),
    (ROOT, set_in(*ARRAYS, "other", to={"zarr_format": 3})),
    (ROOT, set_in(*ARRAYS, "wave_rms", "shape", to=[10**15, 2])),
    (ROOT, set_in(*ARRAYS, "wave_rms", "attributes", "scale_factor", to=2.0)),
    (ROOT, set_in("attributes", "coordinates", to="time")),
    (ROOT, set_in("attributes", "title", to=None)),
)


@pytest.mark.parametrize("name, edit", EDITS)
def test_every_edit_of_a_description_is_mended(copy, whole, name, edit):
    edit(copy / name)
    assert_mended(copy, whole)


def test_what_others_say_about_the_whole_sweep_stays(copy, whole):
    set_in("attributes", "author", to="me")(copy / ROOT)
    assert swept(copy) == whole[1]
    assert xarray.open_zarr(copy).attrs["author"] == "me"


def manifest_edited(folder, edit, *, sign=False):
    path = folder / ROOT
    content = json.loads(path.read_text())
    record = json.loads(content["attributes"]["manifest"])
    record = edit(record) or record
    if sign:
        record["identity"] = manifest._identity(record)
    content["attributes"]["manifest"] = json.dumps(record)
    path.write_text(json.dumps(content))


WRONG = (None, True, 0, -1, 10**400, 1e308, "", "x" * 100_000, "\x1b[31m\u202e", [], [[1]], {}, {"a": {"b": [None]}})
KEYS = ("format", "title", "files", "model", "vary", "sample", "designs", "time", "options", "versions", "arithmetic",
        "identity")  # fmt: skip


@pytest.mark.parametrize("key", KEYS)
def test_a_manifest_that_was_changed_is_refused(copy, whole, key):
    before = (copy / ROOT).read_text()
    manifest_edited(copy, lambda entries: entries.pop(key) and None)
    assert_refused(copy, "manifest was changed since it was written")
    (copy / ROOT).write_text(before)
    for value in WRONG:
        if (value is None and key == "sample") or (value == {} and key == "files"):  # as it was
            continue
        for sign in (False, True):  # also by one who knows how the digest is computed
            manifest_edited(
                copy, lambda entries, value=value: entries.update({key: value}), sign=sign and key != "identity"
            )
            assert_refused(copy, "changed since it was written|another sweep is there|another release")
            (copy / ROOT).write_text(before)
    assert swept(copy) == whole[1]


@pytest.mark.parametrize("chunk", [0, -2, 2.0, 2**21, "2", None, True, [2], 10**400])
def test_a_size_of_chunks_that_cannot_be_is_refused(copy, chunk):
    manifest_edited(copy, lambda entries: entries["options"].update(chunk=chunk), sign=True)
    with pytest.raises(OutputError, match=r"manifest was changed|another sweep is there"):
        swept(copy, chunk=None)


@pytest.mark.parametrize("text", ["", "{", "[]", "17", "[" * 100_000, 17, None, {"format": 3}, ["x"]])
def test_a_manifest_that_is_none_is_refused(copy, text):
    set_in("attributes", "manifest", to=text)(copy / ROOT) if text is not None else None
    if text is None:
        set_in("attributes", to=[1])(copy / ROOT)
    assert_refused(copy)


def test_a_checksum_of_any_kind_is_written_again(copy, whole):
    for value in ("", 5, [1], {"a": 1}):
        set_in("attributes", "checksum", to=value)(copy / ROOT)
        manifest_edited(copy, lambda entries, value=value: entries.update(checksum=value))
        assert swept(copy) == whole[1]
        assert_same(copy, whole)


@pytest.fixture
def stranger(whole):
    """A copy in a folder of a user who may not do everything, as whom the test goes on."""
    above = pathlib.Path(tempfile.mkdtemp())
    folder = above / "a.zarr"
    shutil.copytree(whole[0], folder)
    root = os.geteuid() == 0
    if root:
        for path in (above, folder, *folder.rglob("*")):
            os.chown(path, 65534, -1)
        os.seteuid(65534)
    try:
        yield folder
    finally:
        if root:
            os.seteuid(0)
        for path in (above, *above.rglob("*")):
            path.chmod(0o700)
        shutil.rmtree(above)


@pytest.mark.parametrize("name", FILES)
def test_files_that_may_not_be_read_are_written_again(stranger, whole, name):
    (stranger / name).chmod(0)
    assert_mended(stranger, whole)


@pytest.mark.parametrize("name", [".", ROOT, "time", "wave_peak", "wave_peak/c/0", "chunks/digest/c", "chunks/digest"])
def test_folders_that_may_not_be_entered_are_refused(stranger, name):
    (stranger / name).chmod(0)
    with pytest.raises(OutputError, match=r"a\.zarr.* cannot be (read|written): Permission denied"), ignored():
        swept(stranger)


def test_a_folder_that_may_only_be_read_is_checked_and_reported(stranger, whole):
    for path in (stranger, *stranger.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    assert swept(stranger) == whole[1]
    (stranger / "wave_peak/c/0").chmod(0o755)
    remove(stranger / "wave_peak/c/0/0")
    with pytest.raises(OutputError, match=r"a\.zarr.* cannot be written: Permission denied"), ignored():
        swept(stranger)


def test_a_sweep_inside_a_sweep_is_refused(copy, whole, tmp_path):
    link = tmp_path / "link"
    link.symlink_to(copy / "wave_peak")
    for out in (copy / "b.zarr", copy / "wave_peak" / "b.zarr", link / "b.zarr", copy / "chunks" / ".." / "b.zarr"):
        with pytest.raises(OutputError, match="above is that of another sweep; give a name outside"):
            swept(out)
    assert swept(copy) == whole[1]


def test_a_folder_of_other_groups_may_hold_sweeps(whole, tmp_path):
    import zarr

    zarr.create_group(tmp_path / "all.zarr", attributes={"author": "me"})
    assert swept(tmp_path / "all.zarr" / "a.zarr") == whole[1]


def test_links_to_the_folder_itself(copy, whole, tmp_path):
    link, nowhere = tmp_path / "b.zarr", tmp_path / "c.zarr"
    link.symlink_to(copy)
    assert swept(link) == whole[1]
    nowhere.symlink_to(tmp_path / "d.zarr")
    assert swept(nowhere) == whole[1]
    assert find(tmp_path / "d.zarr") is not None


def test_only_what_is_empty_makes_way(tmp_path, whole):
    """Another command replaces a sweep of which nothing was computed, but not one with results or with other files."""
    other = {**VARY, "phase": [0.5]}
    folder = tmp_path / "a.zarr"
    prepare(Waves(), VARY, folder, "waves", {}, chunk=2)
    (folder / ".scratch-left").mkdir()
    assert swept(folder, other) != whole[1]
    shutil.rmtree(folder)
    prepare(Waves(), VARY, folder, "waves", {}, chunk=2)
    (folder / "notes").write_text("mine")
    with pytest.raises(OutputError, match="another sweep is there"):
        swept(folder, other)
    shutil.rmtree(folder)
    shutil.copytree(whole[0], folder)
    shutil.rmtree(folder / "chunks" / "digest" / "c")
    with pytest.raises(OutputError, match="another sweep is there"):
        swept(folder, other)
    assert swept(folder) == whole[1]


def test_counts_are_bounded_before_work_begins(tmp_path, monkeypatch):
    numbers = {"size": (0.0, 1.0, 10**6), "phase": (0.0, 1.0, 10**6)}
    with pytest.raises(JounceError, match=r"at most 1e\+10 designs are swept, got 1000000000000"):
        swept(tmp_path / "a.zarr", numbers)
    monkeypatch.setattr(layout.shutil, "disk_usage", lambda _: layout.shutil._ntuple_diskusage(10**12, 0, 10**11))
    with pytest.raises(OutputError, match=r"10000000000 designs of \d+ bytes each are \d.* TB, and 100 GB are free"):
        swept(tmp_path / "a.zarr", {"size": (0.0, 1.0, 10**5), "phase": (0.0, 1.0, 10**5)})
    monkeypatch.setattr(layout, "_free_files", lambda _: 15)
    with pytest.raises(OutputError, match=r"3 designs take .* files, and the disk has room for 15"):
        swept(tmp_path / "a.zarr")
    assert not list(tmp_path.iterdir())
