"""The JSON files of a scene dataset as values: https://aihabitat.org/docs/habitat-sim/attributesJSON.html.

The models keep the fields that decide what a body can touch or see. They ignore the others (lights, shaders, margins,
navigation meshes).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from humanclaw import SceneError
from humanclaw.records import first_fault
from humanclaw.storage import read_file

LARGEST: Final = 64 << 20
"""Maximum bytes of a text file of a dataset; of episodes, also unpacked."""

MOST: Final = 1000.0
"""Largest coordinate, metres, and largest scale: a grid of a larger place would not fit into memory."""
Number = Annotated[float, Field(ge=-MOST, le=MOST)]
Vec3 = tuple[Number, Number, Number]
Lower = Annotated[str, BeforeValidator(lambda value: value.lower() if isinstance(value, str) else value)]


class Attributes(BaseModel):
    """Values of a file; what nobody reads is ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


M = TypeVar("M", bound=Attributes)


class Template(Attributes):
    """A stage or an object before a scene places it. Paths are relative to the file that names them."""

    render_asset: str = ""
    collision_asset: str = ""
    up: Vec3 = (0.0, 1.0, 0.0)
    """The direction in the asset's own frame that becomes +Y."""
    front: Vec3 = (0.0, 0.0, -1.0)
    """The direction in the asset's own frame that becomes -Z, which is forward in Habitat."""
    scale: Vec3 = (1.0, 1.0, 1.0)
    units_to_meters: Annotated[float, Field(gt=0, le=MOST)] = 1.0
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
        # Exporters round the axes: a cosine of up to 0.001 (0.06 degrees) still counts as a right angle.
        if size < 1e-9 or abs(up @ front) > 1e-3 * size:
            raise ValueError(f"up and front must be orthogonal; got {self.up} and {self.front}")
        return self


class StagePlacing(Attributes):
    """The building of a scene. rotation: a quaternion w, x, y, z."""

    template_name: str = ""
    translation: Vec3 = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


class Placing(StagePlacing):
    """One object of a scene."""

    template_name: str
    uniform_scale: Number = 1.0
    non_uniform_scale: Vec3 = (1.0, 1.0, 1.0)
    motion_type: Lower = ""
    translation_origin: Lower = ""
    mass_scale: Annotated[float, Field(gt=0)] = 1.0
    initial_joint_pose: tuple[float, ...] | dict[str, float] = ()
    """Of an articulated object: where its joints are, in the file's order or by name, radians and metres."""

    @model_validator(mode="after")
    def _known(self) -> Placing:
        if self.motion_type not in ("", "undefined", "static", "kinematic", "dynamic"):
            raise ValueError(f"motion_type must be static, kinematic or dynamic; got {self.motion_type!r}")
        if self.translation_origin not in ("", "unknown", "com", "asset_local"):
            raise ValueError(f"translation_origin must be asset_local or COM; got {self.translation_origin!r}")
        if not 0.9 < np.linalg.norm(self.rotation) < 1.1:
            raise ValueError(f"rotation must be a unit quaternion w, x, y, z; got {self.rotation}")
        return self


class Articulated(Attributes):
    """*.ao_config.json: an object of links and joints. Paths are relative to the file that names them."""

    urdf_filepath: str = ""
    """The model. Empty: the file beside the config with the same name."""
    uniform_scale: Annotated[float, Field(gt=0, le=MOST)] = 1.0
    semantic_id: int | None = None


class SceneInstance(Attributes):
    """*.scene_instance.json"""

    stage_instance: StagePlacing = StagePlacing()
    object_instances: tuple[Placing, ...] = ()
    articulated_object_instances: tuple[Placing, ...] = ()
    """Articulated objects. As in Habitat, translation places the root link, whatever translation_origin says."""
    default_lighting: str = ""
    translation_origin: Lower = ""
    semantic_scene_instance: str = ""


class Region(Attributes):
    """A room: a polygon on the floor, extruded upwards. Points are x, y, z in metres."""

    name: str = ""
    label: str = ""
    poly_loop: tuple[Vec3, ...]
    floor_height: Number = 0.0


class Semantics(Attributes):
    """*.semantic_config.json"""

    region_annotations: tuple[Region, ...] = ()


class Section(Attributes):
    """A section of a *.scene_dataset_config.json."""

    paths: dict[str, tuple[str, ...]] = {}
    """Ending of a file name to files, folders and patterns."""
    default_attributes: dict[str, Any] = {}


class Label(Attributes):
    id: int
    name: str


class Lexicon(Attributes):
    """The file of a dataset that names semantic ids."""

    classes: tuple[Label, ...] = ()


class Nested(Attributes):
    """An entry of `configs` in a *.scene_dataset_config.json: attributes of a template that has no file of its own."""

    original_file: str = ""
    """The file whose attributes it changes. Empty: a new template starts from the defaults."""
    template_handle: str = ""
    """Name of the result. Empty: the name of the original file."""
    attributes: dict[str, Any]

    @model_validator(mode="after")
    def _named(self) -> Nested:
        if not (self.original_file or self.template_handle):
            raise ValueError("an entry of configs needs an original_file or a template_handle")
        return self


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object. Raises SceneError if the file is missing or holds anything else."""
    try:
        values = json.loads(read_file(path, LARGEST))
    except OSError as error:
        raise SceneError(f"{path} cannot be read: {error.strerror}.", "Download the dataset again.") from error
    except (ValueError, RecursionError) as error:
        remedy = "If it begins with `version https://git-lfs`, run `git lfs pull` in the dataset."
        raise SceneError(f"{path} is not JSON: {error}.", remedy) from error
    if not isinstance(values, dict):
        raise SceneError(f"{path} must hold a JSON object; it holds a {type(values).__name__}.")
    return values


def checked(model: type[M], values: dict[str, Any], path: Path) -> M:
    """Validate the values of a file. Raises a SceneError that names the file and the field."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        got = str(error.errors()[0]["input"])[:80]
        raise SceneError(f"{path}: {first_fault(error)}; got {got}.") from error
