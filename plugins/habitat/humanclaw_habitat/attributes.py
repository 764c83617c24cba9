"""The JSON files of a scene dataset as values: https://aihabitat.org/docs/habitat-sim/attributesJSON.html.

Only what a body can touch or see is kept; other fields (lights, shaders, margins, navigation meshes) are passed over.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from humanclaw import SceneError

Vec3 = tuple[float, float, float]
Lower = Annotated[str, BeforeValidator(lambda value: value.lower() if isinstance(value, str) else value)]


class _Attributes(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


M = TypeVar("M", bound=_Attributes)


class Template(_Attributes):
    """A stage or an object before it is put anywhere. Paths are relative to the file that names them."""

    render_asset: str = ""
    collision_asset: str = ""
    up: Vec3 = (0.0, 1.0, 0.0)
    """The asset's own direction that becomes +Y."""
    front: Vec3 = (0.0, 0.0, -1.0)
    """The asset's own direction that becomes -Z, which is forward in Habitat."""
    scale: Vec3 = (1.0, 1.0, 1.0)
    units_to_meters: Annotated[float, Field(gt=0)] = 1.0
    is_collidable: bool = True
    use_bounding_box_for_collision: bool = False
    join_collision_meshes: bool | None = None
    mass: Annotated[float, Field(ge=0)] = 1.0
    friction_coefficient: Annotated[float, Field(ge=0)] = 0.5
    com: Annotated[Vec3 | None, Field(alias="COM")] = None
    semantic_id: int | None = None

    @model_validator(mode="after")
    def _axes(self) -> Template:
        up, front = np.array(self.up), np.array(self.front)
        size = np.linalg.norm(up) * np.linalg.norm(front)
        if size < 1e-9 or abs(up @ front) > 1e-3 * size:
            raise ValueError(f"up and front must be orthogonal; got {self.up} and {self.front}")
        return self


class Placing(_Attributes):
    """One object of a scene. rotation is w, x, y, z."""

    template_name: str
    translation: Vec3 = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    uniform_scale: float = 1.0
    non_uniform_scale: Vec3 = (1.0, 1.0, 1.0)
    motion_type: Lower = ""
    translation_origin: Lower = ""
    mass_scale: Annotated[float, Field(gt=0)] = 1.0

    @model_validator(mode="after")
    def _known(self) -> Placing:
        if self.motion_type not in ("", "undefined", "static", "kinematic", "dynamic"):
            raise ValueError(f"motion_type must be static, kinematic or dynamic; got {self.motion_type!r}")
        if self.translation_origin not in ("", "unknown", "com", "asset_local"):
            raise ValueError(f"translation_origin must be asset_local or COM; got {self.translation_origin!r}")
        if not 0.9 < np.linalg.norm(self.rotation) < 1.1:
            raise ValueError(f"rotation must be a unit quaternion w, x, y, z; got {self.rotation}")
        return self


class Articulated(_Attributes):
    """*.ao_config.json: a thing of links and joints. Paths are relative to the file that names them."""

    urdf_filepath: str = ""
    """Empty: the file of the same name beside it."""
    uniform_scale: Annotated[float, Field(gt=0)] = 1.0
    semantic_id: int | None = None


class StagePlacing(_Attributes):
    template_name: str = ""


class SceneInstance(_Attributes):
    """*.scene_instance.json"""

    stage_instance: StagePlacing = StagePlacing()
    object_instances: tuple[Placing, ...] = ()
    articulated_object_instances: tuple[Placing, ...] = ()
    """Their translation is that of the root link, whatever translation_origin says, as in Habitat."""
    default_lighting: str = ""
    translation_origin: Lower = ""
    semantic_scene_instance: str = ""


class Region(_Attributes):
    """A room: a polygon on the floor, pulled up. Points are x, y, z."""

    name: str = ""
    label: str = ""
    poly_loop: tuple[Vec3, ...]
    floor_height: float = 0.0
    extrusion_height: float = 0.0


class Semantics(_Attributes):
    """*.semantic_config.json"""

    region_annotations: tuple[Region, ...] = ()


class Nested(_Attributes):
    """An entry of `configs` in a *.scene_dataset_config.json: attributes of a template without a file of its own."""

    original_file: str = ""
    """What is changed; empty: a template is made from the defaults."""
    template_handle: str = ""
    """What the result is called; empty: as what is changed."""
    attributes: dict[str, Any]

    @model_validator(mode="after")
    def _named(self) -> Nested:
        if not (self.original_file or self.template_handle):
            raise ValueError("an entry of configs needs an original_file or a template_handle")
        return self


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object. Raises SceneError if the file is missing or not a JSON object."""
    try:
        found = json.loads(path.read_text("utf-8"))
    except OSError as error:
        raise SceneError(f"{path} cannot be read: {error.strerror}.", "Download the dataset again.") from error
    except ValueError as error:
        remedy = "A file that begins with `version https://git-lfs` was not fetched: run `git lfs pull` in the dataset."
        raise SceneError(f"{path} is not JSON: {error}.", remedy) from error
    if not isinstance(found, dict):
        raise SceneError(f"{path} must hold a JSON object; it holds a {type(found).__name__}.")
    return found


def checked(model: type[M], values: dict[str, Any], path: Path) -> M:
    """Return the values of a file as a model. Raises SceneError that names the file and the field."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise SceneError(f"{path}: {where or 'it'}: {first['msg']}; got {str(first['input'])[:80]}.") from error
