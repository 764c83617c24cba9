"""Compare renderers: CPU milliseconds for 512 x 512 views from the rooms of generated houses.

    python bench.py [HOUSE ...]

Other renderers are measured if they are installed (pip install pybullet embreex panda3d vtk). They draw less: for
TinyRenderer and Panda3D what their fixed functions offer, for Embree and VTK only the triangle in each pixel.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from humanclaw import Motion, Plugins, Scene
from humanclaw.body import rest_pose
from humanclaw.world import Camera, WorldState, ego_camera

Draw = Callable[[WorldState, Camera], object]
NEAR, FAR = 0.05, 60.0


def raster(scene: Scene) -> Draw:
    renderer = Plugins.discover().make("renderers", "raster")
    renderer.load(scene)
    return renderer.render


def tiny_renderer(scene: Scene) -> Draw:
    import pybullet as p

    p.connect(p.DIRECT)
    with tempfile.TemporaryDirectory() as folder:
        for obj in scene.objects:
            mesh = scene.assets[obj.asset].mesh
            shape = p.createVisualShape(
                p.GEOM_MESH, vertices=mesh.vertices.tolist(), indices=mesh.faces.ravel().tolist(), uvs=mesh.uv.tolist(),
                normals=np.tile([0.0, 1.0, 0.0], (len(mesh.vertices), 1)).tolist(),
            )  # fmt: skip
            body = p.createMultiBody(0, -1, shape, obj.position, obj.rotation)
            Image.fromarray(mesh.texture).save(Path(folder) / "t.png")
            p.changeVisualShape(body, -1, textureUniqueId=p.loadTexture(str(Path(folder) / "t.png")))
    projection = p.computeProjectionMatrixFOV(90, 1, NEAR, FAR)

    def draw(state: WorldState, camera: Camera) -> object:
        view = p.computeViewMatrix(camera.position, camera.position + camera.forward, camera.up)
        return p.getCameraImage(512, 512, view, projection, shadow=0, renderer=p.ER_TINY_RENDERER)

    return draw


def embree(scene: Scene) -> Draw:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    world, (vertices, faces) = EmbreeScene(), _soup(scene)
    keep = TriangleMesh(world, vertices, faces)
    middle = (np.arange(512) + 0.5) / 256 - 1

    def draw(state: WorldState, camera: Camera) -> object:
        assert keep
        right = np.cross(camera.forward, camera.up)
        rays = camera.forward + middle[None, :, None] * right - middle[:, None, None] * camera.up
        rays = rays.reshape(-1, 3).astype(np.float32)
        return world.run(
            np.broadcast_to(camera.position.astype(np.float32), rays.shape).copy(), rays, query="INTERSECT"
        )

    return draw


def panda3d(scene: Scene) -> Draw:
    import panda3d.core as pc

    pc.loadPrcFileData("", "window-type offscreen\nnotify-level fatal")
    engine = pc.GraphicsEngine.get_global_ptr()
    pipe = pc.GraphicsPipeSelection.get_global_ptr().make_module_pipe("p3tinydisplay")
    buffer = pc.FrameBufferProperties()
    buffer.set_rgb_color(True)
    buffer.set_depth_bits(16)
    size = pc.WindowProperties.size(512, 512)
    window = engine.make_output(pipe, "view", 0, buffer, size, pc.GraphicsPipe.BF_refuse_window)
    root, lens, picture = pc.NodePath("root"), pc.PerspectiveLens(), pc.Texture()
    for obj in scene.objects:
        _panda_node(pc, root, scene, obj.id)
    lens.set_fov(90)
    lens.set_near_far(NEAR, FAR)
    eye = root.attach_new_node(pc.Camera("eye", lens))
    window.make_display_region().set_camera(eye)
    window.add_render_texture(picture, pc.GraphicsOutput.RTM_copy_ram)

    def draw(state: WorldState, camera: Camera) -> object:
        eye.set_pos(*camera.position)
        eye.look_at(pc.Point3(*(camera.position + camera.forward)), pc.Vec3(*camera.up))
        engine.render_frame()
        return picture.get_ram_image()

    return draw


def _panda_node(pc, root, scene: Scene, key: int) -> None:  # type: ignore[no-untyped-def]
    mesh = scene.assets[scene.by_id[key].asset].mesh
    corners = np.concatenate([scene.vertices(key)[mesh.faces.ravel()], mesh.uv[mesh.faces.ravel()]], 1)
    data = pc.GeomVertexData("mesh", pc.GeomVertexFormat.get_v3t2(), pc.Geom.UH_static)
    data.unclean_set_num_rows(len(corners))
    data.modify_array_handle(0).copy_data_from(corners.astype(np.float32).tobytes())
    triangles = pc.GeomTriangles(pc.Geom.UH_static)
    triangles.add_next_vertices(len(corners))
    shape, node, texture = pc.Geom(data), pc.GeomNode("object"), pc.Texture()
    shape.add_primitive(triangles)
    node.add_geom(shape)
    path = root.attach_new_node(node)
    texture.setup_2d_texture(*mesh.texture.shape[1::-1], pc.Texture.T_unsigned_byte, pc.Texture.F_rgb)
    texture.set_ram_image(mesh.texture[::-1, :, ::-1].tobytes())
    path.set_texture(texture)
    path.set_two_sided(True)


def vtk(scene: Scene) -> Draw:
    os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = "vtkEGLRenderWindow"
    import vtk as v
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

    vertices, faces = _soup(scene)
    points, cells, data, mapper, actor = (
        v.vtkPoints(), v.vtkCellArray(), v.vtkPolyData(), v.vtkPolyDataMapper(), v.vtkActor(),
    )  # fmt: skip
    points.SetData(numpy_to_vtk(vertices, deep=1))
    cells.ImportLegacyFormat(numpy_to_vtkIdTypeArray(np.insert(faces, 0, 3, 1).ravel().astype(np.int64), deep=1))
    data.SetPoints(points)
    data.SetPolys(cells)
    numbers = np.arange(len(faces))
    data.GetCellData().SetScalars(
        numpy_to_vtk(np.stack([numbers % 256, numbers // 256, 0 * numbers], 1).astype(np.uint8), 1)
    )
    mapper.SetInputData(data)
    actor.SetMapper(mapper)
    actor.GetProperty().LightingOff()
    window, renderer = v.vtkRenderWindow(), v.vtkRenderer()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(512, 512)
    window.AddRenderer(renderer)
    renderer.AddActor(actor)

    def draw(state: WorldState, camera: Camera) -> object:
        eye = renderer.GetActiveCamera()
        eye.SetPosition(*camera.position)
        eye.SetFocalPoint(*(camera.position + camera.forward))
        eye.SetViewUp(*camera.up)
        eye.SetViewAngle(90)
        eye.SetClippingRange(NEAR, FAR)
        window.Render()
        reader = v.vtkWindowToImageFilter()
        reader.SetInput(window)
        reader.ShouldRerenderOff()
        reader.Update()
        return reader.GetOutput()

    return draw


def _soup(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return all meshes as one: (N, 3) float32 world positions and (M, 3) int32 faces."""
    vertices = [scene.vertices(obj.id) for obj in scene.objects]
    starts = np.cumsum([0, *map(len, vertices)])[:-1]
    faces = [scene.assets[obj.asset].mesh.faces + start for obj, start in zip(scene.objects, starts, strict=True)]
    return np.concatenate(vertices).astype(np.float32), np.concatenate(faces).astype(np.int32)


def moments(scene: Scene) -> list[WorldState]:
    """Return a body in the middle of each room, each facing another way."""
    found = []
    for number, room in enumerate(scene.rooms):
        body, rotations = rest_pose(), rest_pose().rotations.copy()
        rotations[:, 0] = [0, 0.9 * number, 0]
        middle = np.array([(room.x0 + room.x1) / 2, room.floor, (room.z0 + room.z1) / 2])
        found.append(WorldState(Motion(body.root + middle, rotations), {}))
    return found


def cpu_times(draw: Draw, states: list[WorldState]) -> list[float]:
    """Return milliseconds per view: the median of three tries, after one to warm up."""
    times = []
    for state in states:
        camera, tries = ego_camera(state.body), []
        for _ in range(4):
            begin = time.process_time()
            draw(state, camera)
            tries.append(1e3 * (time.process_time() - begin))
        times.append(float(np.median(tries[1:])))
    return times


def main(houses: list[int]) -> None:
    for house in houses:
        scene = Plugins.discover().scene(f"house:{house}")
        triangles = sum(len(scene.assets[obj.asset].mesh.faces) for obj in scene.objects)
        print(f"house:{house}: {len(scene.objects)} objects, {triangles} triangles, {len(scene.rooms)} views")
        for contender in (raster, tiny_renderer, embree, panda3d, vtk):
            try:
                begin = time.process_time()
                draw = contender(scene)
                load = time.process_time() - begin
                times = cpu_times(draw, moments(scene))
            except ImportError as error:
                print(f"  {contender.__name__:14} not installed ({error.name})")
                continue
            print(f"  {contender.__name__:14} {np.median(times):6.1f} ms (most {max(times):.1f}), load {load:.1f} s")


if __name__ == "__main__":
    main([int(argument) for argument in sys.argv[1:]] or [0, 1, 2])
