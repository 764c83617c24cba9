"""An observer that counts the body's contacts, with any agent: `humanclaw run --plugin examples/bumps.py`.

Its hooks are called after every recorded step and at the end of an episode. If one raises, the episode does not change.
"""

from collections import Counter

from humanclaw import hookimpl

FLOOR = 0.03
"""Contacts below this height are footsteps, metres."""
bumps: dict[str, Counter[str]] = {}


@hookimpl
def humanclaw_step(episode, step):
    groups = {contact.group for contact in step.contacts if contact.height > FLOOR}
    bumps.setdefault(episode.spec.id, Counter()).update(groups)


@hookimpl
def humanclaw_episode_end(episode, folder):
    counts = bumps.pop(episode.spec.id, Counter())
    words = ", ".join(f"{group} in {count}" for group, count in counts.most_common()) or "nothing"
    print(f"{episode.spec.id} ({episode.outcome}): of {episode.steps} steps touched {words}")
