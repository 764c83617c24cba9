"""The body: skeleton and collision shapes, poses and motion."""

from typing import TYPE_CHECKING

from humanclaw.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from humanclaw.body.hand_thigh_contact import lay_hands as lay_hands
    from humanclaw.body.limits import (
        JOINT_LIMITS as JOINT_LIMITS,
        centre_of_mass as centre_of_mass,
        shoe_heights as shoe_heights,
    )
    from humanclaw.body.pose import (
        CHUNK as CHUNK,
        FPS as FPS,
        FUTURE as FUTURE,
        HISTORY as HISTORY,
        STATE_SIZE as STATE_SIZE,
        Array as Array,
        Motion as Motion,
        Pose2D as Pose2D,
        decode as decode,
        encode as encode,
        forward_kinematics as forward_kinematics,
        heading as heading,
        matrix_from_quaternion as matrix_from_quaternion,
        matrix_from_vector as matrix_from_vector,
        mirrored as mirrored,
        next_history as next_history,
        pelvis_jerk as pelvis_jerk,
        quaternion_from_matrix as quaternion_from_matrix,
        re_rooted as re_rooted,
        rest_pose as rest_pose,
        root_jerk as root_jerk,
        smoothstep as smoothstep,
        support_height as support_height,
        vector_from_matrix as vector_from_matrix,
        wrap_angle as wrap_angle,
        yaw_matrix as yaw_matrix,
    )
    from humanclaw.body.self_overlap import overlap as overlap
    from humanclaw.body.skeleton import (
        BODY_GROUPS as BODY_GROUPS,
        EYE as EYE,
        JOINT_INDEX as JOINT_INDEX,
        JOINTS as JOINTS,
        LINKS as LINKS,
        N_JOINTS as N_JOINTS,
        OFFSETS as OFFSETS,
        PARENTS as PARENTS,
        SOLE as SOLE,
        STANDING_HEIGHT as STANDING_HEIGHT,
        TOE_SOLE as TOE_SOLE,
        BodyGroup as BodyGroup,
        Box as Box,
        Capsule as Capsule,
        Link as Link,
        Side as Side,
    )
    from humanclaw.body.skinning import REGIONS as REGIONS, SKINS as SKINS, Skin as Skin, skin as skin

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy_exports(__name__)
