"""The world: scenes, simulators, views, half-physics, model files, navigation."""

from typing import TYPE_CHECKING

from humanclaw.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from humanclaw.world.compiling import compiled as compiled, inlined as inlined, internal as internal
    from humanclaw.world.half_physics.articulated_object import ArticulatedObject as ArticulatedObject
    from humanclaw.world.half_physics.kinematic import Kinematic as Kinematic
    from humanclaw.world.half_physics.profile import (
        PROFILES as PROFILES,
        Profile as Profile,
        find_profile as find_profile,
    )
    from humanclaw.world.half_physics.quaternions import Pose as Pose
    from humanclaw.world.half_physics.simulator import HalfPhysics as HalfPhysics
    from humanclaw.world.half_physics.skeleton import (
        LINK_OF as LINK_OF,
        capsule_frame as capsule_frame,
        link_inertia as link_inertia,
        link_mass as link_mass,
    )
    from humanclaw.world.half_physics.solids import (
        box_of as box_of,
        centre_of_mass as centre_of_mass,
        inertia as inertia,
        solids as solids,
    )
    from humanclaw.world.half_physics.world import (
        LEVEL as LEVEL,
        TOUCHING as TOUCHING,
        ObjectMotion as ObjectMotion,
        Touch as Touch,
        World as World,
    )
    from humanclaw.world.joints import (
        GRAVITY as GRAVITY,
        Hinge as Hinge,
        Joint as Joint,
        Slide as Slide,
        Vec3 as Vec3,
        balanced as balanced,
    )
    from humanclaw.world.meshes.baking import area as area, atlas as atlas, bake as bake
    from humanclaw.world.meshes.decimation import simplify as simplify
    from humanclaw.world.meshes.hulls import KeepOutBox as KeepOutBox, convex_pieces as convex_pieces, exact as exact
    from humanclaw.world.meshes.measure import (
        back_of as back_of,
        seat_of as seat_of,
    )
    from humanclaw.world.meshes.mesh_files import MODEL_BYTES as MODEL_BYTES, read_model as read_model
    from humanclaw.world.meshes.parts import Part as Part, bounds as bounds
    from humanclaw.world.meshes.shaping import (
        base_of as base_of,
        lightened as lightened,
        moved as moved,
        turned as turned,
        with_lid as with_lid,
    )
    from humanclaw.world.navigation.approach import (
        Viewpoint as Viewpoint,
        geodesics as geodesics,
        goals_at as goals_at,
        viewpoints as viewpoints,
        voice_distance as voice_distance,
    )
    from humanclaw.world.navigation.occupancy import (
        CELL as CELL,
        OBSTACLE_HEIGHTS as OBSTACLE_HEIGHTS,
        RADIUS as RADIUS,
        STEP as STEP,
        OccupancyGrid as OccupancyGrid,
        floors_of as floors_of,
        length as length,
        room_at as room_at,
    )
    from humanclaw.world.navigation.search import (
        DistanceField as DistanceField,
        MultiFloorMap as MultiFloorMap,
        Segment as Segment,
    )
    from humanclaw.world.navigation.stairs import StairRun as StairRun, stair_runs as stair_runs
    from humanclaw.world.scene import (
        GROUND as GROUND,
        STRUCTURE as STRUCTURE,
        Asset as Asset,
        Mesh as Mesh,
        Quaternion as Quaternion,
        Room as Room,
        Scene as Scene,
        SceneObject as SceneObject,
        distance_to_box as distance_to_box,
        distance_to_nearest as distance_to_nearest,
    )
    from humanclaw.world.scene_builder import SceneBuilder as SceneBuilder, block as block, box_mesh as box_mesh
    from humanclaw.world.scene_file import pack_scene as pack_scene, unpack_scene as unpack_scene
    from humanclaw.world.simulator import (
        Contact as Contact,
        DistanceFactory as DistanceFactory,
        DistanceFn as DistanceFn,
        Execution as Execution,
        Heard as Heard,
        SharedSimulator as SharedSimulator,
        Simulator as Simulator,
        WorldState as WorldState,
        body_numbers as body_numbers,
        person_id as person_id,
        shared as shared,
    )
    from humanclaw.world.view import (
        BODY_ID as BODY_ID,
        DEFAULT_GAZE as DEFAULT_GAZE,
        GAZES as GAZES,
        Camera as Camera,
        CameraMount as CameraMount,
        Renderer as Renderer,
        View as View,
        ego_camera as ego_camera,
        together as together,
    )

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy_exports(__name__)
