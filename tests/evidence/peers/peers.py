"""Measure the body's parts beside other libraries, in turn, and write the end of docs/results/speed.md: `make peers`.

Processor time on one thread, medians, as ratios to ours. The peers have environments of their own, made on first use.
What cannot be installed or started here becomes a line that says so.
"""

from __future__ import annotations

import json
import os
import platform
import re
import subprocess
import sys
import sysconfig
import tempfile
import venv
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from statistics import median
from typing import Final

import platformdirs
from perf import spent
from PIL import Image

HERE: Final = Path(__file__).parent
DOCS: Final = HERE.parents[2] / "docs"
PAGE: Final = DOCS / "results" / "speed.md"
NEEDS: Final = {
    "ours": ("onnxruntime", "onnx", "openvino", "panda3d", "vtk"),
    # robosuite 1.5 fails with later versions of MuJoCo.
    "steps": ("gymnasium[mujoco]", "robosuite", "mujoco==3.3.7"),
    "start": ("llm", "inspect-ai"),
}
ONE: Final = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
# Mesa draws without a display and a graphics card. It counts threads beside the calling one.
MESA: Final = {"EGL_PLATFORM": "surfaceless", "LIBGL_ALWAYS_SOFTWARE": "1", "LP_NUM_THREADS": "0", "MUJOCO_GL": "egl"}
RENDERERS: Final = {
    "ours": "ours",
    "tinydisplay": "Panda3D's tinydisplay (unlit, no depth)",
    "llvmpipe": "Panda3D on llvmpipe (unlit)",
    "vtk": "VTK on llvmpipe (headlight, no shadows)",
    "mujoco": "MuJoCo on llvmpipe (no window light)",
    "tiny": "Bullet's TinyRenderer (no shadows, surfaces flicker)",
}
CPU: Final = Path("/proc/cpuinfo")
ROUNDS: Final = 5
HEADING: Final = "## Beside others"
Lines = Iterator[str]


def environment(name: str) -> Path:
    """Return the programs of a peer's environment, which is made if its list of packages is another."""
    folder = Path(platformdirs.user_cache_dir("humanclaw")) / "peers" / name
    mark, needs = folder / "packages.json", json.dumps(NEEDS[name])
    if not mark.exists() or mark.read_text() != needs:
        venv.create(folder, with_pip=True, clear=True)
        subprocess.run([folder / "bin" / "pip", "install", "--quiet", *NEEDS[name]], check=True)
        if name == "ours":  # The others must not see our packages: a peer would load our plugins or versions.
            (theirs,) = folder.glob("lib/python*/site-packages")
            (theirs / "zz_humanclaw.pth").write_text(f"import site; site.addsitedir({sysconfig.get_path('purelib')!r})")
        mark.write_text(needs)
    return folder / "bin"


def said(command: Sequence[object]) -> str:
    """Return the last line that a command prints. Raises RuntimeError with its last error."""
    done = subprocess.run([*map(str, command)], env={**os.environ, **ONE, **MESA}, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError((done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1][:120])
    return (done.stdout.strip().splitlines() or [""])[-1]


def motion() -> Lines:
    """A chunk of `walk`, base and adapter."""
    rows = json.loads(said([environment("ours") / "python", HERE / "motion.py"]))
    first = next(iter(rows.values()))[0]
    parts = [f"{name} {', '.join(f'{time / first:.2f}' for time in row[::2])}" for name, row in rows.items()]
    most = max(max(row[1::2]) for row in rows.values())
    yield f"A chunk of `walk`, each of 1, 8 and 64 bodies: {'; '.join(parts)}. Outputs differ by {most:.0e} at most."


def views() -> Lines:
    """Colours, depth and ids in one view, and the picture of each."""
    python, side, parts, first = environment("ours") / "python", Image.new("RGB", (320 * len(RENDERERS), 320)), [], 0.0
    for k, (name, title) in enumerate(RENDERERS.items()):
        with tempfile.NamedTemporaryFile(suffix=".png") as picture:
            taken = float(said([python, HERE / "views.py", name, picture.name]))
            side.paste(Image.open(picture.name), (320 * k, 0))
        first = first or taken
        parts.append(f"{title} {taken / first:.2f}")
    side.save(DOCS / "images" / "peers.jpg", quality=75)
    yield f"Views of `house:0` (`docs/images/peers.jpg`), 8 of 512 x 512 (ours {first:.0f} ms): {'; '.join(parts)}."


def physics() -> Lines:
    """Physics beside the bare engine, and a step beside those of other environments."""
    ours = json.loads(said([sys.executable, HERE / "steps.py", "ours"]))
    theirs = json.loads(said([environment("steps") / "python", HERE / "steps.py", "others"]))
    laws = {engine: (ours[f"{engine}, half-physics"], ours[f"{engine}, bare"]) for engine in ("bullet", "mujoco")}
    parts = [f"{engine} {bare:.3f} ms and {law / bare:.2f} times that" for engine, (law, bare) in laws.items()]
    yield f"A substep in `house:0`, bare (limp body; MuJoCo: one step of a walk) and half-physics: {'; '.join(parts)}."
    steps = ours["humanclaw"], theirs["humanoid"], theirs["robosuite"]
    parts = [f"{ms:.2f} ms" for ms in steps]
    works = "ours (0.5 s)", "Gymnasium's Humanoid-v5 (0.015 s)", "robosuite's Lift (0.05 s)"
    yield f"A step, which is other work in each: {'; '.join(map(' '.join, zip(works, parts, strict=True)))}."


def start() -> Lines:
    """Start-up of commands."""
    ours, theirs = Path(sys.executable).with_name("humanclaw"), environment("start")
    runs = [(ours, words) for words in ("--help", "skills", "bench run --help")]
    runs += [(theirs / name, "--help") for name in ("llm", "inspect")]
    times: dict[str, list[float]] = {}
    for path, words in runs * ROUNDS:
        times.setdefault(f"{path.name} {words}", []).append(spent(partial(said, [path, *words.split()])))
    first = median(next(iter(times.values())))
    parts = [f"`{name}` {median(taken) / first:.2f}" for name, taken in times.items()]
    yield f"Start-up (the first {1e3 * first:.0f} ms): {', '.join(parts)}."


def main() -> None:
    names = re.findall(r"model name\s*: (.*)", CPU.read_text()) if CPU.exists() else [platform.processor()]
    when = f"{datetime.now(UTC):%Y-%m-%d}, {names[0]}, {os.cpu_count()} cores"
    lines = [f"{when}, `make peers`: processor time, one thread, medians, ratios to the first.", ""]
    for part in (motion, views, physics, start):
        try:
            lines += [f"* {line}" for line in part()]
        except (RuntimeError, subprocess.CalledProcessError) as fault:
            lines.append(f"* {part.__doc__} Not here: {fault}")
        print(lines[-1], flush=True)
    before, _, _ = PAGE.read_text("utf-8").partition(HEADING)  # The last section.
    PAGE.write_text("\n".join([before + HEADING, *lines, ""]), "utf-8")


if __name__ == "__main__":
    main()
