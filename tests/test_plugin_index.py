"""An index of plugins: made from wheels without running them, searched, and installed from by pip."""

import hashlib
import json
import os
import shlex
import shutil
import subprocess
import sys
import threading
import tomllib
import zipfile
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.metadata import distribution
from pathlib import Path

import pytest
from click.testing import CliRunner
from wheels import ROOT, distributions

from humanclaw import Plugins
from humanclaw.cli import build
from humanclaw.errors import HumanclawError
from humanclaw.plugins.index import LARGEST, SHIPPED, Index, requirement

STOP = ROOT / "skills/stop/humanclaw_skill_stop/stop"
HOOK = "def humanclaw_agents(register): pass\n"


def wheel(folder: Path, name="acme", files=None, metadata="", file="") -> Path:
    """Write a wheel whose module would exit the program if it ran."""
    path = folder / (file or f"{name}-1.0-py3-none-any.whl")
    info = f"{name}-1.0.dist-info"
    told = metadata or f"Metadata-Version: 2.4\nName: {name}\nVersion: 1.0\nSummary: Waves.\nLicense-Expression: MIT\n"
    tags = "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
    parts = {f"{name}.py": f"raise SystemExit\n{HOOK}", f"{info}/METADATA": told, f"{info}/WHEEL": tags}
    parts |= {f"{info}/RECORD": ""} | (files or {})
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for member, content in parts.items():
            archive.writestr(member, content)
    return path


def skill(name="halt", **changed) -> dict[str, str]:
    texts = {one: (STOP / one).read_text() for one in ("schema.json", "checklist.toml")} | changed
    return {f"acme/{name}/{file}": text for file, text in texts.items()}


def command(*words) -> tuple[int, str]:
    done = CliRunner().invoke(build(cache(Plugins.discover)), ["plugins", *map(str, words)])
    return done.exit_code, done.output


def made(folder: Path) -> Index:
    code, said = command("index", folder)
    assert code == 0, said
    return Index.read(str(folder / "index.json"))


def test_a_wheel_is_indexed_with_its_licence_hooks_and_checks_and_does_not_run(tmp_path):
    path = wheel(tmp_path, files=skill() | skill("worse", **{"checklist.toml": "[[check]]\nid = 3\n"}))
    (entry,) = made(tmp_path).plugins
    assert (entry.name, entry.version, entry.summary, entry.licence) == ("acme", "1.0", "Waves.", "MIT")
    assert entry.hooks == ("agents",)
    halt, worse = entry.skills
    assert (halt.name, halt.faults, worse.faults) == ("halt", ("adapter-there",), ("checklist-tables", "adapter-there"))
    assert entry.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_a_trained_skill_is_measured_and_names_the_licences_of_its_data(tmp_path):
    turn = ROOT / "skills/turn/humanclaw_skill_turn/turn_in_place"
    files = {f"acme/turn_in_place/{one.name}": one.read_bytes() for one in turn.iterdir() if one.is_file()}
    wheel(tmp_path, files=files)
    ((turned,),) = (one.skills for one in made(tmp_path).plugins)
    assert turned.faults == ()
    assert turned.fidelity["yaw_deg"].slope == pytest.approx(1, abs=0.05)
    assert turned.fidelity["yaw_deg"].error < turned.fidelity["yaw_deg"].constant / 10
    assert any("MIT" in one for one in turned.data)


def test_a_skill_whose_measure_is_code_of_the_wheel_is_listed_unchecked(tmp_path):
    schema = '{"type": "object", "properties": {"h_cm": {"type": "integer", "x-measure": "ears.height"}}}'
    wheel(tmp_path, files=skill(**{"schema.json": schema}))
    ((one,),) = (entry.skills for entry in made(tmp_path).plugins)
    assert one.unchecked.startswith("ears.height")


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ({"files": {"acme/x/schema.json": "0" * (2 << 20)}}, "larger than 1 MB"),
        ({"files": {"acme/../../schema.json": "{}"}}, "folder has the name '..'"),
        ({"files": {f"acme/{k}.txt": "" for k in range(5001)}}, "more than 5000 files"),
        ({"files": {f"acme/s{k}/schema.json": "{}" for k in range(51)}}, "more than 50 skills"),
        ({"files": {"acme.py": "print(1)"}}, "no plugin"),
        ({"metadata": "Name: other\nVersion: 1.0\n"}, "another distribution"),
        ({"metadata": "Name: acme\nVersion: 1.0\nSummary: \x1b[2J\n"}, "summary"),
        ({"file": "acme.whl"}, "Invalid wheel filename"),
    ],
)  # fmt: skip
def test_a_hostile_wheel_is_left_out_with_the_reason_and_harms_no_other(tmp_path, fault, said):
    wheel(tmp_path, **fault)
    wheel(tmp_path, "zebra")
    code, told = command("index", tmp_path)
    assert code == 0
    assert "left out: acme" in told
    assert said in told
    assert [one.name for one in Index.read(str(tmp_path / "index.json")).plugins] == ["zebra"]


def test_what_is_no_zip_is_left_out(tmp_path):
    (tmp_path / "acme-1.0-py3-none-any.whl").write_bytes(b"PK\x03\x04 and nothing")
    code, told = command("index", tmp_path)
    assert code == 2
    assert "left out: acme" in told


A = {"name": "a", "version": "1"}


@pytest.mark.parametrize(
    ("plugins", "said"),
    [
        ([{}], "name"),
        ([A | {"name": "-r"}], "name"),
        ([A | {"wheel": "file:///etc/x.whl"}], "wheel"),
        ([A | {"wheel": "a-1.tar.gz"}], "wheel"),
        ([A | {"summary": "\x1b[2J"}], "summary"),
        ([A, {"name": "A", "version": "2"}], "twice"),
        ([A | {"name": f"a{n}"} for n in [*range(50_000), 7]], "a7 occurs twice"),
        ("[" * LARGEST, "larger than"),
    ],
)
def test_a_strangers_index_is_validated(tmp_path, plugins, said):
    (tmp_path / "index.json").write_text(json.dumps({"format": "humanclaw-plugins-1", "plugins": plugins}))
    with pytest.raises(HumanclawError, match=said):
        Index.read(str(tmp_path / "index.json"))


def test_addresses_without_encryption_and_wheels_without_a_digest_are_refused(tmp_path):
    with pytest.raises(HumanclawError, match="not encrypted"):
        Index.read("http://example.org/index.json")
    wheel(tmp_path)
    text = made(tmp_path).json().decode()
    (entry,) = made(tmp_path).plugins
    for odd in (
        text.replace(entry.sha256, ""),
        *(text.replace(entry.wheel, f"x/{up}/{up}/{entry.wheel}") for up in ("..", "%2e%2E", ".%2e")),
    ):
        (tmp_path / "odd.json").write_text(odd)
        with pytest.raises(HumanclawError, match="no digest, or leads out"):
            requirement(*Index.read(str(tmp_path / "odd.json")).plugins, str(tmp_path / "odd.json"))


@pytest.fixture
def moved():
    """The address of an index that sends whoever asks to another host, without encryption; /odd answers no HTTP."""

    class Moved(BaseHTTPRequestHandler):
        def do_GET(self):
            if self.path == "/odd":
                self.wfile.write(b"odd\r\n")
                return
            self.send_response(302 if self.path == "/first" else 200)
            self.send_header("Location", f"http://127.0.0.2:{serving.server_port}/second")
            self.end_headers()
            self.wfile.write(b'{"format": "humanclaw-plugins-1", "plugins": []}')

        def log_message(self, *args): ...

    with ThreadingHTTPServer(("0.0.0.0", 0), Moved) as serving:
        threading.Thread(target=serving.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{serving.server_port}/first"
        serving.shutdown()


@pytest.mark.integration
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere 127.0.0.2 is not this machine")
def test_an_index_that_sends_us_to_an_address_without_encryption_is_refused(moved):
    with pytest.raises(HumanclawError, match=r"127\.0\.0\.2.* is not encrypted"):
        Index.read(moved)


@pytest.mark.integration
def test_what_answers_no_http_and_what_is_no_address_are_told(moved):
    for place in (moved.replace("first", "odd"), "https://["):
        with pytest.raises(HumanclawError, match="does not answer"):
            Index.read(place)


@pytest.mark.integration
def test_nothing_of_the_current_folder_runs_when_pip_does(tmp_path):
    (tmp_path / "pip.py").write_text("print('a stranger was here')")
    (tmp_path / "one.json").write_text(json.dumps({"format": "humanclaw-plugins-1", "plugins": [A | {"name": "a.b"}]}))
    ours = [shutil.which("humanclaw", path=str(Path(sys.executable).parent)), "plugins", "install", "a.b", "--index"]
    offline = {**os.environ, "PIP_NO_INDEX": "1"}
    done = subprocess.run([*ours, "one.json"], cwd=tmp_path, env=offline, capture_output=True, text=True, check=False)
    assert "No matching distribution found for a.b==1" in done.stderr
    assert "stranger" not in done.stdout


@pytest.mark.integration
def test_pip_installs_what_the_index_names_and_refuses_another_wheel(tmp_path):
    path = wheel(tmp_path)
    wanted = requirement(*made(tmp_path).plugins, str(tmp_path / "index.json"))
    pip = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--no-index",
        "--no-deps",
        "--target",
        str(tmp_path / "there"),
        wanted,
    ]
    done = subprocess.run(pip, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "there/acme.py").is_file()
    path.write_bytes(path.read_bytes() + b" ")
    assert "HASH" in subprocess.run(pip, capture_output=True, text=True, check=False).stderr.upper()


def test_search_finds_what_holds_every_word_and_install_names_the_nearest(tmp_path):
    wheel(tmp_path, files=skill("crouch"))
    wheel(tmp_path, "zebra")
    made(tmp_path)
    place = ("--index", tmp_path / "index.json")
    assert "acme 1.0 (MIT)" in command("search", "crouch", *place)[1]
    assert "zebra" not in command("search", "crouch", *place)[1]
    assert "None of 2 plugins has hop" in command("search", "hop", *place)[1]
    assert f"pip install 'acme @ {tmp_path.as_uri()}/acme" in command("install", "acme", "--dry-run", *place)[1]
    assert "Did you mean acme?" in command("install", "acne", *place)[1]


def test_a_first_party_plugin_comes_from_the_checkout_while_no_package_index_has_it():
    *_, asked = shlex.split(command("install", "humanclaw-skill-crouch", "--dry-run")[1])
    assert "-e" in command("install", "humanclaw-skill-crouch", "--dry-run")[1]
    assert Path(asked, "pyproject.toml").samefile(ROOT / "skills/crouch/pyproject.toml")


def test_the_shipped_index_has_every_first_party_plugin_with_its_version_and_licence():
    entries = {one.name: one for one in Index.read(str(SHIPPED)).plugins}
    projects = [tomllib.loads((one / "pyproject.toml").read_text("utf-8"))["project"] for one in distributions()[1:]]
    names = {one["name"] for one in projects}
    assert names - {*entries} <= {"humanclaw-gymnasium", "humanclaw-verifiers"}, "Run `make index`."
    assert {*entries} <= names
    for name, entry in entries.items():
        assert entry.version == distribution("humanclaw").version
        assert entry.licence == "Apache-2.0"
        assert [one.name for one in entry.skills if one.faults] == [], name
    skills = {one.name for entry in entries.values() for one in entry.skills}
    assert skills == {path.parent.name for path in ROOT.glob("skills/*/*/*/schema.json")}
