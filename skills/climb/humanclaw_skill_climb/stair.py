"""Commands of both stair skills: height and depth of a step, metres, near those of indoor stairs."""

from humanclaw.skills import Draw

STAIR = {
    "h": Draw(0.07, 0.26, usual=0.17, spread=0.02, jitter=0.004),
    "d": Draw(0.19, 0.41, usual=0.28, spread=0.025, jitter=0.006),
}
