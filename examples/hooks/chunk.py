"""An observer of half seconds: how far the hips end from where they were commanded."""

import numpy as np

from humanclaw import Chunk, EpisodeRecord, hookimpl


@hookimpl
def humanclaw_chunk(episode: EpisodeRecord, step: int, chunk: Chunk) -> None:
    missed = np.linalg.norm(chunk.commanded.root[-1] - chunk.execution.simulated.root[-1])
    print(f"{episode.spec.id} {step}: the hips are {missed:.2f} m from where they were to be")
