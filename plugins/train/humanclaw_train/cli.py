"""Commands of this distribution."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar, cast

import click

from humanclaw import Choice, Plugins, Simulator, default_simulator
from humanclaw.body import JOINTS
from humanclaw.cli import plugin_options, seed_option, show_markdown
from humanclaw.motion import PROFILES, DiTGenerator, Solver, load_base, read_header, shipped_base

if TYPE_CHECKING:
    from humanclaw_train.data.chunks import Chunks

F = TypeVar("F", bound=Callable[..., Any])
_FOLDER: Final = click.Path(path_type=Path, exists=True, file_okay=False)
_FILE: Final = click.Path(path_type=Path)
_JSON: Final = click.option("--json", "as_json", is_flag=True, help="Print JSON.")
_OWN: Final = click.option(
    "--skill",
    "folders",
    type=_FOLDER,
    multiple=True,
    metavar="FOLDER",
    help="Folder of a skill of your own; repeatable.",
)
_ADAPTERS: Final = click.option(
    "--adapters", type=_FOLDER, multiple=True, help="Search this folder, not the installed skills; repeatable."
)
_BASE: Final = click.option("--base", type=_FILE, help="Base checkpoint (default: the shipped one).")
_CHUNKS: Final = ".data/chunks"


# -- training ----------------------------------------------------------------------------------------------------------
# No help option of its own: the module defines the options, because it also runs without click.
@click.command(context_settings={"ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": []})
@click.argument("args", nargs=-1, type=click.UNPROCESSED)
def train(args: tuple[str, ...]) -> None:
    """Train the base prior or a skill's adapter."""
    from humanclaw_train.train import main

    sys.exit(main(list(args)))


# -- measuring ---------------------------------------------------------------------------------------------------------
_WEIGHTS: Final = (
    click.option("--skills", default="", metavar="NAME,NAME", help="Skills to measure (default: all with an adapter)."),
    _ADAPTERS,
    _BASE,
    click.option("--rollouts", type=click.IntRange(1), default=200, show_default=True, help="Rollouts per skill."),
    seed_option(help="Seed of all random numbers."),
    click.option("--profile", type=click.Choice([*PROFILES]), default="default", show_default=True, help="Solver."),
    click.option("--method", type=click.Choice(["euler", "midpoint"]), default="midpoint", help="With --steps."),
    click.option("--steps", type=click.IntRange(0), default=0, help="Solver steps instead of the profile's."),
)


def _weights(function: F) -> F:
    """Add the options that choose weights and solver; the command gets `generator`, `paths` and `plugins`."""

    @functools.wraps(function)
    def command(
        skills: str, adapters: tuple[Path, ...], base: Path | None, profile: str, method: Any, steps: int, **more: Any
    ) -> Any:
        from humanclaw_train.eval import rollouts

        plugins = Plugins.discover()
        known = rollouts.adapters(adapters) if adapters else rollouts.installed(plugins)
        solver = Solver(method, steps) if steps else PROFILES[profile].solver
        generator = DiTGenerator(load_base(base or shipped_base()), replace(PROFILES[profile], solver=solver))
        paths = functools.partial(rollouts.wanted, known, [name.strip() for name in skills.split(",") if name.strip()])
        return function(generator=generator, paths=paths, plugins=plugins, **more)

    # An option keeps the command's type, which reduce forgets.
    return functools.reduce(lambda inner, option: option(inner), reversed(_WEIGHTS), command)  # type: ignore[return-value]


def _simulator(plugins: Plugins, name: str = "") -> Simulator:
    simulator: Simulator = plugins.make("simulators", name or default_simulator(plugins), profile="default")
    return simulator


@click.command()
@_weights
@_JSON
@click.option("--simulated", is_flag=True, help="Also measure in half-physics (takes minutes).")
@click.option(
    "--motion-history",
    type=click.Choice(["generated", "simulated"]),
    default="generated",
    show_default=True,
    help="With --simulated: the poses that a motion continues.",
)
@click.option("--baseline", type=_FOLDER, multiple=True, metavar="CHUNKS", help="Chunks for the baseline; repeatable.")
@click.option("--save", type=_FILE, help="Also write the table as JSON, for `humanclaw cards`.")
@_OWN
def fidelity(
    generator: DiTGenerator,
    paths: Callable[[], dict[str, Path]],
    plugins: Plugins,
    rollouts: int,
    seed: int,
    as_json: bool,
    simulated: bool,
    motion_history: str,
    baseline: tuple[Path, ...],
    save: Path | None,
    folders: tuple[Path, ...],
) -> None:
    """Measure how well each skill follows its parameters.

    The table of a skill of your own is saved in its folder.
    """
    from humanclaw_train import markdown
    from humanclaw_train.eval import fidelity as table
    from humanclaw_train.eval.rollouts import Command, in_folders, installed

    wanted = in_folders(folders) if folders else paths()
    commands = [Command.of(skill, path, plugins) for skill, path in wanted.items()]
    # A skill of your own may follow any installed skill of this base.
    other = {skill: path for skill, path in installed(plugins).items() if skill not in wanted} if folders else {}
    fitting = {skill: path for skill, path in other.items() if read_header(path)["base"] == generator.digest}
    before = [Command.of(skill, path, plugins) for skill, path in fitting.items()]
    physics = _simulator(plugins) if simulated else None
    report = table.measured(generator, commands, before, rollouts, seed, baseline, physics, motion_history)
    for path in [save] if save else [folder / table.REPORT for folder in folders]:
        report.save(path)
    if as_json:
        print(markdown.as_json(report))
    else:
        show_markdown(table.markdown(report))


@click.command()
@_weights
@click.option("--chunks", type=_FOLDER, multiple=True, help="Folder of chunks to compare with; repeatable.")
@click.option("--clips", type=_FOLDER, help="Folder with clips.csv, for the gait of real walks.")
@_JSON
@click.option("--bodies", type=click.IntRange(1), default=20, show_default=True, help="Bodies per pair of skills.")
@click.option("--corners", type=click.IntRange(0), default=100, show_default=True, help="Calls at every corner.")
@click.option("--simulator", default="", help="Name of the simulator (default: as in episodes).")
def naturalness(
    paths: Callable[[], dict[str, Path]],
    plugins: Plugins,
    clips: Path | None,
    simulator: str,
    as_json: bool,
    **settings: Any,
) -> None:
    """Compare generated motion with human motion."""
    from humanclaw_train import markdown
    from humanclaw_train.eval.rollouts import Command, Subject
    from humanclaw_train.eval.scenarios import SCENARIOS
    from humanclaw_train.mocap.clips import Folder

    commands = [Command.of(skill, path, plugins) for skill, path in paths().items()]
    walkers = Folder.read(clips) if clips else Folder([])
    for name, reason in walkers.left_out.items():
        print(f"left out: {name} {reason}", file=sys.stderr)
    subject = Subject(
        commands=commands, clips=walkers.clips, plugins=plugins, simulator=_simulator(plugins, simulator), **settings
    )
    tables = {}
    for title, scenario in SCENARIOS.items():
        tables[title] = rows = scenario(subject)
        if rows and not as_json:  # Each at once, because the whole takes minutes.
            show_markdown(f"{title}\n\n{markdown.rows_table(rows)}\n\n")
    if as_json:
        print(markdown.as_json(tables))
    else:
        print(f"{subject.generator.profile.solver}; base {subject.generator.digest}")


@click.command()
@_BASE
@_ADAPTERS
@_OWN
@click.option("--check", is_flag=True, help="Write nothing; exit with 1 if a card is out of date.")
def cards(base: Path | None, adapters: tuple[Path, ...], folders: tuple[Path, ...], check: bool) -> None:
    """Write the model card beside each checkpoint."""
    from humanclaw_train import cards as writing
    from humanclaw_train.eval import rollouts

    shared = base or shipped_base()
    if folders:
        files = [*rollouts.in_folders(folders).values()]
    else:
        known = rollouts.adapters(adapters) if adapters else rollouts.installed(Plugins.discover())
        files = [shared, *rollouts.wanted(known, ()).values()]
    stale = writing.write(files, shared, check)
    for file in files:
        print(writing.unlike(file), end="", file=sys.stderr)
    for path in stale:
        print(f"{'out of date' if check else 'wrote'}: {path}")
    sys.exit(1 if stale and check else 0)


# -- data --------------------------------------------------------------------------------------------------------------
def _reading(command: F) -> F:
    """Give a command the options that say what its motion files do not, as `reading`."""

    @functools.wraps(command)
    def read(up: Any, fps: float | None, joint: tuple[str, ...], **settings: Any) -> None:
        from humanclaw_train.mocap.readers import Reading

        pairs = [pair.partition("=") for pair in joint]
        if wrong := ["".join(pair) for pair in pairs if pair[0] not in JOINTS or not pair[2]]:
            said = f"expected OURS=THEIRS; got {wrong[0]}. Ours are {', '.join(JOINTS)}."
            raise click.BadParameter(said, param_hint="--joint")
        command(reading=Reading(up, fps, tuple((ours, theirs) for ours, _, theirs in pairs)), **settings)

    for option in (
        click.option("--joint", multiple=True, metavar="OURS=THEIRS", help="Name of a joint in the files; repeatable."),
        click.option("--fps", type=click.FloatRange(1), help="Frames a second (default: what each file says)."),
        click.option(
            "--up", type=click.Choice(["x", "y", "z", "-x", "-y", "-z"]), help="Axis that points up (default: found)."
        ),
    ):
        read = option(read)
    return cast(F, read)


@click.group()
def data() -> None:
    """Build training data from motion capture."""


@data.command()
@click.argument("source", type=_FOLDER)
@click.option("--out", type=_FILE, default=_CHUNKS, show_default=True, help="Folder of chunks.")
@click.option(
    "--seconds", type=click.FloatRange(0), default=4000.0, show_default=True, help="Synthetic motion per skill."
)
@_JSON
@_reading
@seed_option(help="Seed of the synthetic motion.")
@click.option("--without", multiple=True, metavar="SOURCE", help="Leave out a source, such as HDM05; repeatable.")
@click.option(
    "--hold-out",
    multiple=True,
    metavar="PATTERN",
    help="Train on no clip whose name matches, such as '*/03/*'; '' for none; repeatable (default: one folder in 20).",
)
def build(source: Path, as_json: bool, hold_out: tuple[str, ...], **settings: Any) -> None:
    """Build the training chunks from a folder of motion capture, such as AMASS's."""
    from humanclaw_train.data import build as building
    from humanclaw_train.synthesis.commands import trained

    chunks, report = building.build(source, skills=trained(Plugins.discover()), hold_out=hold_out or None, **settings)
    _show_statistics(chunks, as_json, report)


@data.command()
@click.option("--skill", "folder", type=_FOLDER, required=True, metavar="FOLDER", help="Folder with its schema.json.")
@click.option("--clips", type=_FOLDER, required=True, help="Folder of motion.")
@click.option("--out", type=_FILE, default=_CHUNKS, show_default=True, help="Folder of chunks.")
@click.option(
    "--seconds",
    type=click.FloatRange(0),
    default=4000.0,
    show_default=True,
    help="Retimed motion to add, for a posture.",
)
@_JSON
@_reading
@seed_option(help="Seed of the retimed motion.")
@_BASE
def chunks(folder: Path, as_json: bool, **settings: Any) -> None:
    """Make the chunks of a skill of your own from a folder of motion."""
    from humanclaw_train.data import custom_skill
    from humanclaw_train.synthesis.commands import Trained

    skill = Trained.read(folder, Plugins.discover().measures)
    made, warnings = custom_skill.saved(skill, **settings)
    _show_statistics({skill.name: made}, as_json)
    for line in warnings:
        print(line, file=sys.stderr)


def _show_statistics(chunks: Mapping[str, Chunks], as_json: bool, report: str = "") -> None:
    from humanclaw_train import markdown
    from humanclaw_train.data import curate

    if as_json:
        print(markdown.as_json(curate.statistics(chunks)))
    else:
        show_markdown(f"{curate.table(chunks)}\n\n{report}")


# -- pictures ----------------------------------------------------------------------------------------------------------
@click.command()
@click.argument("name", type=click.Choice(["5a", "5b", "5c", "5d", "6"]))
@seed_option(help="Seed of the motion.")
@click.option("--out", type=_FILE, help="PNG or JPEG file (default: figure-NAME.png).")
@click.option("--renderer", default="raster", show_default=True, help="Name of the renderer.")
@plugin_options
def figure(name: str, out: Path | None, files: tuple[Path, ...], choice: Choice, **settings: Any) -> None:
    """Draw a figure of the paper: 5 shows skills, 6 half-physics."""
    from humanclaw_train.eval import figures

    plugins = Plugins.discover(files, choice=choice)
    click.echo(figures.figure(plugins, name, out=out or Path(f"figure-{name}.png"), **settings))
