"""The reporter of `humanclaw run`: a film and a page of each recorded episode."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from humanclaw import RecordedEpisode, Renderer
from humanclaw.plugins import Installed
from humanclaw_report.film import FILM_SIZE, GIF_SIZE, film
from humanclaw_report.report import Runs, write_report


def report_of(runs: Path | Sequence[Path] | Runs, plugins: Installed, out: Path | None = None) -> Path:
    """Write the page of a run, or of several, with the tables and facts of the installed plugins; return its path."""
    return write_report(
        runs,
        out,
        plugins.scene,
        contribute=lambda runs_read, page: plugins.tell(
            "humanclaw_overview", runs=runs_read, page=page, plugins=plugins
        ),
    )


class PageReporter:
    """Writes film.mp4 or film.gif beside an episode, and report.html beside the run."""

    def __init__(self, film: str = "mp4", renderer: str = "raster") -> None:
        """film: mp4, gif or none; renderer: name of the renderer that draws it."""
        self._film, self._renderer = film, renderer

    def write(self, run: Path, episode: RecordedEpisode, plugins: Installed) -> dict[str, Path]:
        """Write all files of an episode; return their paths by the name that the terminal shows."""
        # The page embeds the film, so that is written first.
        written = {"film": self._filmed(episode, plugins)} if self._film != "none" else {}
        return written | {"report": report_of(run, plugins)}

    def _filmed(self, episode: RecordedEpisode, plugins: Installed) -> Path:
        scene = plugins.scene(episode.record.spec.scene)
        renderer: Renderer = plugins.make("renderers", self._renderer)
        try:
            kind: Literal["mp4", "gif"] = "gif" if self._film == "gif" else "mp4"
            size = GIF_SIZE if kind == "gif" else FILM_SIZE
            return film(episode, scene, renderer, episode.folder / f"film.{kind}", kind=kind, size=size)
        finally:
            renderer.close()
