"""`humanclaw play`: one skill alone, at once, with film and page."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, Literal

import click

from humanclaw.cli.options import engine_options, json_or_text, plugin_options, scene_option, seed_option
from humanclaw.cli.run import PLAYING, claim, end, left_empty, new_folder, numbered, present
from humanclaw.cli.terminal import Console
from humanclaw.episodes.backends import Backends
from humanclaw.episodes.embodiment import Body
from humanclaw.episodes.episode import Episode
from humanclaw.errors import CallError, HumanclawError, PluginError
from humanclaw.plugins.choice import Choice
from humanclaw.plugins.hookspecs import RegisterSkill, hookimpl
from humanclaw.plugins.host import Plugins, load_file, package_in
from humanclaw.records.decisions import Decision
from humanclaw.records.instructions import free_episode
from humanclaw.skills.call import Call
from humanclaw.skills.contract import Skill, suited, untrained
from humanclaw.skills.floor_scenes import FLOOR, SIDE, floor_for
from humanclaw.skills.measures import to_si
from humanclaw.text.words import did_you_mean

Beginning = Literal["standing", "walking", "sitting"]
_SEAT: Final = 0.5
_STRIDE: Final = 0.4
"""Metres: height of the hips, and of half a second of walking, before a skill that is played from there."""
_BEHIND: Final = 0.5
"""Metres left to the wall after steps back: the body coasts, and its hips are not its heels."""
_LONGEST, _ROOM = 0.8, 2.0
"""Metres: the longest stride, and the floor beyond the last."""


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("target", metavar="FILE|FOLDER|NAME")
@click.argument("words", nargs=-1, type=click.UNPROCESSED, metavar="[PARAMETER=VALUE]...")
@click.option("--calls", "count", type=click.IntRange(1, 100), default=1, show_default=True, help="Calls in a row.")
@click.option(
    "--from",
    "beginning",
    type=click.Choice(["standing", "walking", "sitting"]),
    default="standing",
    show_default=True,
    help="What the body does before, by skills that are installed.",
)
@click.option("--skill", default="", metavar="NAME", help="Which skill, if the file or folder holds several.")
@scene_option(default=FLOOR, about="Where: source:argument. The floor gets what the call needs, such as stairs.")
@engine_options
@click.option("--renderer", default=Backends.renderer, show_default=True, help="Renderer by name.")
@seed_option(help="All randomness derives from it.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder of the record; the default is a new one in runs/.")
@click.option("--film", type=click.Choice(["mp4", "gif", "none"]), default="mp4", show_default=True)
@plugin_options
def play(
    target: str,
    words: Sequence[str],
    count: int,
    beginning: Beginning,
    skill: str,
    reference: str,
    simulator: str,
    generator: str,
    prior: str,
    renderer: str,
    seed: int,
    out: Path | None,
    film: str,
    files: tuple[Path, ...],
    choice: Choice,
) -> None:
    """Play one skill with these parameters, and film it. No agent, no task."""
    console = Console(markup=False, emoji=False, highlight=False)
    plugins, chosen = _found(target, skill, files, choice)
    calls = [*_before(beginning, plugins), *[_call(chosen, words)] * count]
    if not chosen.trained:
        raise untrained(chosen)
    if chosen.name not in plugins.skills:
        raise HumanclawError(f"--skills leaves out {chosen.name}, which is to be played.", "Name it there as well.")
    backends = Backends(simulator, renderer, generator, sensors=("vision", "body", "touch"), prior=prior)
    scene = plugins.scene(_floor_for(chosen, calls[-1], count, beginning) if reference == FLOOR else reference)
    out = out or new_folder(chosen.name)
    name = next(name for name in numbered(f"{chosen.name}-{seed}") if not (out / name).exists())
    spec = free_episode(f"Play {calls[-1]}.", scene, seed=seed, max_steps=len(calls), name=name)
    claim(out / spec.id)
    with (
        console.status(PLAYING),
        left_empty(out / spec.id),
        Body(scene, seed=seed, plugins=plugins, backends=backends) as body,
        Episode(body, spec, "play", folder=out / spec.id) as episode,
    ):
        for call in calls:
            episode.submit(Decision((call,)))
            console.print(str(episode.steps[-1].feedback), soft_wrap=True)
    present(plugins, backends, out, out / spec.id, film, console)
    end(episode.record, episode.steps)


def _found(target: str, skill: str, files: tuple[Path, ...], choice: Choice) -> tuple[Plugins, Skill]:
    """Return the plugins and the skill of a file, a skill folder, or a name."""
    path, plugins = Path(target), Plugins.discover(files, choice)
    # What the path holds is meant, also where its published distribution is installed: first=True.
    if path.is_dir() and any(path.rglob("schema.json")):
        name = path.resolve().name
        folders = sorted(file.parent for file in path.rglob("schema.json"))
        plugins.add(_Folders(folders), name, origin=str(path), first=True)
        return plugins, _one_of(plugins, name, skill)
    if path.suffix or path.exists():
        path = package_in(path)
        plugins.add(load_file(path), path.stem, origin=str(path), first=True)
        return plugins, _one_of(plugins, path.stem, skill)
    try:
        return plugins, plugins.skill(target)
    except PluginError as error:
        near = did_you_mean(target, (file.name for file in Path().glob("*.py")))
        if near and error.remedy.startswith("Known: "):
            raise HumanclawError(error.message, near) from None
        raise


def _one_of(plugins: Plugins, owner: str, wanted: str) -> Skill:
    """Return the wanted skill of a plugin, or its only one. Raises HumanclawError if it has several or none."""
    names = [item.name for item in plugins.of_owner(owner, "skills")]
    if not names and (faulty := plugins.info(owner).disabled):
        raise HumanclawError("\n".join(faulty.values()))
    if not wanted and len(names) != 1:
        listed = f"--skill NAME: {', '.join(names)}" if names else "a file whose hook humanclaw_skills registers one"
        raise HumanclawError(f"{owner} holds {len(names)} skills; expected one.", f"Name {listed}.")
    return plugins.skill(f"{owner}:{wanted or names[0]}")


class _Folders:
    """A plugin that registers skill folders."""

    def __init__(self, folders: Sequence[Path]) -> None:
        self._folders = folders

    @hookimpl
    def humanclaw_skills(self, register: RegisterSkill) -> None:
        for folder in self._folders:
            register(folder)


def _call(skill: Skill, words: Sequence[str]) -> Call:
    """Return the checked call. Raises HumanclawError, with the usage, for parameters outside the schema."""
    known = skill.schema.get("properties", {})
    params = dict(_pairs(words, known))
    try:
        return Call(skill.name, skill.check(params))
    except CallError as error:
        unknown = [key for key in params if key not in known]
        raise HumanclawError(str(error), did_you_mean(unknown[0], known) if unknown else "") from None


def _pairs(words: Sequence[str], known: Container[str]) -> Iterator[tuple[str, Any]]:
    """Yield name and value of each parameter. known: names of parameters, for the remedy."""
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or not name.isidentifier():
            meant = word[2:].split("=")[0].replace("-", "_") if word.startswith("--") else "PARAMETER"
            message = f"expected PARAMETER=VALUE, or an option of `humanclaw play`; got {word!r}."
            listed = meant not in known and meant != "PARAMETER"
            remedy = "`humanclaw play --help` lists the options." if listed else f"Write {meant}=VALUE."
            raise HumanclawError(message, remedy)
        yield name, json_or_text(value)


def _before(beginning: Beginning, plugins: Plugins) -> list[Call]:
    """Return the calls that bring the body to where the skill begins."""
    ready = [skill for skill in plugins.skills.values() if skill.trained]
    if beginning == "standing":
        return []
    walks, sits = suited(ready, "hips.forward"), suited(ready, "hips.height", role="sit")
    if beginning == "walking" and walks:
        return [walks.call({"hips.forward": _STRIDE})] * 2
    if beginning == "sitting" and sits:
        return [sits.call({"hips.height": _SEAT})]
    needed = "goes forward" if beginning == "walking" else "sits"
    raise HumanclawError(f"no skill that {needed} is installed.", "Leave out --from.")


def _floor_for(skill: Skill, call: Call, count: int, beginning: Beginning) -> str:
    """Return the floor with what the calls need: a seat, stairs, a wall that they step back to, or room to walk."""
    commanding = [parameter for parameter in skill.parameters if parameter.measure]
    values = {parameter.name: to_si(parameter.key, call.params.get(parameter.key, 0)) for parameter in commanding}
    if beginning == "sitting":
        return f"{FLOOR}:sit={_SEAT}"
    # Nobody knows to the centimetre where the strides before it end, so stairs would be missed.
    needed = floor_for(skill, values, count) if beginning == "standing" else ""
    if back := skill.commands("hips.back"):
        needed = f"wall={values[back.name] * count + _BEHIND:g}"
    wide = 2 * (_LONGEST * count + _ROOM)
    return f"{FLOOR}:{needed or (f'side={wide:g}' if wide > SIDE else '')}".removesuffix(":")
