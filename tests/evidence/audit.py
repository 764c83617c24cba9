"""The licence of every package that this environment holds for us, and of every weight, and what pip-audit
knows to be wrong with them. A package that nobody could look up is no pass.

python tests/evidence/audit.py     # `make audit`
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution, distributions

from packaging.requirements import Requirement

from humanclaw import Plugins, Skill
from humanclaw.motion.checkpoint import read_header

FREE = re.compile(
    r"mit|bsd|apache|isc|psf|python software|zlib|libpng|mpl|mozilla|unlicense|cc0|0bsd|hpnd|historical permission|"
    r"public domain|blueoak|boost|bsl-1|mit-cmu|lgpl|lesser general",
    re.IGNORECASE,
)
"""Terms under which anybody may use, change and pass on what they get, and need not open their own."""
CHECKED = {"pybullet": "zlib (its LICENSE.txt)"}
"""Packages whose metadata names no licence, and where it was found."""


def ours() -> Iterator[Distribution]:
    return (one for one in distributions() if (one.metadata["Name"] or "").lower().startswith("humanclaw"))


def needed() -> dict[str, Distribution]:
    """Every distribution that ours need, and what those need, as far as it is installed."""
    found: dict[str, Distribution] = {}
    left = list(ours())
    while left:
        for line in left.pop().requires or ():
            asked = Requirement(line)
            if asked.name.lower() in found or (asked.marker and not asked.marker.evaluate({"extra": ""})):
                continue
            try:
                found[asked.name.lower()] = distribution(asked.name)
                left.append(found[asked.name.lower()])
            except PackageNotFoundError:
                continue
    return {name: one for name, one in sorted(found.items()) if not name.startswith("humanclaw")}


def licence(one: Distribution) -> str:
    """As its metadata names it: the expression, else the classifiers, else the first line of the text."""
    head = one.metadata
    told = [line.rsplit(" :: ", 1)[-1] for line in head.get_all("Classifier") or () if line.startswith("License ::")]
    text = (head["License"] or "").strip().split("\n")[0]
    return head["License-Expression"] or ", ".join(told) or text or CHECKED.get(head["Name"].lower(), "not stated")


def of_weights(skill: Skill) -> str:
    """The terms of the data that a skill's weights were trained on, as their header names them; empty if none does."""
    terms = read_header(skill.adapter).get("card", {}).get("licences", []) if skill.adapter and skill.trained else ["-"]
    return "; ".join(terms) if terms and all(terms) else ""


def unaudited() -> int:
    """Run pip-audit, and tell of what is known to be wrong. Returns how many packages it could say nothing of."""
    command = [sys.executable, "-m", "pip_audit", "--skip-editable", "--progress-spinner", "off", "--format", "json"]
    done = subprocess.run(command, capture_output=True, text=True)
    try:
        found = json.loads(done.stdout)["dependencies"]
    except (ValueError, KeyError):
        print(done.stderr.strip() or "pip-audit said nothing", file=sys.stderr)
        return 1
    for one in found:
        for hole in one.get("vulns", ()):
            print(
                f"! {one['name']} {one['version']}: {hole['id']}, mended in {', '.join(hole['fix_versions']) or 'none'}"
            )
    asked = [one for one in found if "editable" not in one.get("skip_reason", "")]
    skipped = [one for one in asked if "skip_reason" in one]
    print(
        f"{len(asked) - len(skipped)} of {len(asked)} packages were looked up for what is known to be wrong with them"
    )
    return len(skipped) + sum(bool(one.get("vulns")) for one in found)


def main() -> int:
    bad = 0
    for name, one in needed().items():
        terms = licence(one)
        free = bool(FREE.search(terms)) and not re.search(r"non-?commercial|\bnc\b", terms, re.IGNORECASE)
        bad += not free
        print(f"{'' if free else '! '}{name} {one.version}: {terms}")
    for name, skill in sorted(Plugins.discover().skills.items()):
        told = of_weights(skill)
        bad += not told
        print(f"{'' if told else '! '}weights of {name}: {told or 'not stated'}")
    print(f"{bad} packages and weights whose terms are not known to be free")
    bad += unaudited()
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
