"""The page of one episode: one time line drives the view, the 3D replay, the map and the list of calls.

All facts come from the record; the scene is only needed to draw the house.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

import jinja2
import markupsafe
import numpy as np

from humanclaw import RecordedEpisode, StepRecord
from humanclaw.cli import counted
from humanclaw.records import Usage
from humanclaw.storage import Folder
from humanclaw_report.episode_summary import Facts, in_words, milestones, touches, verdict_of
from humanclaw_report.floor_plan import colour, path_maps
from humanclaw_report.replay import EVERY, as_json, data_uri, person, replay
from humanclaw_report.scene_cache import Drawn
from humanclaw_report.three import three
from humanclaw_report.timeline_markers import marks

PARTS: Final = ("observe", "decide", "verify", "generate", "simulate")
FILM_BYTES: Final = 4_000_000
"""A larger film is linked instead of embedded."""
FRAMES_BYTES: Final = 12_000_000
"""If all views together are larger than this, they are linked instead of embedded."""
_UNTOLD: Final = Facts()


@dataclass(frozen=True)
class Shared:
    """Addresses, relative to the page, of the files that the pages of a run share."""

    three: str
    skin: str
    house: str
    run: str
    """The page of the run."""


@dataclass(frozen=True)
class StepView:
    """One row of the list of calls."""

    record: StepRecord
    picture: str
    """Source of its view: a data URI, a path relative to the page, or empty."""
    verdict_kind: str
    verdict: str
    contacts: str
    colour: str

    @property
    def call(self) -> str:
        return str(self.record.call or "no usable call")


@dataclass(frozen=True)
class Chart:
    """The distance to the target over the time of the episode, drawn in a box of 100 by 30 units."""

    points: str
    top: float
    """The greatest distance, metres."""


@dataclass(frozen=True)
class FilmView:
    """The film of the episode. source: a data URI if it is small enough, else a path relative to the page."""

    kind: str
    source: str
    inside: bool


def episode_page(
    recorded: RecordedEpisode, drawn: Drawn, page: Path, shared: Shared | None = None,
    facts: Facts = _UNTOLD,
) -> str:  # fmt: skip
    """Return the HTML of an episode.

    Args:
        page: Path that it will be written to.
        shared: None for a self-contained page.
        facts: What a benchmark told about the episode.
    """
    met, moving = milestones(recorded, facts.success), replay(recorded, drawn.names, drawn.floors, drawn.open_floor)
    steps = _steps(recorded, drawn.names, page, inside=shared is None)
    others = list(_others(recorded, page, inside=shared is None))
    return (
        environment()
        .get_template("episode.html")
        .render(
            record=recorded.record,
            words=in_words(recorded, met),
            milestones=met,
            times={part: sum(s.seconds.get(part, 0.0) for s in recorded.steps) for part in PARTS},
            usage=sum((step.usage for step in recorded.steps), Usage()),
            steps=steps,
            storeys=path_maps(recorded, drawn.maps, drawn.note),
            empty=drawn.open_floor and not (recorded.record.targets or any(storey.objects for storey in drawn.maps)),
            marks=marks(recorded, drawn.names, facts.cause, facts.step),
            chart=_chart(recorded),
            filmed=_film(recorded.files, page),
            house=drawn.maps if drawn.digest else (),
            parts=PARTS,
            cause=(facts.cause, facts.step),
            shared=shared,
            three="" if shared or not moving else script(three()),
            skin_script="" if shared or not moving else script(skin_script()),
            house_script="" if shared else script(drawn.script),
            replay=as_json(moving),
            moments=as_json(_moments(recorded, steps)),
            others=others,
            others_views=as_json([other["views"] for other in others]),
            frames=moving["frames"] if moving else _last_frame(recorded),
        )
    )


def skin_script() -> str:
    """Return a script that gives the body's skin to the page."""
    return f"window.humanclawSkin = {as_json(person())};"


def script(text: str) -> markupsafe.Markup:
    """Mark a script as safe for a page; escape the tag that would end its element."""
    return markupsafe.Markup(text.replace("</script", "<\\/script"))


def source(name: str) -> markupsafe.Markup:
    """Return one of this package's scripts for a page."""
    return script(resources.files("humanclaw_report").joinpath("scripts", name).read_text("utf-8"))


@cache
def environment() -> jinja2.Environment:
    """Return the templates. Cached: to compile them takes longer than to fill in a page."""
    made = jinja2.Environment(
        loader=jinja2.PackageLoader("humanclaw_report", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,  # A misspelt name in a template is an error, not an empty text.
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals["source"] = source
    made.filters |= {"seconds": _seconds, "counted": counted}
    return made


def _seconds(value: float) -> str:
    if value >= 60:
        return f"{int(value // 60)} min {value % 60:.0f} s"
    return f"{value:.1f} s" if value >= 1 else f"{1000 * value:.0f} ms"


def _steps(recorded: RecordedEpisode, names: Mapping[int, str], page: Path, *, inside: bool) -> list[StepView]:
    pictures = _pictures(recorded, page, inside=inside)
    last = max(1, len(recorded.steps) - 1)
    return [
        StepView(s, pictures[s.step], *verdict_of(s), touches(recorded, s, names), colour(number / last))
        for number, s in enumerate(recorded.steps)
    ]


def _pictures(recorded: RecordedEpisode, page: Path, *, inside: bool) -> dict[int, str]:
    """Return the source of each step's view, by step; empty for a view that was not kept."""
    steps = [step for step in recorded.steps if step.frame_file]
    sizes = {step.step: status.st_size for step in steps if (status := recorded.files.status(step.frame_file))}
    # All or none: a page with half of its views embedded would still need the folder.
    inside = inside and sum(sizes.values()) <= FRAMES_BYTES

    def source(step: StepRecord) -> str:
        return data_uri(recorded.view(step), "image/jpeg") if inside else link(recorded.folder / step.frame_file, page)

    return {step.step: source(step) if step.step in sizes else "" for step in recorded.steps}


def _others(recorded: RecordedEpisode, page: Path, *, inside: bool) -> Iterator[dict[str, Any]]:
    """Yield who each other body was, and what it saw from when on, in frames of the replay."""
    for other in recorded.company().values():
        pictures = _pictures(other, page, inside=inside)
        firsts = zip(other.steps, other.spans, strict=True)
        views = [{"at": first / EVERY, "picture": pictures[step.step]} for step, (first, _) in firsts]
        if kept := [view for view in views if view["picture"]]:
            yield {"agent": other.record.agent, "views": kept}


def link(target: Path, page: Path) -> str:
    """Return the relative address of a file as seen from a page."""
    return quote(Path(os.path.relpath(os.path.realpath(target), os.path.realpath(page.parent))).as_posix())


def _film(files: Folder, page: Path) -> FilmView | None:
    """Return the film in the episode's folder, if there is one."""
    for kind, media in (("mp4", "video/mp4"), ("gif", "image/gif")):
        name = f"film.{kind}"
        if status := files.status(name):
            small = status.st_size <= FILM_BYTES
            address = data_uri(files.read(name, FILM_BYTES), media) if small else link(files.path / name, page)
            return FilmView(kind, address, small)
    return None


# -- data of the script ------------------------------------------------------------------------------------------------
def _moments(recorded: RecordedEpisode, steps: Sequence[StepView]) -> list[dict[str, Any]]:
    """Return what the player shows during each step."""
    return [
        {
            "step": step.record.step,
            "first": first / EVERY,
            "end": end / EVERY,
            "call": step.call,
            "words": step.record.decision.reasoning or step.record.decision.visible_state,
            "touches": step.contacts,
            "distance": _finite(step.record.target_distance),
        }
        for step, (first, end) in zip(steps, recorded.spans, strict=True)
    ]


def _finite(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else round(value, 3)


def _last_frame(recorded: RecordedEpisode) -> int:
    return max(1, recorded.spans[-1][1] // EVERY) if recorded.steps else 1


def _chart(recorded: RecordedEpisode) -> Chart | None:
    last = max(1.0, _last_frame(recorded) - 1.0)
    ends = [min(1.0, end / EVERY / last) for _, end in recorded.spans]
    far = [_finite(step.target_distance) for step in recorded.steps]
    known = [value for value in far if value is not None]
    if not far or len(known) < len(far):
        return None
    top = max(*known, 1e-9)
    return Chart(" ".join(f"{100 * x:.2f},{29 - 28 * y / top:.2f}" for x, y in zip(ends, known, strict=True)), top)
