"""A scene dataset on disk: its stages, objects and scenes, and the categories of its objects."""

from __future__ import annotations

import csv
import difflib
import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from humanclaw import SceneError
from humanclaw.storage import read_file, within
from humanclaw_habitat.attributes import (
    LARGEST,
    Articulated,
    Lexicon,
    Nested,
    Region,
    SceneInstance,
    Section,
    Semantics,
    Template,
    checked,
    read_json,
)
from humanclaw_habitat.categories import category_of

CONFIG: Final = ".scene_dataset_config.json"
SCENE: Final = ".scene_instance.json"
_SUFFIXES: Final = {"stages": ".stage_config.json", "objects": ".object_config.json",
                    "articulated_objects": ".ao_config.json", "scene_instances": SCENE,
                    "semantic_scene_descriptor_instances": ".semantic_config.json"}  # fmt: skip
_MODELS: Final = (".glb", ".gltf", ".obj", ".ply", ".stl", ".urdf")


@dataclass(frozen=True)
class Kind:
    """A template: its attributes, the file that its paths are relative to, and the folder that they must stay in."""

    name: str
    file: Path
    template: Template
    root: Path
    others: tuple[str, ...] = ()
    """Templates that the name fits too; as in Habitat, the first by path is taken."""

    def path(self, asset: str) -> Path:
        """Return the path of an asset. Raises SceneError for a file outside of the dataset."""
        try:
            return within(self.root, (self.file.parent / asset).absolute())
        except ValueError as error:
            raise SceneError(f"{self.file} names a file outside of its dataset: {error}.") from None


@dataclass(frozen=True)
class _Source:
    """Where the attributes of a name come from: a file, and the changes that the dataset's own config makes to it."""

    file: Path
    changes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def values(self) -> dict[str, Any]:
        """Attributes of the file with the changes applied. Raises SceneError if the file cannot be read."""
        if self.file.name.endswith(CONFIG):
            return dict(self.changes)
        own: dict[str, Any] = {"render_asset": self.file.name}
        if self.file.suffix == ".json":
            own = read_json(self.file)
        return {**own, **self.changes}


@dataclass(frozen=True)
class Dataset:
    """A *.scene_dataset_config.json and the files that it names. The files are found and read on first use."""

    config: Path

    @classmethod
    def open(cls, path: Path) -> Dataset:
        """Open a dataset. path: its config, or the folder that holds exactly one. Raises SceneError."""
        if path.name.endswith(CONFIG):
            return cls(path)
        if not path.is_dir():
            raise SceneError(f"there is no scene dataset {path}.", f"Name a folder with a *{CONFIG}.")
        configs = sorted(path.glob(f"*{CONFIG}"))
        if len(configs) != 1:
            names = ", ".join(file.name for file in configs) or "none"
            raise SceneError(f"{path} should hold one *{CONFIG}; it holds {names}.", "Name the file itself.")
        return cls(configs[0])

    @property
    def name(self) -> str:
        return self.config.name[: -len(CONFIG)]

    @cached_property
    def licence(self) -> str:
        """Licence in the front matter of README.md, as on Hugging Face; 'not stated' if it is not there."""
        readme = self.config.parent / "README.md"
        text = read_file(readme, LARGEST).decode("utf-8", errors="replace") if readme.is_file() else ""
        licence = re.match(r"---\n.*?^license:\s*(\S+)\s*$.*?^---$", text, re.DOTALL | re.MULTILINE)
        return licence[1] if licence else "not stated"

    @cached_property
    def _values(self) -> dict[str, Any]:
        return read_json(self.config)

    def _section(self, name: str) -> dict[str, Any]:
        """Return a section as the file has it. Raises SceneError if its paths or defaults are of no use."""
        section = self._values.get(name, {})
        checked(Section, section, self.config)
        return dict(section)

    def _files(self, section: str) -> Iterator[Path]:
        """Yield every file that a section's paths name: each path is a file, a folder or a pattern."""
        paths = self._section(section).get("paths", {})
        for suffix, patterns in sorted(paths.items()):
            endings = (_SUFFIXES[section],) if suffix == ".json" else _MODELS
            for pattern in patterns:
                for place in _places(self.config.parent, pattern):
                    inside = sorted(place.iterdir()) if place.is_dir() else [place]
                    yield from (file for file in inside if file.name.endswith(endings) and file.is_file())

    def _index(self, section: str) -> dict[str, _Source]:
        """Return name to source. The dataset's own config wins over a config file, which wins over a bare model."""
        sources: dict[str, _Source] = {}
        for file in self._files(section):
            name = _stem(file)
            if name not in sources or (file.suffix == ".json" and sources[name].file.suffix != ".json"):
                sources[name] = _Source(file)
        for entry in self._section(section).get("configs", ()):
            name, source = self._nested(section, entry, sources)
            sources[name] = source
        return sources

    def _nested(self, section: str, entry: Any, known: Mapping[str, _Source]) -> tuple[str, _Source]:
        """Return name and source of an entry in a section's `configs`: a changed file, or a new template.

        Its paths are relative to the changed file, or to the dataset's config if it is new.
        """
        changed = checked(Nested, entry if isinstance(entry, dict) else {}, self.config)
        base = _stem(Path(changed.original_file))
        if base and base not in known:
            what = f"{section}.configs changes {changed.original_file}, which is not among its {len(known)} files"
            raise SceneError(f"{self.config}: {what}.", "Check that the dataset is complete.")
        source = known[base] if base else _Source(self.config)
        name = _stem(Path(changed.template_handle)) or base
        return name, replace(source, changes={**source.changes, **changed.attributes})

    @cached_property
    def _templates(self) -> Mapping[str, dict[str, _Source]]:
        return {section: self._index(section) for section in ("stages", "objects", "articulated_objects")}

    @cached_property
    def scenes(self) -> Mapping[str, _Source]:
        """Name to source of each scene, sorted by name."""
        return dict(sorted(self._index("scene_instances").items()))

    def scene_name(self, wanted: str) -> str:
        """Return a known scene name; without one, the only scene. Raises SceneError."""
        names = list(self.scenes)
        if not wanted and len(names) == 1:
            return names[0]
        if wanted in self.scenes:
            return wanted
        near = difflib.get_close_matches(wanted, names, n=3) or names[:3]
        known = f"{self.config} has {len(names)} scenes" + (f", such as {', '.join(near)}." if near else ".")
        what = f"there is no scene {wanted!r}" if wanted else "no scene is named"
        raise SceneError(f"{what}: {known}", "Name one after #; `humanclaw habitat scenes PATH` lists them.")

    def scene(self, name: str) -> SceneInstance:
        source = self.scenes[name]
        return checked(
            SceneInstance, self._section("scene_instances").get("default_attributes", {}) | source.values, source.file
        )

    def stage(self, name: str) -> Kind:
        return self._kind("stages", name)

    def furniture(self, name: str) -> Kind:
        return self._kind("objects", name)

    def articulated(self, name: str) -> Kind:
        """Return an object of links and joints. Its URDF is both the visual and the collision model.

        Raises SceneError.
        """
        (chosen, *_), source, values = self._found("articulated_objects", name)
        attributes = checked(Articulated, values, source.file)
        model = attributes.urdf_filepath or f"{_stem(source.file)}.urdf"
        scale = (attributes.uniform_scale,) * 3
        template = Template(render_asset=model, collision_asset=model, scale=scale, semantic_id=attributes.semantic_id)
        return Kind(chosen, source.file, template, self._home(source.file))

    def _kind(self, section: str, name: str) -> Kind:
        (chosen, *others), source, values = self._found(section, name)
        return Kind(chosen, source.file, checked(Template, values, source.file), self._home(source.file), tuple(others))

    def _home(self, file: Path) -> Path:
        """Return the folder that a template's models must stay in.

        That is the dataset. For a template that lies outside it, it is the folder above the template's own: datasets
        may share objects with a dataset beside them.
        """
        try:
            within(self.config.parent, file.absolute())
        except ValueError:
            return file.parent.parent
        return self.config.parent

    def _found(self, section: str, name: str) -> tuple[list[str], _Source, dict[str, Any]]:
        """Return the fitting names, and source and attributes of the first. As in Habitat, a part of a name is enough.

        Raises SceneError.
        """
        known, names = self._templates[section], self._fitting(section, name)
        if not names:
            message = f"template {name!r} is not among the {len(known)} {section} of {self.config}."
            raise SceneError(message, "Check that the dataset is complete.")
        source = known[names[0]]
        return names, source, self._section(section).get("default_attributes", {}) | source.values

    def _fitting(self, section: str, name: str) -> list[str]:
        """Return the template of a name; without one, those whose names contain it, sorted by path as Habitat sorts."""
        known, base = self._templates[section], _stem(Path(name))
        if base in known:
            return [base]
        return sorted(
            (key for key in known if name and base in key), key=lambda key: (str(known[key].file.parent), key)
        )

    def regions(self, name: str, scene: SceneInstance) -> tuple[Region, ...]:
        """Return the annotated rooms of a scene; empty if it has no annotation."""
        wanted = scene.semantic_scene_instance.replace("%%CONFIG_NAME_AS_ASSET_FILENAME%%", name)
        known = self._index("semantic_scene_descriptor_instances")
        source = known.get(_stem(Path(wanted))) or known.get(name)
        return checked(Semantics, source.values, source.file).region_annotations if source else ()

    @cached_property
    def _rows(self) -> Mapping[str, Mapping[str, str]] | None:
        """Object id to its row in semantics/objects.csv; None if there is no such file."""
        file = self.config.parent / "semantics" / "objects.csv"
        if not file.is_file():
            return None
        try:
            reader = csv.DictReader(io.StringIO(read_file(file, LARGEST).decode("utf-8-sig"), newline=""))
            rows, columns = list(reader), reader.fieldnames or ()
        except (UnicodeDecodeError, csv.Error) as error:
            raise SceneError(f"{file} must be a table (CSV) in UTF-8: {error}.", "Save it as UTF-8.") from error
        if "id" not in columns:
            raise SceneError(f"{file} must have a column id; it has {', '.join(columns) or 'none'}.")
        return {row["id"]: row for row in rows}

    @cached_property
    def _lexicon(self) -> Mapping[int, str]:
        """Semantic id to name."""
        named = self._section("semantic_scene_descriptor_instances")
        texts = [named.get("default_attributes", {}).get("semantic_descriptor_filename", "")]
        texts += [value for value in named.values() if isinstance(value, str)]
        for text in filter(None, texts):
            # The path is relative to the file of a scene, in a folder of its own: from here it may lead nowhere.
            for file in (self.config.parent / text, self.config.parent / "semantics" / Path(text).name):
                if file.is_file():
                    return {label.id: label.name for label in checked(Lexicon, read_json(file), file).classes}
        return {}

    def category(self, kind: Kind) -> str:
        """Return the category of an object, as this project names it.

        It comes from semantics/objects.csv. Semantic ids count only in a dataset without that file.
        """
        if self._rows is None:
            return category_of([self._lexicon.get(kind.template.semantic_id or -1, "")])
        # HSSD splits some objects into X_part_1, X_part_2; the table may list only X.
        row = self._rows.get(kind.name) or self._rows.get(kind.name.split("_part_")[0]) or {}
        words = [row.get(column) or "" for column in ("main_category", "category", "wnsynsetkey", "super_category")]
        return category_of([word.split(".")[0] for word in words])


def _places(folder: Path, pattern: str) -> list[Path]:
    """Return the files and folders that a path or a pattern names, relative to a folder."""
    place = folder / pattern
    if place.exists() or Path(pattern).is_absolute():
        return [place]
    try:
        return sorted(folder.glob(pattern)) if pattern else [folder]
    except ValueError as error:
        raise SceneError(f"{folder}: the path {pattern!r} is no pattern: {error}.") from error


def _stem(file: Path) -> str:
    """Return a file name without its folder and without a known ending."""
    for ending in (*_SUFFIXES.values(), *_MODELS):
        if file.name.endswith(ending):
            return file.name[: -len(ending)]
    return file.name
