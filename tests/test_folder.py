"""The door to folders of others: links stay closed, only regular files are opened, and nobody waits for a pipe."""

import ast
import os
import socket
from pathlib import Path

import pytest

from humanclaw.storage import Folder, read_file

MOST = 1000


@pytest.fixture
def folder(tmp_path):
    """A folder of others."""
    (tmp_path / "home").mkdir()
    return Folder(tmp_path / "home")


@pytest.fixture
def mine(tmp_path):
    """A file of the user, outside of the folder."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_bytes(b"mine")
    return tmp_path / "mine"


def test_what_is_written_is_read_back_from_folders_that_are_made(folder):
    folder.write("a/b/c.txt", b"first")
    folder.write("a/b/c.txt", b"second")
    assert (folder / "a" / "b").read("c.txt", MOST) == b"second"
    assert ((folder / "a" / "b").names(), (folder / "a/b").names(".jpg"), (folder / "x").names()) == (["c.txt"], [], [])
    with (folder / "a").append("b/c.txt") as stream:
        stream.write(b" third")
    assert folder.read("a/b/c.txt", MOST) == b"second third"
    assert [holder.inside for holder in folder.holding("c.txt")] == ["a/b"]
    folder.remove("a/b/c.txt")
    folder.remove("a/b/c.txt")
    assert not folder.has("a/b/c.txt")


def test_a_block_that_fails_leaves_the_old_file_alone(folder):
    folder.write("a", b"old")
    with pytest.raises(TypeError), folder.replacing("a") as stream:
        stream.write("no bytes")
    assert (folder.names(), folder.read("a", MOST)) == (["a"], b"old")


def plants(place, mine):
    """What may lie at a place instead of a file, each with what is said of it."""
    yield "is a link", lambda: place.symlink_to(mine / "notes.txt")
    yield "is a link", lambda: place.symlink_to(mine / "nothing")
    yield "is no regular file", lambda: os.mkfifo(place)
    yield "(is no regular file|Is a directory)", place.mkdir
    yield "(is no regular file|No such device or address)", lambda: socket.socket(socket.AF_UNIX).bind(str(place))


@pytest.mark.parametrize("number", range(5))
def test_nothing_but_a_regular_file_is_opened(folder, mine, number, monkeypatch):
    monkeypatch.chdir(folder.path)  # The path of a socket may not be long.
    what, plant = list(plants(folder.path / "file", mine))[number]
    plant()
    with pytest.raises(OSError, match=what):
        folder.read("file", MOST)
    with pytest.raises(OSError, match=what):
        folder.append("file")
    assert not folder.has("file")
    assert sorted(os.listdir(mine)) == ["notes.txt"]
    assert (mine / "notes.txt").read_bytes() == b"mine"


def test_a_link_is_replaced_or_removed_and_its_goal_untouched(folder, mine):
    for act in (lambda: folder.write("file", b"new"), lambda: folder.remove("file")):
        folder.remove("file")
        (folder.path / "file").symlink_to(mine / "notes.txt")
        act()
        assert not (folder.path / "file").is_symlink()
    assert (mine / "notes.txt").read_bytes() == b"mine"


def test_no_link_is_followed_on_the_way(folder, mine):
    (folder.path / "frames").symlink_to(mine)
    acts = (
        lambda: folder.read("frames/notes.txt", MOST),
        lambda: folder.write("frames/notes.txt", b"new"),
        lambda: folder.append("frames/notes.txt"),
        lambda: folder.remove("frames/notes.txt"),
        lambda: (folder / "frames").names(),
    )
    for act in acts:
        with pytest.raises(OSError, match="frames is a link, which is not followed"):
            act()
    assert (mine / "notes.txt").read_bytes() == b"mine"
    assert folder.holding("notes.txt") == []


def test_the_folder_itself_may_be_a_link(folder, tmp_path):
    folder.write("a", b"x")
    (tmp_path / "latest").symlink_to(folder.path)
    assert Folder(tmp_path / "latest").read("a", MOST) == b"x"
    assert read_file(tmp_path / "latest" / "a", MOST) == b"x"


def test_a_file_that_the_user_names_may_be_a_link_but_no_pipe(tmp_path, mine):
    (tmp_path / "link").symlink_to(mine / "notes.txt")
    assert read_file(tmp_path / "link", MOST) == b"mine"
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="is no regular file"):
        read_file(tmp_path / "pipe", MOST)


def test_a_file_with_a_second_name_does_not_grow_there(folder, mine):
    os.link(mine / "notes.txt", folder.path / "journal")
    with pytest.raises(OSError, match="journal has a second name elsewhere"):
        folder.append("journal")
    folder.write("journal", b"new")
    assert (mine / "notes.txt").read_bytes() == b"mine"


def test_a_file_larger_than_its_bound_is_not_read(folder):
    folder.write("a", bytes(10))
    assert len(folder.read("a", 10)) == 10
    with pytest.raises(OSError, match="a is larger than"):
        folder.read("a", 9)


@pytest.mark.parametrize("name", ["../b", "/etc/passwd", "a/../../b", "..", "a/../..", "a\0", "\ud800"])
def test_a_name_cannot_lead_out_of_the_folder(folder, name):
    for act in (lambda: folder.read(name, MOST), lambda: folder.write(name, b""), lambda: (folder / name).names()):
        with pytest.raises(OSError, match=r"leads out of the folder|is no name of a file"):
            act()


# -- nobody else opens files -------------------------------------------------------------------------------------------
OWN = {
    "core/humanclaw/storage/": "the door",
    "core/humanclaw/cli/new.py": "templates of this package, and a folder that it makes",
    "core/humanclaw/cli/terminal.py": "the null device",
    "core/humanclaw/episodes/recorder.py": "code and weights of installed skills",
    "core/humanclaw/motion/checkpoint.py": "weights that the user named",
    "core/humanclaw/plugins/distributions.py": "a table of this package",
    "core/humanclaw/plugins/host.py": "entry points of installed packages",
    "core/humanclaw/records/": "streams of the door",
    "core/humanclaw/testing/speed.py": "/proc",
    "core/humanclaw/world/meshes/": "bytes",
    "harnesses/frameworks/humanclaw_frameworks/wrappers.py": "bytes",
    "harnesses/human/humanclaw_human/window.py": "a temporary folder",
    "harnesses/pilot/humanclaw_pilot/": "views and weights of the user",
    "plugins/bench/humanclaw_bench/settings.py": "plugin files that the user named, and weights of installed skills",
    "plugins/bench/humanclaw_bench/tables.py": "a table of this package",
    "plugins/bullet/humanclaw_bullet/": "a temporary folder, and the null device",
    "plugins/raster/humanclaw_raster/sky.py": "a picture of this package",
    "plugins/ray/humanclaw_ray/executor.py": "a temporary folder",
    "plugins/report/humanclaw_report/": "a script of this package",
    "plugins/train/": "motion capture and runs of the user",
}
"""Modules that open files themselves, and which."""
METHODS = {"read_text", "read_bytes", "write_text", "write_bytes", "unlink", "touch", "rename", "symlink_to"}
READERS = "np.load np.save np.memmap np.fromfile Image.open zipfile.ZipFile safe_open ElementTree.parse io.open os.open"
MOVERS = {"replace", "remove", "rename", "unlink", "copy", "copyfile", "copytree", "move", "rmtree"}


def opens(call):
    """Whether a call opens, writes, moves or removes a file."""
    name = ast.unparse(call.func)
    first, _, last = name.rpartition(".")
    options = {keyword.arg for keyword in call.keywords} & {"encoding", "newline", "buffering", "mode"}
    mode = call.args and isinstance(call.args[0], ast.Constant) and set(str(call.args[0].value)) <= set("rwabtx+")
    return (
        name in ("open", *READERS.split())
        or (last == "open" and (options or mode))
        or (first in ("os", "shutil") and last in MOVERS)
        or (last in METHODS and first and not first.startswith("resources"))
    )


def test_only_the_door_opens_files():
    root, paths = Path(__file__).parents[1], set()
    parts = ("core/humanclaw/**", "plugins/*/humanclaw_*/**", "harnesses/*/humanclaw_*/**", "skills/*/humanclaw_*/**")
    for path in (path for part in parts for path in root.glob(f"{part}/*.py")):
        calls = (node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.Call))
        paths |= {path.relative_to(root).as_posix()} if any(map(opens, calls)) else set()
    allowed = {name: {place for place in OWN if name.startswith(place)} for name in paths}
    assert [name for name, places in allowed.items() if not places] == [], "open it with humanclaw.storage.Folder"
    assert set(OWN) == set().union(*allowed.values()), "these open none"
