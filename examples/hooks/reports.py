"""A reporter that writes every call on a line."""

from collections.abc import Mapping
from pathlib import Path

from humanclaw import RecordedEpisode, hookimpl
from humanclaw.plugins import Installed, Register, ReporterFactory


class Lines:
    def write(self, run: Path, episode: RecordedEpisode, plugins: Installed) -> Mapping[str, Path]:
        path = episode.folder / "calls.txt"
        path.write_text("".join(f"{step.feedback}\n" for step in episode.steps))
        return {"the calls": path}


@hookimpl
def humanclaw_reports(register: Register[ReporterFactory]) -> None:
    register("lines", lambda film="mp4", renderer="raster": Lines(), "every call on a line")
