"""Check the items of a plugin that are not skills: each is made, and used once as an episode would use it."""

from __future__ import annotations

import logging
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence, Sized
from contextlib import closing, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, Final, TypeVar

import click
import numpy as np

from humanclaw.body.pose import FUTURE, HISTORY, Array, Motion, mirrored, rest_pose
from humanclaw.body.skeleton import JOINT_INDEX
from humanclaw.checks.bounded import OverdueError, bounded
from humanclaw.checks.fakes import ScriptedAgent, fake_body, fake_scene
from humanclaw.checks.motions import gait
from humanclaw.checks.skills import Report
from humanclaw.episodes.embodiment import Body
from humanclaw.episodes.episode import Episode
from humanclaw.episodes.tools import body_tools
from humanclaw.errors import ContractError, HumanclawError, ProviderError, in_words
from humanclaw.plugins.agents import Agent, Verifier
from humanclaw.plugins.choice import Registration
from humanclaw.plugins.hookspecs import OBSERVERS, noun
from humanclaw.plugins.host import Plugins
from humanclaw.records.decisions import Decision
from humanclaw.records.instructions import free_episode
from humanclaw.records.recorded_episode import RecordedEpisode
from humanclaw.records.steps import StepRecord
from humanclaw.skills.call import Call
from humanclaw.skills.contract import Skill
from humanclaw.skills.decorator import skill
from humanclaw.skills.measures import Measure
from humanclaw.skills.plan import Keyframes
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import Execution, WorldState
from humanclaw.world.view import View, ego_camera

T = TypeVar("T")
PATIENCE: Final = 60.0
"""Seconds that an item may take."""
_JUMP: Final = 0.5
"""Metres that a body does not move within a frame."""
_PICTURES: Final = (("rgb", (512, 512, 3), "uint8"), ("depth", (512, 512), "float32"), ("ids", (512, 512), "int32"))


@skill()
def nod() -> Keyframes:
    """Nod the head to agree."""
    return Keyframes.cycle("head", "x", 20, 0.5)


@skill(role="stop")
def finish() -> Keyframes:
    """Declare the task complete."""
    return Keyframes.cycle("head", "x", 5, 0.5)


# -- each kind ---------------------------------------------------------------------------------------------------------
def _agent(make: Callable[..., Any], plugins: Plugins) -> None:
    with fake_body(*_skills(plugins)) as body:
        agent = make({})
        _expect(getattr(agent, "privileged", None), bool, "`privileged`")
        _step(body, agent)


def _verifier(make: Callable[..., Any], plugins: Plugins) -> None:
    with fake_body(*_skills(plugins)) as body:
        verdict = _step(body, ScriptedAgent([Call("nod")]), make({})).verdict
        assert verdict
        _hold(not verdict.failed_open.startswith("replacement"), f"its call is refused: {verdict.failed_open}")


def _step(body: Body, agent: Agent, verifier: Verifier | None = None) -> StepRecord:
    """Play a step of an episode. Raises what agent and verifier raise, ContractError for an illegal call."""
    episode = Episode(body, free_episode("find the chair", body.scene, max_steps=2), agent, verifier, attempts=1)
    if episode.fault:
        raise episode.fault
    with closing(episode):
        step = episode.ask()
    assert isinstance(step, StepRecord)
    _hold(step.call, f"its call is refused: {step.feedback.refusal}")
    return step


def _scene(make: Callable[..., Any], plugins: Plugins) -> None:
    scene, again = (_expect(make("0"), Scene, "the scene") for _ in range(2))
    _hold(scene.digest == again.digest, "the same argument gives another scene the second time")
    for obj in scene.objects:
        _hold(np.isfinite(np.array(scene.aabb(obj.id))).all(), f"object {obj.id} has no finite bounding box")
    for asset in scene.assets.values():
        faces, known = asset.mesh.faces, len(asset.mesh.vertices)
        whole = faces.dtype.kind in "iu" and ((faces >= 0) & (faces < known)).all()
        _hold(whole, f"the faces of asset {asset.name} are no integers from 0 to {known - 1}, its vertices")
    start = [scene.start.x, scene.start.z, scene.start.yaw, scene.start.floor]
    _hold(np.isfinite(start).all(), f"its start is {scene.start}")
    here = np.array([scene.start.x, scene.start.z])
    boxes = [np.array(scene.aabb(obj.id))[:, [0, 2]] for obj in scene.objects]
    held = any((low <= here).all() and (here <= high).all() for low, high in boxes)
    _hold(held, "no object is under its start, so that a body would fall")


def _simulator(make: Callable[..., Any], plugins: Plugins) -> None:
    simulator, scene = make(profile="default"), fake_scene()
    try:
        state = _expect(simulator.reset(scene, scene.start), WorldState, "reset()")
        done = _expect(simulator.execute(rest_pose(FUTURE)), Execution, "execute()")
        _frames(done.simulated, FUTURE, state.body, "execute()")
        _hold(isinstance(simulator.state(), WorldState), "state() returned no WorldState")
    finally:
        simulator.close()


def _renderer(make: Callable[..., Any], plugins: Plugins) -> None:
    renderer, scene = make(), fake_scene()
    try:
        renderer.load(scene)
        state = WorldState(scene.start.to_world(rest_pose()), {})
        seen = _expect(renderer.render(state, ego_camera(state.body)), View, "render()")
        for name, shape, kind in _PICTURES:
            picture = getattr(seen, name)
            fault = f"{name} is {getattr(picture, 'dtype', type(picture))} {np.shape(picture)}; expected {kind} {shape}"
            _hold(np.shape(picture) == shape and picture.dtype == np.dtype(kind), fault)
        _hold((seen.depth >= 0).all(), "depth is negative or NaN; expected metres, infinity where nothing is")
        odd = set(np.unique(seen.ids[seen.ids > 0]).tolist()) - {obj.id for obj in scene.objects}
        _hold(not odd, f"ids name the objects {sorted(odd)[:5]}, which the scene does not have")
    finally:
        renderer.close()


def _generator(make: Callable[..., Any], plugins: Plugins) -> None:
    generator = make(profile="default")
    _expect(generator.digest, str, "digest")
    start = generator.start()
    _frames(start, HISTORY, start, "start()")
    known = [skill for skill in plugins.skills.values() if skill.adapter and skill.trained]
    _hold(known, "no trained skill is installed to play with it")
    middle = {part.name: (part.low + part.high) / 2 for part in known[0].parameters}
    once, again = (generator.generate(start, known[0].adapter, middle, (0, 0, 0)) for _ in range(2))
    _frames(once, FUTURE, start, "generate()")
    same = np.array_equal(once.root, again.root) and np.array_equal(once.rotations, again.rotations)
    _hold(same, "generate() gives another motion for the same key")


def _report(make: Callable[..., Any], plugins: Plugins) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run" / "check"
        with fake_body(nod, finish) as body, Episode(body, _task(body), "check", folder=path) as episode:
            episode.submit(Decision((Call("nod"),)))
        written = make(film="none", renderer="raster").write(path.parent, RecordedEpisode(path), plugins)
        _hold(isinstance(written, Mapping), f"write() returned {written!r} and no mapping of files")
        missing = [str(file) for file in written.values() if not Path(file).exists()]
        _hold(not missing, f"write() names {missing[:1]}, which is no file")


def _framework(make: Callable[..., Any], plugins: Plugins) -> None:
    with fake_body(nod) as body:
        tools = make(body_tools(body))
        _hold(tools is not None and (not isinstance(tools, Sized) or len(tools)), f"its factory returned {tools!r}")


def _measure(measure: Any, plugins: Plugins) -> None:
    measure = _expect(measure, Measure, "register()")
    root, rotations = _crooked()
    values = measure(root, rotations)
    _hold(np.shape(values) == (3,), f"it measures 3 chunks as an array of shape {np.shape(values)}; expected (3,)")
    _hold(np.isfinite(values).all(), "its measure of a walking body is no finite number")
    _hold(measure.unit in ("m", "rad"), f"its unit is {measure.unit!r}; expected m or rad")
    _hold(measure.mirror in (1, -1, None), f"its mirror is {measure.mirror!r}; expected 1, -1 or None")
    image = measure(*mirrored(root, rotations))
    _hold(
        measure.mirror is None or np.allclose(measure.mirror * values, image, atol=1e-6),
        f"mirror={measure.mirror} is no sign of its value in mirrored motion; expected None",
    )


def _crooked() -> tuple[Array, Array]:
    """Return three chunks of a body that walks, turns and drifts to the left with one arm raised."""
    walk, share = gait(3, 0.5), np.linspace(0, 1, HISTORY + FUTURE)
    chunks = [walk[first : first + len(share)] for first in (20, 30, 40)]
    root, rotations = np.stack([chunk.root for chunk in chunks]), np.stack([chunk.rotations for chunk in chunks])
    root[..., 0] += 0.2 * share
    rotations[:, :, 0, 1] += 0.5 * share
    rotations[:, :, JOINT_INDEX["left_shoulder"], 2] += share
    return root, rotations


def _other(value: Any, plugins: Plugins) -> None:
    _hold(callable(value) or not isinstance(value, int | float | str | None), f"it is registered as {value!r}")


CHECKED: Final[Mapping[str, Callable[[Any, Plugins], None]]] = {
    "agents": _agent, "verifiers": _verifier, "scenes": _scene, "simulators": _simulator,
    "renderers": _renderer, "motion_generators": _generator, "reports": _report, "frameworks": _framework,
    "measures": _measure,
}  # fmt: skip
"""What is done with an item of each kind. A plugin's own hooks say it in USES (Plugins.use)."""
_LEFT: Final = ("skills", "priors")
"""Kinds that the host and the checks of skills look at."""


# -- a plugin ----------------------------------------------------------------------------------------------------------
def check_plugin(owner: str, plugin: object, plugins: Plugins) -> list[Report]:
    """Check every item that a plugin registers besides skills, its observers and its commands."""
    kinds = [kind for kind in plugins.kinds if kind not in _LEFT]
    reports = [_item(kind, item, plugins) for kind in kinds for item in plugins.of_owner(owner, kind)]
    if any(hasattr(plugin, hook) for hook in OBSERVERS):
        reports.append(_observers(owner, plugin))
    if hasattr(plugin, "humanclaw_commands"):
        reports.append(_commands(owner, plugin, plugins))
    return reports


def _item(kind: str, item: Registration, plugins: Plugins) -> Report:
    what, use = f"{noun(kind)} {item.name}", CHECKED.get(kind) or plugins.use(kind) or _other
    try:
        bounded(PATIENCE, lambda: use(item.value, plugins))
    except ProviderError as error:
        return Report(what, (), notes=(f"not asked: {error}",))
    except OverdueError as error:
        if kind in ("agents", "verifiers"):  # A person may decide, or a slow model.
            return Report(what, (), notes=(f"not asked to the end: {error}",))
        return Report(what, (ContractError(f"{noun(kind)}-works", f"{what}: {error}.", "Let it return sooner."),))
    except HumanclawError as error:
        # A factory may miss what only a user can give, such as a key. Nothing is asked of items of plugins' own hooks.
        if kind in CHECKED and not isinstance(error, ContractError):
            return Report(what, (), notes=(f"not used: {error}",))
        message = f"{what}: {error.message.rstrip('.')}."
        return Report(what, (ContractError(f"{noun(kind)}-works", message, error.remedy),))
    except (Exception, SystemExit) as error:
        problem = f"{what} raises {in_words(error.__cause__ or error)}."
        return Report(what, (ContractError(f"{noun(kind)}-works", problem, "See its protocol in docs/hooks.md."),))
    return Report(what, ())


def _observers(owner: str, plugin: object) -> Report:
    """Let observers watch an episode of a fake body; the host logs those that fail."""
    heard, log = list[str](), logging.getLogger("humanclaw.plugins.host")

    def listen(record: logging.LogRecord) -> bool:
        heard.append(record.getMessage().rstrip("."))
        return False

    log.addFilter(listen)
    try:
        with fake_body(nod, finish) as body:
            body.plugins.add(plugin, owner)
            with Episode(body, _task(body), "check") as episode:
                episode.submit(Decision((Call("nod"),)))
                episode.submit(Decision((Call("finish"),)))
    finally:
        log.removeFilter(listen)
    faults = tuple(ContractError("observer-works", f"{line}.", "See docs/hooks.md.") for line in dict.fromkeys(heard))
    return Report(f"observer {owner}", faults)


class _Names(click.Group):
    """Counts how often a name is added. `run` is there before any plugin."""

    def __init__(self) -> None:
        super().__init__("humanclaw")
        self.added = Counter(["run"])

    def add_command(self, cmd: click.Command, name: str | None = None) -> None:
        self.added[name or cmd.name or ""] += 1


def _commands(owner: str, plugin: Any, plugins: Plugins) -> Report:
    """Ask each command for its help."""
    group, everyone, faults = click.Group("humanclaw"), _Names(), []
    try:
        plugin.humanclaw_commands(cli=group)
        plugins.tell("humanclaw_commands", cli=everyone)
        taken = [name for name in group.commands if everyone.added[name] > 1]
        if taken:
            problem = f"command {taken[0]} is there already, and would be left out."
            faults.append(ContractError("command-works", problem, "Give it a name of its own."))
        for name, command in group.commands.items():
            _hold(command.help, f"command {name} has no help text")
            silent = [param.opts[0] for param in command.params if isinstance(param, click.Option) and not param.help]
            _hold(not silent, f"option {''.join(silent[:1])} of command {name} has no help text")
            with redirect_stdout(StringIO()):
                command.main(["--help"], prog_name=name, standalone_mode=False)
    except ContractError as error:
        faults.append(ContractError("command-works", f"{error.message}.", "Say in a sentence what it is for."))
    except (Exception, SystemExit) as error:
        message = f"its commands raise {in_words(error)}."
        faults.append(ContractError("command-works", message, "Add click commands to the group."))
    if not group.commands and not faults:
        faults.append(ContractError("command-works", "it adds no command.", "Call cli.add_command(...)."))
    return Report(f"commands of {owner}", tuple(faults))


# -- helpers -----------------------------------------------------------------------------------------------------------
def _skills(plugins: Plugins) -> Sequence[Skill]:
    """Return what agents may call: a nod, a stop, and the installed skills that are trained."""
    trained = [skill for skill in plugins.skills.values() if skill.trained]
    return [nod, finish, *(skill for skill in trained if skill.name not in ("nod", "finish"))]


def _task(body: Body) -> Any:
    return free_episode("nod", body.scene, max_steps=2)


def _frames(motion: object, count: int, before: Motion, what: str) -> None:
    motion = _expect(motion, Motion, what)
    _hold(len(motion) == count, f"{what} returned {len(motion)} frames; expected {count}")
    _hold(np.isfinite(motion.root).all() and np.isfinite(motion.rotations).all(), f"{what} returned NaN or infinity")
    steps = np.linalg.norm(np.diff(np.concatenate([before.root[-1:], motion.root]), axis=0), axis=1)
    _hold(steps.max() < _JUMP, f"{what} moves the pelvis by {steps.max():.1f} m within a frame")


def _expect(value: object, kind: type[T], what: str) -> T:
    _hold(isinstance(value, kind), f"{what} is {str(value)[:80]} and no {kind.__name__}")
    return value  # type: ignore[return-value]  # _hold raises for any other kind.


def _hold(true: object, else_: str) -> None:
    if not true:
        raise ContractError("works", else_, "See its protocol in docs/hooks.md.")
