"""Options that several commands share."""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

import click

from humanclaw.episodes.backends import MOTION_HISTORIES, SENSORS, Backends
from humanclaw.errors import HumanclawError, PluginError, PluginRunError, blaming
from humanclaw.records.limits import check_limits
from humanclaw.text.words import did_you_mean

if TYPE_CHECKING:
    from humanclaw.plugins.agents import Agent, Verifier
    from humanclaw.plugins.host import Plugins

INTERRUPTED: Final = 130
"""Exit code after Ctrl-C: 128 plus the number of the signal."""
F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class ChosenAgents:
    """Agent and verifier with their options and limits, as the command line names them."""

    agent: str
    verifier: str
    """Empty for none."""
    options: Mapping[str, Any]
    """Options for the factories of agent and verifier."""
    limits: Mapping[str, float]

    @property
    def title(self) -> str:
        """The name to show: the model's, if one was named, since one agent asks many."""
        return str(self.options.get("model") or self.agent)

    def make(self, plugins: Plugins) -> tuple[Agent, Verifier | None]:
        """Make agent and verifier. Raises HumanclawError for an option that neither knows."""
        verifier = plugins.make("verifiers", self.verifier, self.options) if self.verifier else None
        agent = plugins.make("agents", self.agent, self.options)
        check_options(self.options, self.agent, agent, verifier)
        return agent, verifier

    def other(self, name: str, plugins: Plugins) -> ChosenAgents:
        """Return the agents of a second body: an agent of this name, or else a model."""
        profile = {"profile": self.options["profile"]}
        if any(offer.name == name for offer in plugins.registered("agents")):
            return ChosenAgents(name, "", profile, self.limits)
        return ChosenAgents("litellm", "", profile | {"model": name}, self.limits)


def advice_after(refusal: str) -> str:
    """Return why the last answer was refused, and what to try where no answer holds a usable call."""
    return (
        f"The last was refused: {refusal.rstrip('.')}. "
        "Try another way of asking (--option mode=prompt), a larger max_tokens, or another model."
    )


def _named(context: click.Context, option: click.Parameter, name: str | None) -> str:
    """Refuse a name that is given but empty, as from a variable of the shell that is not set."""
    if name == "":
        raise HumanclawError(f"--{option.name} is empty.", "Name one, or leave the option out.")
    return name or ""


SIMULATOR_HELP: Final = "Simulator by name. The default is bullet if it is installed, otherwise mujoco."
_ENGINES: Final = (
    click.option("--simulator", default="", help=SIMULATOR_HELP),
    click.option(
        "--generator",
        default=Backends.generator,
        show_default=True,
        help="Motion generator by name.",
    ),
    click.option(
        "--prior",
        default=Backends.prior,
        show_default=True,
        help="Motion prior of the generator, by name.",
    ),
)
_AGENT_OPTIONS: Final = (
    click.option(
        "--agent",
        callback=_named,
        help="Agent by name; the default is oracle, or the model if one is named.",
    ),
    click.option(
        "--model",
        callback=_named,
        help="Any litellm model that can call tools, such as openai/gpt-5 or ollama_chat/qwen3-vl.",
    ),
    click.option(
        "--verifier",
        callback=_named,
        help="Verifier by name, or none. The default is the model's own, if one is named.",
    ),
    click.option("--no-verifier", is_flag=True, help="Same as --verifier none."),
    click.option(
        "--no-mid-level", "mid_level", flag_value=False, default=None, help="The agent keeps no mid-level goal."
    ),
    click.option("--history", type=click.IntRange(0), help="Number of past steps in the agent's prompt."),
    click.option("--images", type=click.IntRange(0), help="Number of views in the prompt, the current one included."),
    click.option(
        "--profile",
        type=click.Choice(["default", "paper"]),
        default="default",
        show_default=True,
        help="Settings of simulator, motion solver and agent, not of skills (--skills). Switches above override it.",
    ),
    *_ENGINES,
    click.option(
        "--gaze",
        type=click.Choice(["body", "far"]),
        default=Backends.gaze,
        show_default=True,
        help="Where the eyes look: with the own body in view, or farther ahead.",
    ),
    click.option(
        "--motion-history",
        type=click.Choice(MOTION_HISTORIES),
        default=Backends.motion_history,
        show_default=True,
        help="The poses that a motion continues: the motion model's own, or the simulated body's.",
    ),
    click.option(
        "--renderer",
        default=Backends.renderer,
        show_default=True,
        help="Renderer by name.",
    ),
    click.option(
        "--sensor",
        "sensors",
        type=click.Choice(SENSORS),
        multiple=True,
        help="Sense besides the view, which is always on. Repeatable.",
    ),
    click.option("--option", "pairs", multiple=True, metavar="KEY=VALUE", help="Any option of the agent. Repeatable."),
    click.option(
        "--limit",
        "limits",
        multiple=True,
        metavar="SCOPE.UNIT=N",
        help="Maximum seconds, tokens or usd of a call, episode or run (episode.usd=0.5). Repeatable.",
    ),
)


seed_option = functools.partial(click.option, "--seed", type=click.IntRange(0), default=0, show_default=True)
"""Option for a seed; give it its help."""


def engine_options(function: F) -> F:
    """Add --simulator and --generator, for commands without an agent."""
    return functools.reduce(lambda wrapped, option: option(wrapped), reversed(_ENGINES), function)


def agent_options(function: F) -> F:
    """Add the options for agent, verifier and body. The command gets them as `agents` and `backends`."""

    @functools.wraps(function)
    def command(
        *args: Any,
        agent: str,
        model: str,
        verifier: str,
        no_verifier: bool,
        mid_level: bool | None,
        history: int | None,
        images: int | None,
        profile: str,
        simulator: str,
        generator: str,
        prior: str,
        gaze: str,
        motion_history: str,
        renderer: str,
        sensors: Sequence[str],
        pairs: Sequence[str],
        limits: Sequence[str],
        **rest: Any,
    ) -> Any:
        switches = {"model": model or None, "history": history, "images": images, "mid_level": mid_level}
        given = {key: value for key, value in switches.items() if value is not None}
        options = {"profile": profile} | parse_pairs(pairs) | given
        verifier = "none" if no_verifier else verifier or ("litellm" if model else "none")
        agents = ChosenAgents(
            agent or ("litellm" if model else "oracle"),
            "" if verifier == "none" else verifier,
            options,
            parse_limits(limits),
        )
        backends = Backends(simulator, renderer, generator, profile, tuple(sensors), prior, gaze, motion_history)
        return function(*args, agents=agents, backends=backends, **rest)

    # An option keeps the command's type, which reduce forgets.
    return functools.reduce(lambda wrapped, option: option(wrapped), reversed(_AGENT_OPTIONS), command)  # type: ignore[return-value]


def check_options(options: Mapping[str, Any], name: str, agent: object | None, verifier: object | None) -> None:
    """Raise HumanclawError for an option that neither agent nor verifier knows: it may be misspelt.

    name: of the agent, or of the verifier where there is no agent.

    The keys of their `settings` are the known options; without settings, any option passes. Raises PluginError if
    reading the settings fails.
    """
    parts = [part for part in (agent, verifier) if part is not None]
    known_names = [_settings(part) for part in parts]
    if None in known_names:
        return
    known = {"profile", *(key for names in known_names for key in names or ())}
    # Known without a verifier too, so that --no-verifier can be added to a working command.
    known |= {f"verifier_{key}" for key in known}
    for key in options:
        if key not in known:
            whose = f"verifier {name}" if agent is None else f"agent {name}" + (" and its verifier" if verifier else "")
            raise HumanclawError(f"there is no option {key!r} for {whose}.", _nearest(key, known))


def _settings(agent: object) -> tuple[str, ...] | None:
    """Return the names of the settings of an agent or a verifier; None if it has none."""
    from humanclaw.plugins.validation import origin

    try:
        with blaming(origin(agent)):
            return tuple(map(str, agent.settings)) if hasattr(agent, "settings") else None
    except PluginRunError as fault:
        raise PluginError(f"{fault}, when it was asked for its settings.", "Give it a mapping as settings.") from fault


def _nearest(key: str, known: Collection[str]) -> str:
    context = click.get_current_context(silent=True)
    flags = [flag for part in (context.command.params if context else ()) for flag in part.opts]
    flag = f"--{key.replace('_', '-')}"
    if flag in flags:
        return f"Write {flag} without --option."
    return did_you_mean(key, known) or f"The options are {', '.join(sorted(known))}."


def parse_limits(texts: Sequence[str]) -> dict[str, float]:
    """Parse scope.unit=number texts. Raises HumanclawError."""
    limits: dict[str, float] = {}
    for text in texts:
        name, _, number = text.partition("=")
        try:
            limits[name.strip()] = float(number)
        except ValueError:
            raise HumanclawError(
                f"--limit takes scope.unit=number; got {text!r}.", "For example --limit run.usd=5."
            ) from None
    return dict(check_limits(limits))


plugin_files: Final = click.option(
    "--plugin",
    "files",
    type=click.Path(path_type=Path),
    multiple=True,
    metavar="FILE|FOLDER",
    help="Also load a plugin from a Python file or a package's folder, without installing it. Repeatable.",
)
"""The option --plugin FILE|FOLDER; the command gets `files`."""


def plugin_options(function: F) -> F:
    """Add --plugin, --without and --skills. The command gets `files` and a `choice` (humanclaw.Choice)."""

    @functools.wraps(function)
    def command(*args: Any, without: Sequence[str], skills: str | None, **rest: Any) -> Any:
        from humanclaw.plugins.choice import Choice

        named = tuple(name.strip() for name in (skills or "").split(",") if name.strip())
        if skills is not None and not named:
            raise HumanclawError("--skills names no skill.", "Give one or more: --skills NAME,NAME.")
        return function(*args, choice=Choice(tuple(without), named), **rest)

    wrapped = functools.reduce(lambda inner, option: option(inner), reversed(_CHOICES), command)
    # An option keeps the command's type, which reduce forgets.
    return plugin_files(wrapped)  # type: ignore[return-value]


_CHOICES: Final = (
    click.option(
        "--without",
        multiple=True,
        metavar="OWNER[:NAME]|SKILL",
        help="Leave out a distribution, something of it, or a skill. Repeatable.",
    ),
    click.option(
        "--skills",
        metavar="NAME,...",
        help="The skills that can be called, and no others; also owner:name.",
    ),
)


_SECRET: Final = re.compile(r"//[^/\s]*@|(key|token|secret|passw\w*)=", re.IGNORECASE)
"""User and password of an address, or a key in its query."""


def scene_option(*name: str, about: str = "Where: source:argument.", **settings: Any) -> Callable[[F], F]:
    """Return the option --scene; the command gets it as `reference`, or under another name.

    A scene that holds a secret is refused before anything is printed or written.
    """

    def check(
        context: click.Context, parameter: click.Parameter, value: str | tuple[str, ...]
    ) -> str | tuple[str, ...]:
        if _SECRET.search(value if isinstance(value, str) else "\n".join(value)):
            message = "--scene holds what looks like a user, a password or a key, and scenes are printed and recorded."
            raise HumanclawError(message, "Put secrets into the environment instead.")
        return value

    shared: Any = {"callback": check, "show_default": True, "help": about}
    return click.option("--scene", *(name or ("reference",)), **shared, **settings)


def parse_pairs(pairs: Sequence[str]) -> dict[str, Any]:
    """Parse key=value texts; values are JSON if they parse as JSON. Raises HumanclawError."""
    return dict(_parse_pair(pair) for pair in pairs)


def _parse_pair(pair: str) -> tuple[str, Any]:
    key, equals, text = pair.partition("=")
    if not equals or not key:
        raise HumanclawError(f"--option takes key=value; got {pair!r}.", "For example --option temperature=0.2.")
    if "key" in key.lower() or key.lower().endswith("token"):
        raise HumanclawError(
            f"--option {key} looks like a secret, and options are recorded.", "Put keys into the environment instead."
        )
    return key, json_or_text(text)


def json_or_text(text: str) -> Any:
    """Return the value of a text that is JSON; otherwise the text."""
    try:
        return json.loads(text)
    except ValueError:
        return text
