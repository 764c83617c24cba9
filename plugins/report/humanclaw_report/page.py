"""What `humanclaw run` makes of an episode once it is recorded: a film, a picture and the page that shows them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from humanclaw import RecordedEpisode, Renderer
from humanclaw.plugins import Installed
from humanclaw_report.film import FILM_SIZE, GIF_SIZE, film, poster
from humanclaw_report.report import write_report


def report_of(run: Path, plugins: Installed) -> Path:
    """Write the page of a run with what plugins add to it."""
    return write_report(
        run,
        None,
        plugins.scene,
        contribute=lambda found, page: plugins.tell("humanclaw_overview", runs=found, page=page),
    )


class PageReporter:
    """Writes film.mp4 or film.gif and poster.png beside an episode, and report.html beside the run."""

    def __init__(self, film: str = "mp4", renderer: str = "raster") -> None:
        """film: mp4, gif or none."""
        self._film, self._renderer = film, renderer

    def write(self, run: Path, episode: RecordedEpisode, plugins: Installed) -> dict[str, Path]:
        """Film and poster first: the page embeds them. Returns what was written, by what a person calls it."""
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
