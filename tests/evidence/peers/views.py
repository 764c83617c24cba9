"""Draw views of a house, 512 x 512, with one renderer: python views.py NAME PICTURE. Prints milliseconds of a view for
peers.py, which starts it. All get the same triangles and cameras, and give colours, depth and ids of objects."""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from statistics import median

import numpy as np
from PIL import Image

from humanclaw import Body, Plugins
from humanclaw.body import matrix_from_quaternion, yaw_matrix
from humanclaw.world import GAZES, Camera, Scene, ego_camera

SIZE, NEAR, FAR, ROUNDS, TURNS = 512, 0.05, 60.0, 3, 8
Draw = Callable[[Camera], np.ndarray]
"""Draws colours, depth and ids, returns (SIZE, SIZE, 3) colours."""


def parts(scene: Scene) -> Iterator[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield each object's number, (N, 3) corners of triangles in world frame, (N, 2) uv, texture (last row first)."""
    for obj in scene.objects:
        mesh = scene.assets[obj.asset].mesh
        corners = mesh.vertices[mesh.faces.ravel()] @ matrix_from_quaternion(np.array(obj.rotation)).T + obj.position
        yield obj.id, corners, mesh.uv[mesh.faces.ravel()], np.ascontiguousarray(mesh.texture[::-1])


def ours(body: Body) -> Draw:
    renderer, state = Plugins.discover().make("renderers", body.backends.renderer), body.state()
    renderer.load(body.scene)
    return lambda camera: renderer.render(state, camera).rgb


def tiny(body: Body) -> Draw:
    import pybullet as bullet

    bullet.connect(bullet.DIRECT)
    for _, corners, uv, texture in parts(body.scene):
        a, b, c = np.moveaxis(corners.reshape(-1, 3, 3), 1, 0)
        normals = np.cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        shape = bullet.createVisualShape(bullet.GEOM_MESH, vertices=corners.tolist(), indices=range(len(corners)),
                                         uvs=uv.tolist(), normals=normals.repeat(3, 0).tolist())  # fmt: skip
        with tempfile.NamedTemporaryFile(suffix=".png") as file:
            Image.fromarray(texture[::-1]).save(file.name)
            image = bullet.loadTexture(file.name)
        bullet.changeVisualShape(bullet.createMultiBody(0, -1, shape), -1, textureUniqueId=image)
    lens = bullet.computeProjectionMatrixFOV(90, 1, NEAR, FAR)

    def draw(camera: Camera) -> np.ndarray:
        eye = bullet.computeViewMatrix(camera.position, camera.position + camera.forward, camera.up)
        drawn = bullet.getCameraImage(SIZE, SIZE, eye, lens, shadow=0, renderer=bullet.ER_TINY_RENDERER)
        return np.reshape(drawn[2], (SIZE, SIZE, 4))[..., :3].astype(np.uint8)

    return draw


def mujoco(body: Body) -> Draw:
    import mujoco as mj

    spec = mj.MjSpec()
    spec.visual.global_.offwidth = spec.visual.global_.offheight = SIZE
    spec.visual.map.znear, spec.visual.map.zfar, spec.stat.extent = NEAR, FAR, 1.0
    for number, corners, uv, texture in parts(body.scene):
        name, (height, width) = str(number), texture.shape[:2]
        image = spec.add_texture(name=name, type=mj.mjtTexture.mjTEXTURE_2D, width=width, height=height, nchannel=3)
        image.data = texture.tobytes()
        spec.add_material(name=name).textures[mj.mjtTextureRole.mjTEXROLE_RGB] = name
        spec.add_mesh(name=name, uservert=corners.ravel(), userface=np.arange(len(corners)), usertexcoord=uv.ravel(),
                      inertia=mj.mjtMeshInertia.mjMESH_INERTIA_SHELL)  # fmt: skip
        spec.worldbody.add_geom(name=name, type=mj.mjtGeom.mjGEOM_MESH, meshname=name, material=name)
    spec.worldbody.add_light(pos=[0, 30, 0], dir=[0.3, -1, 0.2], type=mj.mjtLightType.mjLIGHT_DIRECTIONAL)
    spec.worldbody.add_camera(name="eye", fovy=90)
    model = spec.compile()
    data, renderer = mj.MjData(model), mj.Renderer(model, SIZE, SIZE)

    def draw(camera: Camera) -> np.ndarray:
        axes = np.stack([np.cross(camera.forward, camera.up), camera.up, -camera.forward], 1)
        model.cam_pos[0] = camera.position
        mj.mju_mat2Quat(model.cam_quat[0], axes.ravel())
        mj.mj_forward(model, data)
        renderer.update_scene(data, "eye")
        colours = renderer.render().copy()
        for kind in ("depth", "segmentation"):
            getattr(renderer, f"enable_{kind}_rendering")()
            renderer.render()
            getattr(renderer, f"disable_{kind}_rendering")()
        return colours

    return draw


def tinydisplay(body: Body, pipe: str = "p3tinydisplay") -> Draw:
    from panda3d import core as panda

    engine, wanted, lens = panda.GraphicsEngine.get_global_ptr(), panda.FrameBufferProperties(), panda.PerspectiveLens()
    wanted.set_rgba_bits(8, 8, 8, 8)
    wanted.set_depth_bits(24)
    made, size = panda.GraphicsPipeSelection.get_global_ptr().make_module_pipe(pipe), panda.WindowProperties.size(SIZE)
    window = engine.make_output(made, "", 0, wanted, size, panda.GraphicsPipe.BF_refuse_window)
    if pipe != "p3tinydisplay":  # Which cannot give its depth.
        window.add_render_texture(panda.Texture(), panda.GraphicsOutput.RTM_copy_ram, panda.GraphicsOutput.RTP_depth)
    colours, ids, eye = panda.NodePath(""), panda.NodePath(""), panda.NodePath(panda.Camera("", lens))
    for number, corners, uv, texture in parts(body.scene):
        data = panda.GeomVertexData("", panda.GeomVertexFormat.get_v3t2(), panda.Geom.UH_static)
        data.unclean_set_num_rows(len(corners))
        data.modify_array_handle(0).copy_data_from(np.hstack([corners, uv]).astype(np.float32).tobytes())
        triangles, geom, node = panda.GeomTriangles(panda.Geom.UH_static), panda.Geom(data), panda.GeomNode("")
        triangles.add_next_vertices(len(corners))
        geom.add_primitive(triangles)
        node.add_geom(geom)
        image = panda.Texture()
        image.setup_2d_texture(*texture.shape[1::-1], panda.Texture.T_unsigned_byte, panda.Texture.F_rgb)
        image.set_ram_image(texture[..., ::-1].tobytes())
        image.set_minfilter(panda.SamplerState.FT_linear_mipmap_linear)
        colours.attach_new_node(node).set_texture(image)
        ids.attach_new_node(node.make_copy()).set_color(number / 255, 0, 0, 1)
    lens.set_fov(90)
    lens.set_near_far(NEAR, FAR)
    window.make_display_region().camera = eye

    def draw(camera: Camera) -> np.ndarray:
        read = []
        for root in (ids, colours):
            eye.reparent_to(root)
            eye.set_pos(*camera.position)
            eye.look_at(root, panda.Point3(*(camera.position + camera.forward)), panda.Vec3(*camera.up))
            engine.render_frame()
            read.append(np.frombuffer(window.get_screenshot().get_ram_image_as("RGB"), np.uint8))
        return read[1].reshape(SIZE, SIZE, 3)[::-1]

    return draw


def llvmpipe(body: Body) -> Draw:
    return tinydisplay(body, "p3headlessgl")


def vtk(body: Body) -> Draw:
    from vtkmodules import all as kit
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

    window, colours, ids, eye = kit.vtkRenderWindow(), kit.vtkRenderer(), kit.vtkRenderer(), kit.vtkCamera()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(0)
    window.SetSize(SIZE, SIZE)
    eye.SetViewAngle(90)
    eye.SetClippingRange(NEAR, FAR)
    for root in (ids, colours):
        root.SetActiveCamera(eye)
        window.AddRenderer(root)
    for number, corners, uv, texture in parts(body.scene):
        data, points, faces, pixels = kit.vtkPolyData(), kit.vtkPoints(), kit.vtkCellArray(), kit.vtkImageData()
        points.SetData(numpy_to_vtk(corners.astype(np.float32), deep=True))
        faces.SetData(3, numpy_to_vtkIdTypeArray(np.arange(len(corners)), deep=True))
        data.SetPoints(points)
        data.SetPolys(faces)
        data.GetPointData().SetTCoords(numpy_to_vtk(uv.astype(np.float32), deep=True))
        pixels.SetDimensions(*texture.shape[1::-1], 1)
        pixels.GetPointData().SetScalars(numpy_to_vtk(texture.reshape(-1, 3), deep=True))
        mapper, drawn, flat, image = kit.vtkPolyDataMapper(), kit.vtkActor(), kit.vtkActor(), kit.vtkTexture()
        mapper.SetInputData(data)
        image.SetInputData(pixels)
        image.MipmapOn()
        image.InterpolateOn()
        drawn.SetTexture(image)
        drawn.GetProperty().SetAmbient(0.5)  # Its light is the camera's: walls along the view would be black.
        flat.GetProperty().LightingOff()
        flat.GetProperty().SetColor(number / 255, 0, 0)
        for root, actor in ((colours, drawn), (ids, flat)):
            actor.SetMapper(mapper)
            root.AddActor(actor)
    rgb, depth, box = kit.vtkUnsignedCharArray(), kit.vtkFloatArray(), (0, 0, SIZE - 1, SIZE - 1)

    def draw(camera: Camera) -> np.ndarray:
        eye.SetPosition(*camera.position)
        eye.SetFocalPoint(*(camera.position + camera.forward))
        eye.SetViewUp(*camera.up)
        for root in (ids, colours):
            ids.SetDraw(root is ids)
            colours.SetDraw(root is colours)
            window.Render()
            window.GetPixelData(*box, 0, rgb, 0)
        window.GetZbufferData(*box, depth)
        return vtk_to_numpy(rgb).reshape(SIZE, SIZE, 3)[::-1]

    return draw


def main(name: str, picture: str) -> None:
    body, taken = Body("house:0"), []
    ahead, draw = ego_camera(body.state().body, SIZE, GAZES["far"]), globals()[name](body)
    Image.fromarray(np.ascontiguousarray(draw(ahead))).resize((320, 320)).save(picture)
    for _ in range(ROUNDS):
        began = time.process_time()
        for turn in map(yaw_matrix, np.linspace(0, 2 * np.pi, TURNS, endpoint=False)):
            draw(replace(ahead, forward=turn @ ahead.forward, up=turn @ ahead.up))
        taken.append(1e3 * (time.process_time() - began) / TURNS)
    print(median(taken))


if __name__ == "__main__":
    main(*sys.argv[1:])
