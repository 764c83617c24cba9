"""The reporter of `humanclaw run`: a film, a picture and a page of each recorded episode."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from humanclaw import RecordedEpisode, Renderer
from humanclaw.plugins import Installed
from humanclaw_report.film import FILM_SIZE, GIF_SIZE, film, poster
from humanclaw_report.report import write_report


def report_of(
    run: Path, plugins: Installed, episodes: Sequence[RecordedEpisode] | None = None,
    scored: Mapping[Path, Sequence[object]] | None = None,
) -> Path:  # fmt: skip
    """Write the page of a run with the tables and facts of the installed plugins; return its path.

    episodes: of the run, if they are read already. scored: what a benchmark made of them, likewise.
    """
    return write_report(
        run if episodes is None else {run: episodes},
        None,
        plugins.scene,
        contribute=lambda found, page: plugins.tell(
            "humanclaw_overview", runs=found, page=page, plugins=plugins, scored=scored
        ),
    )


class PageReporter:
    """Writes film.mp4 or film.gif and poster.png beside an episode, and report.html beside the run."""

    def __init__(self, film: str = "mp4", renderer: str = "raster") -> None:
        """film: mp4, gif or none; renderer: name of the renderer that draws it."""
        self._film, self._renderer = film, renderer

    def write(self, run: Path, episode: RecordedEpisode, plugins: Installed) -> dict[str, Path]:
        """Write all files of an episode; return their paths by the name that the terminal shows."""
        # The page embeds film and poster, so they are written first.
        written = self._pictures(episode, plugins) if self._film != "none" else {}
        return written | {"report": report_of(run, plugins)}

    def _pictures(self, episode: RecordedEpisode, plugins: Installed) -> dict[str, Path]:
        scene = plugins.scene(episode.record.spec.scene)
        renderer: Renderer = plugins.make("renderers", self._renderer)
        try:
            picture = poster(episode, scene, renderer, episode.folder / "poster.png")
            kind: Literal["mp4", "gif"] = "gif" if self._film == "gif" else "mp4"
            size = GIF_SIZE if kind == "gif" else FILM_SIZE
            moving = film(episode, scene, renderer, episode.folder / f"film.{kind}", kind=kind, size=size)
        finally:
            renderer.close()
        return {"film": moving, "picture": picture}
