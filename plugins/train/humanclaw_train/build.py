"""Build the training chunks: from motion capture to one npz per skill and one for the prior.

    humanclaw data build SOURCE --out .data/chunks

SOURCE contains clips.csv and the archives that it names.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from humanclaw import HumanclawError
from humanclaw.body import FPS, FUTURE
from humanclaw.cli import show_markdown
from humanclaw_train.chunks import CHUNKS, Chunks, Clip, load_pack
from humanclaw_train.commands import Trained
from humanclaw_train.curate import build_real, statistics
from humanclaw_train.synthetic import synthetic_chunks
from humanclaw_train.tables import as_json, table as markdown

HELD_OUT: Final = ("12_*", "131_*", "03_04", "HDM_dg_*", "011_*")
"""Patterns of clips that neither profiles nor weights learn from.

They are all clips of CMU subjects 12 and 131, of HDM05's subject dg and of one idler, and the second of two walks over
blocks, which only one subject did.
"""


def held_out(clip: Clip, patterns: Sequence[str] = HELD_OUT) -> bool:
    """Return whether the clip's name matches one of the patterns."""
    return any(fnmatch(clip.name, pattern) for pattern in patterns)


def build(
    source: Path,
    out: Path,
    skills: Sequence[Trained],
    seconds: float,
    seed: int,
    without: Sequence[str] = (),
    hold_out: Sequence[str] = HELD_OUT,
) -> dict[str, Chunks]:
    """Build real and synthetic chunks and save them as out/<skill>.npz, those of held-out clips in out/held_out.

    seconds: of synthetic motion per skill. without: sources to leave out, such as `HDM05`. hold_out: patterns of names
    of clips.
    """
    every = [clip for clip in load_pack(source) if clip.source not in without]
    # Before anything is measured on clips: profiles of synthetic motion must not see held-out people either.
    clips = [clip for clip in every if not held_out(clip, hold_out)]
    for name, chunks in build_real([clip for clip in every if held_out(clip, hold_out)], skills).items():
        chunks.save(out / "held_out" / f"{name}.npz")
    real = build_real(clips, skills)
    with tqdm(total=100, desc="editing", unit="%") as bar:
        synthetic = synthetic_chunks(
            clips, skills, seconds, seed, lambda done: bar.update(int(100 * done) - bar.n) and None
        )
    names = list(dict.fromkeys((*real, *synthetic)))
    found = {name: Chunks.join(part[name] for part in (real, synthetic) if name in part) for name in names}
    out.mkdir(parents=True, exist_ok=True)
    for name, chunks in found.items():
        chunks.save(out / f"{name}.npz")
    return found


def table(chunks: Mapping[str, Chunks]) -> str:
    """Return statistics as a Markdown table: chunks and seconds, and 5, 50 and 95 % quantiles of parameters in SI.

    Seconds count the futures. Windows of real motion overlap; each of their frames counts once.
    """
    heads = ("skill", "real", "synthetic", "real s", "synthetic s", "parameters: 5 / 50 / 95 %")
    rows = []
    for name, found in statistics(chunks).items():
        spread = "; ".join(
            f"{key} {low:.2f} / {mid:.2f} / {high:.2f}" for key, (_, low, mid, high, _) in found.params.items()
        )
        synthetic = found.chunks - found.real
        cells = (name, found.real, synthetic, f"{found.seconds:.1f}", f"{synthetic * FUTURE / FPS:.1f}", spread or "-")
        rows.append([*map(str, cells)])
    return markdown(heads, rows)


_BARS: Final = " ▁▂▃▄▅▆▇█"
_BINS: Final = 16


def histograms(chunks: Mapping[str, Chunks]) -> str:
    """Return each parameter's histograms over its whole range, real and synthetic, as a Markdown table of bars.

    Bars are relative to the fullest bin of their histogram. A bin that is not empty shows at least the lowest bar.
    """
    rows = []
    for skill, found in chunks.items():
        for column, name in enumerate(found.names.tolist()):
            values = found.params[:, column].astype(float)
            low, high = float(values.min()), float(values.max())
            real, synthetic = (
                _bars(np.histogram(values[mask], _BINS, (low, high))[0]) for mask in (found.real, ~found.real)
            )
            rows.append((f"{skill} {name}", f"{low:.2f}", f"`{real}`", f"`{synthetic}`", f"{high:.2f}"))
    return markdown(("parameter", "least", "real", "synthetic", "most"), rows)


def _bars(counts: NDArray[np.int_]) -> str:
    heights = np.ceil(counts / max(counts.max(), 1) * (len(_BARS) - 1)).astype(int)
    return "".join(_BARS[height] for height in heights)


def main(arguments: Sequence[str] | None = None, skills: Callable[[], Sequence[Trained]] | None = None) -> int:
    """Run the command line. skills: returns the trained skills."""
    parser = argparse.ArgumentParser(prog="humanclaw data build", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("source", type=Path, help="folder with clips.csv and its archives")
    parser.add_argument("--out", type=Path, default=CHUNKS, help=f"folder of chunks (default: {CHUNKS})")
    parser.add_argument("--seconds", type=float, default=4000.0, help="synthetic motion per skill (default: 4000)")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--seed", type=int, default=0, help="seed of the synthetic motion")
    parser.add_argument("--without", nargs="*", default=[], help="sources to leave out, such as HDM05")
    parser.add_argument(
        "--hold-out", nargs="*", default=list(HELD_OUT), help="patterns of names of clips to hold out from training"
    )
    options = parser.parse_args(arguments)
    try:
        if skills is None:
            raise HumanclawError("No skills are known without a plugin host.", "Use the command: humanclaw data build")
        chunks = build(
            options.source, options.out, skills(), options.seconds, options.seed, options.without, options.hold_out
        )
    except HumanclawError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if options.json:
        print(as_json(statistics(chunks)))
    else:
        show_markdown(f"{table(chunks)}\n\n{histograms(chunks)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
