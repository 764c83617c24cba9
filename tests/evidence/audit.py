"""List the licence of every required package and weight, and the vulnerabilities that pip-audit knows.

A package that could not be looked up counts as a failure: `make audit`.
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
"""Terms under which anybody may use, change and distribute a package without opening their own code."""
CHECKED = {"pybullet": "zlib (its LICENSE.txt)"}
"""Packages whose metadata names no licence, with the licence and where it stands."""


def ours() -> Iterator[Distribution]:
    return (package for package in distributions() if (package.metadata["Name"] or "").lower().startswith("humanclaw"))


def needed() -> dict[str, Distribution]:
    """Return every installed distribution that ours require, directly or not."""
    packages: dict[str, Distribution] = {}
    left = list(ours())
    while left:
        for line in left.pop().requires or ():
            asked = Requirement(line)
            if asked.name.lower() in packages or (asked.marker and not asked.marker.evaluate({"extra": ""})):
                continue
            try:
                packages[asked.name.lower()] = distribution(asked.name)
                left.append(packages[asked.name.lower()])
            except PackageNotFoundError:
                continue
    return {name: package for name, package in sorted(packages.items()) if not name.startswith("humanclaw")}


def licence(package: Distribution) -> str:
    """Return the licence in the metadata: the expression, else the classifiers, else the first line of the text."""
    head = package.metadata
    named = [line.rsplit(" :: ", 1)[-1] for line in head.get_all("Classifier") or () if line.startswith("License ::")]
    text = (head["License"] or "").strip().split("\n")[0]
    return head["License-Expression"] or ", ".join(named) or text or CHECKED.get(head["Name"].lower(), "not stated")


def of_weights(skill: Skill) -> str:
    """Return the terms of a skill's training data, from the header of its weights; empty if the header has none."""
    terms = read_header(skill.adapter).get("card", {}).get("licences", []) if skill.adapter and skill.trained else ["-"]
    return "; ".join(terms) if terms and all(terms) else ""


def unaudited() -> int:
    """Run pip-audit and print vulnerabilities. Return the number of vulnerable and of unknown packages."""
    command = [sys.executable, "-m", "pip_audit", "--skip-editable", "--progress-spinner", "off", "--format", "json"]
    done = subprocess.run(command, capture_output=True, text=True)
    try:
        packages = json.loads(done.stdout)["dependencies"]
    except (ValueError, KeyError):
        print(done.stderr.strip() or "pip-audit printed nothing", file=sys.stderr)
        return 1
    for package in packages:
        for hole in package.get("vulns", ()):
            fixed = ", ".join(hole["fix_versions"]) or "none"
            print(f"! {package['name']} {package['version']}: {hole['id']}, fixed in {fixed}")
    asked = [package for package in packages if "editable" not in package.get("skip_reason", "")]
    skipped = [package for package in asked if "skip_reason" in package]
    print(f"{len(asked) - len(skipped)} of {len(asked)} packages were looked up for vulnerabilities")
    return len(skipped) + sum(bool(package.get("vulns")) for package in packages)


def main() -> int:
    bad = 0
    for name, package in needed().items():
        terms = licence(package)
        free = bool(FREE.search(terms)) and not re.search(r"non-?commercial|\bnc\b", terms, re.IGNORECASE)
        bad += not free
        print(f"{'' if free else '! '}{name} {package.version}: {terms}")
    for name, skill in sorted(Plugins.discover().skills.items()):
        terms = of_weights(skill)
        bad += not terms
        print(f"{'' if terms else '! '}weights of {name}: {terms or 'not stated'}")
    print(f"{bad} packages and weights whose licence is missing or not free")
    bad += unaudited()
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
