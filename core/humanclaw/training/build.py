"""Build the training chunks: motion capture in, one npz a skill and one for the prior out.

    humanclaw data build SOURCE --out .data/chunks

SOURCE holds clips.csv and the archives it names, or their unpacked folders.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from tqdm import tqdm

from humanclaw.errors import HumanclawError
from humanclaw.training.chunks import Chunks, load_pack
from humanclaw.training.composer import edited_chunks
from humanclaw.training.curate import build_real, statistics


def build(source: Path, out: Path, seconds: float, seed: int) -> dict[str, Chunks]:
    """Real chunks and edited ones, each marked as what it is, saved as out/<skill>.npz. seconds: of edited motion a skill."""
    clips = load_pack(source)
    real = build_real(clips)
    with tqdm(total=100, desc="editing", unit="%") as bar:
        edited = edited_chunks(clips, seconds, seed, lambda done: bar.update(int(100 * done) - bar.n) and None)
    found = {name: Chunks.join(part[name] for part in (real, edited) if name in part) for name in edited}
    out.mkdir(parents=True, exist_ok=True)
    for name, chunks in found.items():
        chunks.save(out / f"{name}.npz")
    return found


def table(chunks: Mapping[str, Chunks]) -> str:
    """The statistics as a Markdown table: chunks, real ones, and 5-50-95 % of each parameter in SI."""
    lines = ["| skill | chunks | real | real s | parameters: 5 / 50 / 95 % |", "| --- | --- | --- | --- | --- |"]
    for name, found in statistics(chunks).items():
        spread = "; ".join(
            f"{key} {low:.2f} / {mid:.2f} / {high:.2f}" for key, (_, low, mid, high, _) in found.params.items()
        )
        lines.append(f"| {name} | {found.chunks} | {found.real} | {found.seconds:.1f} | {spread or '-'} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="humanclaw data build", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("source", type=Path, help="folder with clips.csv and its archives")
    parser.add_argument("--out", type=Path, default=Path(".data/chunks"))
    parser.add_argument("--seconds", type=float, default=4000.0, help="edited motion a skill")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    try:
        print(table(build(options.source, options.out, options.seconds, options.seed)))
    except HumanclawError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
