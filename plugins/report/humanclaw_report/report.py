"""Pages of recorded runs: one for each episode, and one for a run of several episodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from tqdm import tqdm

from humanclaw import RecordedEpisode, RecordError, Scene, load_run
from humanclaw.records import REPORT
from humanclaw.storage import Folder, write_result
from humanclaw_report.episode_page import Shared, episode_page, link, skin_script
from humanclaw_report.episode_summary import Facts, episodes_asked
from humanclaw_report.kept_pages import KeptPages, made_of, made_of_house
from humanclaw_report.run_page import Collected, run_page
from humanclaw_report.scene_cache import Houses
from humanclaw_report.three import three

FOLDER: Final = "report"
"""Folder in the run for files that the pages of its episodes share."""
PAGE: Final = "page.html"
"""File in the folder of each episode of a run."""

Runs = Mapping[Path, Sequence[RecordedEpisode]]
Contribute = Callable[[Runs, Collected], None]
"""A function that lets plugins add tables and facts."""


def write_report(
    runs: Path | Sequence[Path] | Runs,
    out: Path | None,
    scenes: Callable[[str], Scene],
    *,
    contribute: Contribute | None = None,
) -> Path:
    """Write the page of a run, or of several runs side by side; return its path.

    The page of a run of one episode is that episode's page, in one self-contained file. The page of a longer run lists
    the episodes, and each episode has a page in its own folder.

    Args:
        runs: Folders, or their episodes by folder.
        out: Where to write; the default is report.html in the run, or in the working folder for several runs.
        scenes: Loads a scene by its reference. If it raises HumanclawError, the page leaves the house out and says so.

    Raises:
        RecordError: There is nothing to report, or the page cannot be written.
    """
    folders = [runs] if isinstance(runs, Path) else list(runs)
    episodes_of = runs if isinstance(runs, Mapping) else {folder: load_run(folder) for folder in folders}
    home = folders[0] if len(folders) == 1 else Path()
    target = out or home / REPORT
    try:
        page = _page(episodes_of, target, Houses(scenes), contribute)
    except OSError as error:
        problem = f"cannot write {error.filename or target}: {error.strerror or error}."
        raise RecordError(problem, "Move it away.") from error
    return write_result(out, home, REPORT, page.encode())


def _page(episodes_of: Runs, target: Path, houses: Houses, contribute: Contribute | None) -> str:
    """Return the page of one episode, or write those of several and return the page that lists them."""
    episodes = [episode for episodes_of_run in episodes_of.values() for episode in episodes_of_run]
    collected = Collected()
    if contribute:
        contribute(episodes_of, collected)
    if len(episodes) == 1:
        (run,) = (run for run, episodes_of_run in episodes_of.items() if episodes_of_run)
        facts = collected.told(run, episodes[0].record.spec.id)
        return episode_page(episodes[0], houses.of(episodes[0]), target, facts=facts)
    _write_episodes(episodes_of, target, houses, collected)
    asked = {run: episodes_asked(run) for run in episodes_of}
    return run_page(episodes_of, collected, target, lambda e: e.folder / PAGE, asked)


def _write_episodes(episodes_of: Runs, target: Path, houses: Houses, collected: Collected) -> None:
    """Write the page of every episode, and the files that the pages of a run share."""
    total = sum(map(len, episodes_of.values()))
    with tqdm(total=total, desc="pages", unit="page", disable=None if total > 20 else True, leave=False) as bar:
        for run, episodes in episodes_of.items():
            kept, shelf = KeptPages(run), Folder(run) / FOLDER
            home = run / REPORT if len(episodes_of) > 1 and Folder(run).has(REPORT) else target
            shelf.write("three.js", three().encode())
            shelf.write("skin.js", skin_script().encode())
            for episode in sorted(episodes, key=lambda e: e.record.spec.scene):
                _write_episode(episode, houses, collected.told(run, episode.record.spec.id), shelf, home, kept)
                bar.update()
            kept.save()


def _write_episode(
    episode: RecordedEpisode, houses: Houses, facts: Facts, shelf: Folder, run: Path, kept: KeptPages
) -> None:
    """Write the page of an episode and the script of its house, unless they are there as they would be written."""
    page, digest = episode.folder / PAGE, episode.record.scene_digest
    same = made_of(episode, link(run, page), facts)
    if kept.has(shelf, _script(digest), made_of_house(digest)) and kept.has(episode.files, PAGE, same):
        return
    drawn = houses.of(episode)
    script, house = _script(drawn.digest), made_of_house(drawn.digest)
    # A file that is there already may be a stranger's script, brought along with records.
    if drawn.digest and not kept.has(shelf, script, house):
        kept.write(shelf, script, drawn.script.encode(), house)
    names = (shelf.path / "three.js", shelf.path / "skin.js", shelf.path / script, run)
    html = episode_page(episode, drawn, page, Shared(*(link(name, page) for name in names)), facts)
    # A house that is missing today may be there tomorrow.
    kept.write(episode.files, PAGE, html.encode(), same if drawn.digest else "")


def _script(digest: str) -> str:
    """Return the name of a house's script."""
    return f"house-{digest[:16] or 'none'}.js"
