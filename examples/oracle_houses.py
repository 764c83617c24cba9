"""Oracle episodes on many houses: python examples/oracle_houses.py [HOUSES] [FOLDER]

Prints the outcome of each episode and the wall time of each part of a step. The oracle is privileged: it knows the map.
No agent can do what the oracle cannot, so a failure here is a fault of the world or the motion.
"""

import statistics
import sys
from pathlib import Path

from humanclaw import Body, Plugins, RecordedEpisode, run_episode
from humanclaw.records import free_episode
from humanclaw.world import geodesics

INSTRUCTION = "find a couch and sit on it"
PARTS = ("observe", "decide", "generate", "simulate")


def play(body: Body, house: int, folder: Path) -> RecordedEpisode:
    scene = body.plugins.scene(f"house:{house}")
    spec = free_episode(INSTRUCTION, scene, seed=house, name=f"house-{house}")
    agent = body.plugins.make("agents", "oracle", {})
    body.reset(scene, seed=house)
    run_episode(body, spec, agent, folder=folder / spec.id, distance=geodesics)
    return RecordedEpisode(folder / spec.id)


def sits(episode: RecordedEpisode) -> bool:
    """Tell whether the agent stopped with the pelvis on a target."""
    last = episode.steps[-1]
    return last.status == "stopped" and bool(set(last.pelvis_contacts) & set(episode.record.spec.target_ids))


def main(houses: str = "20", folder: str = "runs/oracle-houses") -> None:
    plugins = Plugins.discover()
    episodes = []
    with Body("house:0", plugins=plugins) as body:
        for house in range(int(houses)):
            episodes.append(play(body, house, Path(folder)))
            end = episodes[-1].record
            print(f"house:{house:<3} {end.outcome:<12} {end.steps:>3} steps  sits: {sits(episodes[-1])}", flush=True)
    seated = sum(map(sits, episodes))
    print(f"\n{seated} of {len(episodes)} end sitting on the target.\n\n| part | median ms a step |\n| --- | --- |")
    for part in PARTS:
        times = [step.seconds[part] for episode in episodes for step in episode.steps if part in step.seconds]
        print(f"| {part} | {1000 * statistics.median(times):.0f} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
