"""Files of others: every reader succeeds or raises an error of ours, in a GiB of memory and five seconds.

`make fuzz` tries 12,500 examples of each; else there are a few.
"""

import functools
import json
import shutil
import struct
import warnings

import numpy as np
import pytest
import trimesh
from fuzzing import HOSTILE, PICKS, bounded, changed, damaged, damages, rewritten
from hypothesis import example, given, strategies as st
from made import record_episode
from PIL import Image
from rooms import two_rooms
from tiny_motion import write_base

from humanclaw import CheckpointError, HumanclawError, RecordedEpisode, RecordError, SceneError, load_run
from humanclaw.motion.checkpoint import load_base
from humanclaw.records import read_episodes
from humanclaw.storage import Cache
from humanclaw.world import Mesh, pack_scene, read_model, unpack_scene
from humanclaw_bench.leaderboard import leaderboard
from humanclaw_bench.submission import submit
from humanclaw_bench.verification import check
from humanclaw_habitat import urdf


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


# -- records -----------------------------------------------------------------------------------------------------------
RUN = {"episodes": 1, "split": "0" * 64, "options": {}}


@functools.cache
def record(home):
    """The files of a run of one record without a seal."""
    record_episode(home / "run" / "couch-0")
    path = home / "run" / "couch-0" / "episode.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "seal": "", "files": {}}))
    names = ("couch-0/episode.json", "couch-0/steps.jsonl", "couch-0/motion.npz")
    made = {name: (home / "run" / name).read_bytes() for name in names}
    return made | {"run.json": json.dumps(RUN).encode()}


def read_run(home, **other):
    """Read a run of which one file is another."""
    for name, data in (record(home) | other).items():
        (home / "run" / name).write_bytes(data)
    with bounded(RecordError):
        episode = RecordedEpisode(home / "run" / "couch-0")
        episode.motion()
        episode.objects()
        _ = episode.digest
    with bounded(RecordError):
        load_run(home / "run")
        check(home / "run")


@given(name=st.integers(0, 3), changes=damages())
def test_any_damage_to_a_run_without_seals_is_read_or_refused(home, name, changes):
    name, data = list(record(home).items())[name]
    read_run(home, **{name: damaged(data, changes)})


@given(name=st.sampled_from(["couch-0/episode.json", "run.json"]), picks=PICKS, new=HOSTILE)
def test_any_value_in_a_run_without_seals_is_read_or_refused(home, name, picks, new):
    read_run(home, **{name: rewritten(record(home)[name], picks, new) + b"\n"})


@given(line=st.integers(0, 30), picks=PICKS, new=HOSTILE)
def test_any_value_in_a_step_is_read_or_refused(home, line, picks, new):
    lines = record(home)["couch-0/steps.jsonl"].splitlines()
    lines[line % len(lines)] = rewritten(lines[line % len(lines)], picks, new)
    read_run(home, **{"couch-0/steps.jsonl": b"\n".join(lines) + b"\n"})


@functools.cache
def submission(home):
    record_episode(home / "whole" / "couch-0")
    record = RecordedEpisode(home / "whole" / "couch-0").record
    manifest = RUN | {"versions": record.versions, "weights": record.weights, "verifier": record.verifier}
    (home / "whole" / "run.json").write_text(json.dumps(manifest))
    return submit_unchecked(home / "whole")


def submit_unchecked(run):
    from humanclaw_bench.verification import split_digest

    specs = [episode.record.spec for episode in load_run(run)]
    manifest = json.loads((run / "run.json").read_text()) | {"split": split_digest(specs)}
    (run / "run.json").write_text(json.dumps(manifest))
    return submit(run, "me").model_dump_json().encode()


@given(picks=PICKS, new=HOSTILE, changes=damages(), whole=st.booleans())
def test_any_submission_is_on_the_page_or_refused(home, picks, new, changes, whole):
    data = rewritten(submission(home), picks, new) if whole else damaged(submission(home), changes)
    if not (home / "board").exists():
        shutil.copytree(home / "whole", home / "board" / "one")
    (home / "board" / "one" / "submission.json").write_bytes(data)
    with bounded(RecordError):
        leaderboard(home / "board")


@given(changes=damages(), text=st.binary(max_size=60), picks=PICKS, new=HOSTILE)
def test_any_file_of_episodes_is_read_or_refused(home, changes, text, picks, new):
    line = b'{"id": "a", "instruction": "Find a couch.", "scene": "house:0", "start": {"x": 1, "z": 2, "yaw": 0}}\n'
    for content in (damaged(line, changes), text, rewritten(line, picks, new)):
        (home / "split.jsonl").write_bytes(content)
        with bounded(HumanclawError):
            read_episodes(home / "split.jsonl")


# -- scenes and the cache ----------------------------------------------------------------------------------------------
@functools.cache
def packed():
    return pack_scene(two_rooms())


def headed(data, change):
    """Return a safetensors file with another header."""
    end = 8 + int.from_bytes(data[:8], "little")
    head = change(data[8:end])
    return len(head).to_bytes(8, "little") + head + data[end:]


@given(changes=damages(), picks=PICKS, new=HOSTILE)
def test_any_damage_to_a_packed_scene_is_found(changes, picks, new):
    data = packed()
    for other in (damaged(data, changes), headed(data, lambda head: rewritten(head, picks, new))):
        with bounded(SceneError):
            assert unpack_scene(other).digest == two_rooms().digest


@given(changes=damages())
def test_any_entry_of_a_cache_is_the_one_of_its_key_or_none(home, changes):
    cache = Cache("things", root=home)
    cache.put("one", b"something")
    cache.put("two", b"another thing")
    path = cache.folder / "one"
    for content in ((cache.folder / "two").read_bytes(), damaged(path.read_bytes(), changes)):
        path.write_bytes(content)
        with warnings.catch_warnings(), bounded():
            warnings.simplefilter("ignore")
            assert cache.get("one") in (None, b"something")


# -- weights -----------------------------------------------------------------------------------------------------------
@functools.cache
def checkpoint(path):
    write_base(path)
    return path.read_bytes()


@given(changes=damages(), picks=PICKS, new=HOSTILE, note=st.booleans())
def test_any_damage_to_a_checkpoint_is_read_or_refused(home, changes, picks, new, note):
    def other(head):
        if not note:
            return rewritten(head, picks, new)
        header = json.loads(head)
        header["__metadata__"]["humanclaw"] = rewritten(header["__metadata__"]["humanclaw"], picks, new).decode()
        return json.dumps(header).encode()

    data = checkpoint(home / "tiny.safetensors")
    for content in (damaged(data, changes), headed(data, other)):
        (home / "damaged.safetensors").write_bytes(content)
        with bounded(CheckpointError):
            load_base(home / "damaged.safetensors")


def test_a_checkpoint_whose_header_would_fill_memory_is_refused(home):
    (home / "head.safetensors").write_bytes(struct.pack("<Q", 9 << 20) + b" " * (9 << 20))
    with bounded(), pytest.raises(CheckpointError, match="its header is too large"):
        load_base(home / "head.safetensors")


# -- models ------------------------------------------------------------------------------------------------------------
def written(mesh):
    """Return a GLB of a mesh with its texture."""
    look = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(mesh.texture))
    visual = trimesh.visual.TextureVisuals(uv=mesh.uv, material=look)
    return trimesh.Trimesh(mesh.vertices, mesh.faces, visual=visual, process=False).export(file_type="glb")


@functools.cache
def glb():
    return written(next(iter(two_rooms().assets.values())).mesh)


def with_head(data, picks, new):
    """Return a GLB with another value in its JSON."""
    size = struct.unpack_from("<I", data, 12)[0]
    head = json.dumps(changed(json.loads(data[20 : 20 + size]), picks, new)).encode()
    head += b" " * (-len(head) % 4)
    rest = data[20 + size :]
    return b"glTF" + struct.pack("<IIII", 2, 20 + len(head) + len(rest), len(head), 0x4E4F534A) + head + rest


@given(changes=damages(), picks=PICKS, new=HOSTILE)
@example(changes=[(0, b"", 0)], picks=[138, 0, 0], new=float("inf"))
def test_any_glb_is_read_or_refused(home, changes, picks, new):
    (home / "models").mkdir(exist_ok=True)
    for content in (damaged(glb(), changes), with_head(glb(), picks, new)):
        (home / "models" / "chair.glb").write_bytes(content)
        with bounded(SceneError):
            read_model(home / "models" / "chair.glb")


LINES = st.sampled_from(
    ["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 1e308 nan 0", "v", "vt 0 0", "vt", "vn 0 0 1", "f 1 2 3", "f 1/1 2/2 3/3",
     "f 9 9 9", "f -1 -2 -3", "f 1000000000 1 2", "f 0 0 0", "f", "usemtl a", "mtllib m.mtl", "mtllib ../../etc/passwd",
     "g x", "o " + "x" * 9999, "p 1 2", "l 1 2", "\\", "\0"]
)  # fmt: skip


@given(lines=st.lists(LINES, max_size=30), suffix=st.sampled_from(["obj", "ply", "stl", "gltf", "zip", "off"]))
def test_any_model_in_text_is_read_or_refused(home, lines, suffix):
    path = home / f"model.{suffix}"
    path.write_text("\n".join(lines))
    with bounded(SceneError):
        read_model(path)


@given(
    kind=st.sampled_from(["ascii", "binary_little_endian"]), counts=st.lists(HOSTILE, min_size=2, max_size=2),
    rest=st.binary(max_size=99),
)  # fmt: skip
def test_any_header_of_a_ply_is_read_or_refused(home, kind, counts, rest):
    vertices, faces = counts
    head = f"ply\nformat {kind} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    (home / "model.ply").write_bytes(head.encode() + rest)
    with bounded(SceneError):
        read_model(home / "model.ply")


ROBOT = """<robot name="r"><link name="a"><visual><origin xyz="0 0 0" rpy="0 0 0"/><geometry>
<box size="1 1 1"/></geometry><material name="m"><color rgba="1 1 1 1"/></material></visual></link>
<link name="b"><visual><geometry><capsule radius="1" length="1"/></geometry></visual>
<visual><geometry><mesh filename="m.obj" scale="1 1 1"/></geometry>
</visual></link><joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
<limit lower="1" upper="2"/></joint></robot>"""


@given(place=st.integers(0, 40), new=HOSTILE.map(str), changes=damages())
def test_any_urdf_is_read_or_refused(home, place, new, changes):
    (home / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    pieces = ROBOT.split('"')  # Every second one is the value of an attribute.
    pieces[2 * (place % (len(pieces) // 2)) + 1] = new
    for content in ('"'.join(pieces).encode(), damaged(ROBOT.encode(), changes)):
        (home / "robot.urdf").write_bytes(content)
        with bounded(SceneError):
            urdf.links(home / "robot.urdf", "visual", lambda path: read_model(path).parts)
            urdf.joints(home / "robot.urdf")


def test_a_model_that_asks_for_ten_gigabytes_is_refused(home):
    head = {"accessors": [{"componentType": 5126, "count": 10**9, "type": "VEC3"}], "asset": {"version": "2.0"},
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}], "scene": 0,
            "scenes": [{"nodes": [0]}]}  # fmt: skip
    (home / "large.glb").write_bytes(with_head(b"glTF" + bytes(8) + struct.pack("<II", 2, 0) + b"{}", [0], head))
    with bounded(), pytest.raises(SceneError, match="more than 20,000,000 vertices"):
        read_model(home / "large.glb")


def test_a_model_whose_pieces_share_one_large_array_is_refused(home):
    corners = np.zeros((200_000, 3), np.float32)
    data = written(Mesh(corners, np.array([[0, 1, 2]]), corners[:, :2], np.zeros((1, 1, 3), np.uint8)))
    head = json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]])
    head["meshes"][0]["primitives"] *= 500
    (home / "copies.glb").write_bytes(with_head(data, [], head))
    with bounded(), pytest.raises(SceneError, match="more than 20,000,000 vertices and triangles"):
        read_model(home / "copies.glb")


def test_a_model_of_thousands_of_materials_is_refused(home):
    (home / "pieces.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "".join(f"usemtl {k}\nf 1 2 3\n" for k in range(3001))
    )
    with bounded(), pytest.raises(SceneError, match="more than 3,000 materials"):
        read_model(home / "pieces.obj")
