"""Model cards: one beside each checkpoint, from its header and the fidelity report on it."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from humanclaw.motion import read_header, shipped_base
from humanclaw.storage import write_atomically
from humanclaw_train.eval.fidelity import REPORT, FidelityReport, Notes, Ratio, Row
from humanclaw_train.eval.rollouts import file_digest
from humanclaw_train.eval.walks import Uncommanded

CARD: Final = "README.md"
"""File name of a card, which repository pages show with the folder."""
_TEMPLATE: Final = Path(__file__).parent / "templates" / "card.md.j2"

_BINDING: Final = re.compile(r"\b(SA|NC|GPL)\b|share.?alike|non.?commercial", re.IGNORECASE)
"""What the licence of data says if it binds the weights that are made of them."""
_ATTRIBUTIONS: Final = {
    "CMU Graphics Lab Motion Capture Database": (
        "obtained from mocap.cs.cmu.edu; the database was created with funding from NSF EIA-0196217"
    ),
    "ReActIdle": "Copyright (c) 2025 RSAIT",
    "HDM05": (
        "M. Mueller, T. Roeder, M. Clausen, B. Eberhardt, B. Krueger, A. Weber, *Documentation Mocap Database HDM05*, "
        "CG-2007-2, Universitaet Bonn, 2007"
    ),
}
"""Attributions that the owners of the data ask for."""
_BASE_LIMITS: Final = (
    "All sitting, all regular stairs and nearly all steps to the side and back are synthetic.",
    "Arms move little in turns on the spot and side steps: 8 to 9 cm to and fro, against 40 cm in walking.",
    "Small errors add up over long series of calls.",
)
"""Limits of the shipped base, which its data and report do not tell."""


def card(checkpoint: Path, report: FidelityReport | None = None) -> str:
    """Return the model card of one checkpoint as Markdown. A report on other weights is ignored.

    Raises CheckpointError.
    """
    import jinja2

    # Strict: a misspelt name in the template is an error, not an empty cell.
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    return environment.from_string(_TEMPLATE.read_text("utf-8")).render(_facts(checkpoint, report))


def _facts(checkpoint: Path, report: FidelityReport | None) -> dict[str, Any]:
    header = read_header(checkpoint)
    notes, data = header["card"], header["card"]["data"]
    adapter = header.get("adapter", {})
    row = _row(header, checkpoint, report)
    shipped = read_header(shipped_base())
    ours = header.get("digest") == shipped["digest"]
    inherited = header.get("base") == shipped["digest"] and _same_data(notes, shipped["card"])
    licence = _package_licence(checkpoint)[1]
    return {
        **header,
        "title": f"Adapter of `{adapter['skill']}`" if adapter else "Motion prior",
        "licence": "other" if " " in licence else licence.lower() or "unknown",
        "base": header.get("base", ""),
        "digest": header.get("digest") or file_digest(checkpoint),
        "megabytes": checkpoint.stat().st_size / 1e6,
        "condition": f"`{adapter.get('encoder')}` of {', '.join(adapter.get('params', ())) or 'nothing'}",
        "data": data,
        "recipe": notes["recipe"],
        "sources": _sources(data["sources"], notes["licences"], inherited),
        "inherited": inherited,
        "licences": notes["licences"],
        "terms": terms(notes["licences"]),
        "share": lambda count: f"{100 * count / max(data['chunks'], 1):.0f} %",
        "ranges": list(zip(*(data.get(key, ()) for key in ("params_low", "params_high")), strict=True)),
        "names": adapter.get("params", ()),
        "report": report if report and report.base == header.get("base", header.get("digest")) else None,
        "row": row,
        "besides": _uncommanded(row.uncommanded) if row else "",
        "ratio": _ratio,
        "limits": Notes.read(checkpoint.parent).limits if adapter else _BASE_LIMITS if ours else (),
        "retimed": "retimed" in data["sources"],
    }


def _row(header: Mapping[str, Any], checkpoint: Path, report: FidelityReport | None) -> Row | None:
    if report is None or report.base != header.get("base"):
        return None
    digest = file_digest(checkpoint)
    return next((row for row in report.rows if row.adapter == digest), None)


def _same_data(notes: Mapping[str, Any], base: Mapping[str, Any]) -> bool:
    """Return whether an adapter's sources are among those of its base, under the same licences."""
    return {*notes["data"]["sources"]} <= {*base["data"]["sources"]} and {*notes["licences"]} == {*base["licences"]}


def _sources(counted: Mapping[str, int], licences: Sequence[str], inherited: bool) -> list[str]:
    """Return a line for each source of the data: number of chunks; unless inherited, licence and attribution."""
    texts = dict(text.partition(": ")[::2] for text in licences)
    lines = []
    for source in dict.fromkeys([*counted, *texts]):
        if source == "composed":  # Synthesised from the clips: the card counts such chunks apart.
            continue
        if inherited:
            lines.append(f"{source} {counted.get(source, 0):,}")
            continue
        line = f"{source}: {texts.get(source, 'licence not given')}"
        line = "these clips at other paces" if source == "retimed" else line
        line += "".join(f"; {text}" for name, text in _ATTRIBUTIONS.items() if source.startswith(name))
        lines.append(line + (f"; {counted[source]:,}" if source in counted else ""))
    return lines


def terms(licences: Sequence[str]) -> tuple[str, ...]:
    """Return the licences of data that bind what is made of them: share-alike and non-commercial ones."""
    named = dict.fromkeys(text.partition(": ")[2] for text in licences)
    return tuple(licence for licence in named if _BINDING.search(licence))


def _uncommanded(travel: Uncommanded) -> str:
    """Return travel of half a unit or more on axes that the skill does not command, as words with units."""
    units = {"hips.left": ("left", 100.0, "cm"), "hips.forward": ("ahead", 100.0, "cm")}
    parts = []
    for name, values in travel.items():
        way, scale, unit = units.get(name, ("turn", 180 / math.pi, "degrees"))
        if max(abs(scale * value) for value in values) >= 0.5:
            parts.append(f"{way} {' / '.join(f'{scale * value:+.1f}' for value in values)} {unit}")
    return ", ".join(parts)


def _ratio(ratio: Ratio) -> str:
    return f"{ratio.mean:.3f} ± {ratio.std:.3f}"


# -- writing -----------------------------------------------------------------------------------------------------------
def write(files: Sequence[Path], base: Path, check: bool = False) -> list[Path]:
    """Write the card beside each checkpoint. Returns the cards that were out of date. check: write nothing.

    The report beside the checkpoint is used, or else the one beside the base.
    """
    stale = []
    for file in files:
        report = next((path for path in (file.with_name(REPORT), base.with_name(REPORT)) if path.is_file()), None)
        text = card(file, FidelityReport.load(report) if report else None)
        path = file.with_name(CARD)
        if not path.is_file() or path.read_text("utf-8") != text:
            stale.append(path)
            if not check:
                write_atomically(path, text.encode())
    return stale


def _package_licence(file: Path) -> tuple[Path | None, str]:
    """Return the pyproject.toml of the package that holds a checkpoint, and the licence that it names."""
    projects = [folder / "pyproject.toml" for folder in file.resolve().parents[1:5]]
    project = next((path for path in projects if path.is_file()), None)
    content = tomllib.loads(project.read_text("utf-8")) if project else {}
    return project, str(content.get("project", {}).get("license", ""))


def unlike(file: Path) -> str:
    """Return a warning if the package of a checkpoint does not name a licence that its data bind it to."""
    project, licence = _package_licence(file)
    wanted = [term.replace(" ", "-") for term in terms(read_header(file)["card"]["licences"])]
    lacking = [term for term in wanted if term not in licence]
    if project is None or not lacking:
        return ""
    mended = " AND ".join([licence, *lacking])
    warning = f'warning: {project} says license = "{licence}", and the weights are made of data under'
    return f'{warning} {", ".join(lacking)}. Write license = "{mended}".\n'
