"""A scripted episode of 100 steps in the words of a talkative model, to count the tokens of an episode."""

from __future__ import annotations

from humanclaw import Call

STEPS = 100
_SEEN = (
    "White wall with a framed picture on the left about 1.5 m away, an open doorway to a corridor in the middle "
    "about 3 m away, a wooden sideboard with a lamp and two books on the right about 2 m away, part of a window "
    "further right about 4 m away. The couch is not in view. Open floor ahead for 2 m, then the doorway; the "
    "sideboard stands close to the right shoulder. No stairs and no seat are nearby, and nothing lies on the floor "
    "between the body and the doorway.",
    "Kitchen counter with a sink on the left about 2.5 m away, a dining table with two chairs in the middle about 2"
    " m away, a tall window on the right about 4 m away and a potted plant below it. No couch is visible. The table"
    " blocks the direct way; there is free floor to the right of it, about a metre wide. No stairs. The chairs "
    "could be sat on, but they are not the target.",
    "Armchair on the left about 2 m away, grey couch in the middle about 3 m away, floor lamp on its right about "
    "3.5 m away, bookcase at the far wall about 5 m away. The couch is the target and it is in view. A low table "
    "stands 1.5 m ahead in the way; open carpet to its left, wide enough to pass. No stairs. The seat of the couch "
    "faces the body and seems free.",
)
_PROGRESS = (
    "The last turn brought the doorway into the centre of the view as intended. The target has not been seen yet, "
    "so the goal still asks to search, and the corridor is the only place not looked into.",
    "The last step brought the table half a metre closer and the view has changed. The goal asks to keep searching "
    "beyond the table, on the side where the floor is free.",
    "The couch has come closer by about 40 cm and lies slightly to the left now. The goal asks to approach it and "
    "to align with it once the low table is passed.",
)
_GOALS = (
    "Reach the doorway and look into the corridor for the couch.",
    "Walk around the right side of the table to the window.",
    "Pass the low table on its left and stand in front of the couch.",
)
_REASONS = (
    "The doorway is straight ahead and the floor before it is clear for two metres, so walking forward half a metre"
    " brings the body towards the unexplored corridor without touching the sideboard on the right. Turning now "
    "would lose sight of the doorway.",
    "A small left turn while walking keeps the shoulder clear of the corner of the table and lines the body up with"
    " the strip of open floor. A larger step would end too close to the chair, so forty centimetres are enough for "
    "now.",
    "The couch is slightly to the left, so turning towards it before walking on keeps it in the centre. The low "
    "table must stay on the right side, and the open carpet on the left is wide enough for the shoulders.",
)
_CALLS = (
    Call("walk", {"x_cm": 0, "z_cm": 50, "yaw_deg": 0}),
    Call("walk", {"x_cm": 5, "z_cm": 40, "yaw_deg": 10}),
    Call("turn_in_place", {"yaw_deg": 30}),
    Call("side_step", {"x_cm": -20}),
)


def call(step: int) -> Call:
    return Call("stop") if step == STEPS - 1 else _CALLS[step % len(_CALLS)]


def said(step: int) -> dict[str, str]:
    """Return the reasoning of a step; the mid-level goal holds for six steps."""
    scene, goal = step % 3, step // 6 % 3
    return {
        "visible_state": _SEEN[scene],
        "progress": _PROGRESS[scene],
        "mid_level_change": "revise" if step % 6 == 0 else "keep",
        "mid_level_goal": _GOALS[goal],
        "reasoning": _REASONS[scene],
    }
