"""Export runs: a table of episodes, pandas, LeRobotDataset and inspect_ai logs.

Each export imports the package that it needs on use, and names it if it is missing.
"""

from __future__ import annotations

import csv
import importlib
import io
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from humanclaw import Call, HumanclawError, Plugins, RecordedEpisode, RecordError, StepRecord, load_run
from humanclaw.storage import Folder
from humanclaw_bench.failure_modes import Cause
from humanclaw_bench.scores import Scores, ended
from humanclaw_bench.scoring import COLLISIONS, Scored, metrics_of, scored_runs, with_progress

if TYPE_CHECKING:
    import pandas as pd

DECISIONS_A_SECOND: Final = 2
"""A call without a sequence plays half a second; LeRobot wants one rate for a whole data set."""


def row(scores: Scores, cause: Cause | None) -> dict[str, Any]:
    """Return an episode's numbers and root cause by name.

    Unknown numbers are None. Collisions have one number per body group.
    """
    values = asdict(replace(scores, spec=None, conditions={}))
    del values["spec"], values["conditions"]
    collisions, extra, hands = values.pop("collisions"), values.pop("extra"), values.pop("hands")
    values |= {COLLISIONS + group: share for group, share in collisions.items()}
    values |= {"success": scores.success} | hands | extra
    values |= {"stage": cause.stage, "cause": cause.name, "capability": cause.capability} if cause else {}
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value for key, value in values.items()
    }


def rows(run: Path, plugins: Plugins | None = None) -> list[dict[str, Any]]:
    """Return a run with one row per episode. Raises RecordError if there is none."""
    return [row(*pair) for pair in _scored(run, load_run(run), plugins)]


def _scored(run: Path, episodes: Sequence[RecordedEpisode], plugins: Plugins | None) -> list[Scored]:
    return scored_runs({run: episodes}, metrics_of(plugins or Plugins.discover()))[run]


def load(run: str | Path, plugins: Plugins | None = None) -> pd.DataFrame:
    """Return a run as a pandas DataFrame, one row per episode.

    Raises HumanclawError if pandas is missing or there is no run.
    """
    pandas = _need("pandas", "pandas")
    frame = pandas.DataFrame(rows(Path(run), plugins)).set_index("episode")
    # Columns of True, False and None have dtype object, which can be neither negated nor averaged.
    known = [name for name in frame if pandas.api.types.infer_dtype(frame[name]) == "boolean"]
    return frame.astype(dict.fromkeys(known, "boolean"))


# -- files -------------------------------------------------------------------------------------------------------------
def to_csv(run: Path, out: Path, plugins: Plugins | None = None) -> Path:
    """Write a CSV file with one line per episode; unknown numbers are empty."""
    table = rows(run, plugins)
    names = list(dict.fromkeys(name for line in table for name in line))
    stream = io.StringIO()
    writer = csv.DictWriter(stream, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    Folder(out.parent).write(out.name, stream.getvalue().encode())
    return out


def to_lerobot(run: Path, out: Path, plugins: Plugins | None = None) -> Path:
    """Write a LeRobotDataset with two frames a second, one per decision. The task is the instruction.

    observation.images.ego: the view. observation.state: root position (m) and 24 joint rotations (axis-angle, rad)
    before the decision. action: the executed call: a one-hot of the skill, then every parameter of every skill in the
    schema's units, 0 for skills that were not called; all 0 without a usable call. A parameter with texts has a column
    for each text, skill.parameter=text, which is 1 where it was given. next.done: whether it is the episode's last
    frame. next.success: whether it is, and the episode succeeded.

    Leaves out episodes without a decision or with an infrastructure failure. Raises RecordError if out exists or no
    episode is left.
    """
    writer = _need("lerobot.datasets.lerobot_dataset", "lerobot").LeRobotDataset
    episodes = [
        episode for episode in load_run(run) if episode.steps and ended(episode.record.outcome, episode.record.limit)
    ]
    if not episodes:
        raise RecordError(f"no episode in {run} has ended.", f"Continue the run: `humanclaw bench run --out {run}`.")
    if out.exists():
        raise RecordError(f"{out} already exists.", "Remove it, or name another folder with --out.")
    actions = _action_names(episodes)
    dataset = writer.create(
        repo_id=f"humanclaw/{run.name}", root=out, fps=DECISIONS_A_SECOND, robot_type="humanclaw",
        features=_features(episodes, actions), use_videos=False,
    )  # fmt: skip
    pairs = _scored(run, episodes, plugins)
    for recorded, (scores, _) in zip(with_progress(episodes, "exporting"), pairs, strict=True):
        for frame in _frames(recorded, actions, bool(scores.success)):
            dataset.add_frame(frame)
        dataset.save_episode()
    dataset.finalize()
    return out


def _action_names(episodes: Sequence[RecordedEpisode]) -> tuple[str, ...]:
    """Return the names of all skills in the episodes, then those of all parameters that were called."""
    calls = [step.call for episode in episodes for step in episode.steps if step.call]
    skills = sorted({skill for episode in episodes for skill in episode.record.skills} | {call.skill for call in calls})
    params = sorted({name for call in calls for name in _numbers(call)})
    return (*skills, *params)


def _features(episodes: Sequence[RecordedEpisode], actions: Sequence[str]) -> dict[str, Any]:
    picture: Any = episodes[0].picture(episodes[0].steps[0])
    state = [f"root_{axis}" for axis in "xyz"] + [f"rotation_{k}" for k in range(72)]
    return {
        "observation.images.ego": {"dtype": "image", "shape": picture.shape, "names": ["height", "width", "channels"]},
        "observation.state": {"dtype": "float32", "shape": (len(state),), "names": state},
        "action": {"dtype": "float32", "shape": (len(actions),), "names": list(actions)},
        "next.done": {"dtype": "bool", "shape": (1,), "names": None},
        "next.success": {"dtype": "bool", "shape": (1,), "names": None},
    }


def _frames(recorded: RecordedEpisode, actions: Sequence[str], success: bool) -> Iterator[dict[str, Any]]:
    motion = recorded.motion()
    for step, (first, _) in zip(recorded.steps, recorded.spans, strict=True):
        pose = np.concatenate([motion.root[first - 1], motion.rotations[first - 1].ravel()])
        yield {
            "observation.images.ego": recorded.picture(step),
            "observation.state": pose.astype(np.float32),
            "action": _action(step, actions),
            "next.done": np.array([step is recorded.steps[-1]]),
            "next.success": np.array([step is recorded.steps[-1] and success]),
            "task": recorded.record.spec.instruction,
        }


def _action(step: StepRecord, names: Sequence[str]) -> Any:
    values = {step.call.skill: 1.0, **_numbers(step.call)} if step.call else {}
    return np.array([values.get(name, 0.0) for name in names], np.float32)


def _numbers(call: Call) -> dict[str, float]:
    """Return the parameters of a call by column of the action: a text and each entry of a list has its own."""
    columns: dict[str, float] = {}
    for key, value in call.params.items():
        name, listed = f"{call.skill}.{key}", isinstance(value, list | tuple)
        entries = {f"{name}.{k}": each for k, each in enumerate(value)} if listed else {name: value}
        for column, each in entries.items():
            columns |= {f"{column}={each}": 1.0} if isinstance(each, str) else {column: float(each)}
    return columns


def to_inspect(run: Path, out: Path, plugins: Plugins | None = None) -> Path:
    """Write an inspect_ai log: a sample per episode, a tool call per decision, the success rates as scores.

    The views stay in the run; each answer's metadata names its view. out: *.eval or *.json. Raises RecordError if it is
    neither, or if the run has several agents.
    """
    log = _need("inspect_ai.log", "inspect-ai")
    if out.suffix not in (".eval", ".json"):
        said = f"an inspect_ai log must be named *.eval or *.json; got {out.name}."
        raise RecordError(said, "Name another file with --out.")
    episodes = load_run(run)
    first = episodes[0].record
    if len({(episode.record.agent, episode.record.verifier) for episode in episodes}) > 1:
        raise RecordError(f"{run} holds runs of several agents.", "Name the folder of one of them.")
    pairs = _scored(run, episodes, plugins)
    spec = log.EvalSpec(
        created=first.created, task="humanclaw", model=first.agent, config=log.EvalConfig(),
        dataset=log.EvalDataset(name=run.name, samples=len(episodes), sample_ids=[e.record.spec.id for e in episodes]),
        task_args=dict(first.options), packages=dict(first.versions),
        metadata={"verifier": first.verifier, "weights": first.weights},
    )  # fmt: skip
    samples = [_sample(log, recorded, *pair) for recorded, pair in zip(episodes, pairs, strict=True)]
    finished = [scores for scores, _ in pairs if scores.finished]
    results = log.EvalResults(
        total_samples=len(samples), completed_samples=len(finished),
        scores=[rate for name in ("find", "nav", "interact") for rate in _rate(log, name, finished)],
    )  # fmt: skip
    with Folder(out.parent).placed(out.name) as file:
        log.write_eval_log(log.EvalLog(status="success", eval=spec, samples=samples, results=results), str(file))
    return out


def _sample(log: Any, recorded: RecordedEpisode, scores: Scores, cause: Cause | None) -> Any:
    single = importlib.import_module("inspect_ai.scorer").Score
    spec, rates = recorded.record.spec, {"find": scores.find, "nav": scores.nav, "interact": scores.interact}
    return log.EvalSample(
        id=spec.id, epoch=1, input=spec.instruction, target=spec.target_category, messages=_messages(recorded),
        scores={name: single(value="C" if met else "I") for name, met in rates.items() if met is not None},
        metadata={key: value for key, value in row(scores, cause).items() if value is not None},
        model_usage=_usage(recorded), error=None if scores.finished else _error(log, recorded),
    )  # fmt: skip


def _usage(recorded: RecordedEpisode) -> dict[str, Any]:
    used = recorded.record.usage
    usage = importlib.import_module("inspect_ai.model").ModelUsage(
        input_tokens=used.tokens_in, output_tokens=used.tokens_out, total_tokens=used.tokens_in + used.tokens_out
    )
    return {recorded.record.agent: usage}


def _error(log: Any, recorded: RecordedEpisode) -> Any:
    why = recorded.record.error or recorded.record.outcome
    return log.EvalError(message=why, traceback="", traceback_ansi="")


def _messages(recorded: RecordedEpisode) -> list[Any]:
    """Return the conversation: the instruction, then each step's answer and its result."""
    model = importlib.import_module("inspect_ai.model")
    messages = [model.ChatMessageUser(content=recorded.record.spec.instruction)]
    for step in recorded.steps:
        said, calls = step.decision, _calls(step)
        view = {"view": str(recorded.folder / step.frame_file)}
        text = said.reasoning or said.raw
        messages.append(model.ChatMessageAssistant(content=text, tool_calls=calls, metadata=view))
        results = [model.ChatMessageTool(content=str(step.feedback), tool_call_id=call.id) for call in calls]
        messages += results or [model.ChatMessageUser(content=str(step.feedback))]
    return messages


def _calls(step: StepRecord) -> list[Any]:
    call_type = importlib.import_module("inspect_ai.tool").ToolCall
    return [
        call_type(id=f"step-{step.step}-{number}", function=call.skill, arguments=dict(call.params))
        for number, call in enumerate(step.decision.calls)
    ]


def _rate(log: Any, name: str, finished: Sequence[Scores]) -> Iterator[Any]:
    """Yield the success rate over the episodes to which it applies; nothing if there are none."""
    known = [value for scores in finished if (value := getattr(scores, name)) is not None]
    if known:
        rate = log.EvalMetric(name="accuracy", value=sum(known) / len(known))
        yield log.EvalScore(name=name, scorer=name, metrics={"accuracy": rate})


def _need(module: str, package: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise HumanclawError(f"this needs {package}: {error}.", f"Run `pip install {package}`.") from error


FORMATS: Final[Mapping[str, tuple[Callable[[Path, Path, Plugins], Path], str]]] = {
    "csv": (to_csv, "episodes.csv"),
    "inspect": (to_inspect, "inspect.eval"),
    "lerobot": (to_lerobot, "lerobot"),
}
"""Format to its function and to the default name of its output in the run."""
