"""Print the lowest releases that pyproject.toml allows, one ``name==version`` a line, as constraints for pip.

``python .ci/bounds.py EXTRA...`` includes those of extras. It needs the package `packaging`.
"""

import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path

from packaging.requirements import Requirement

PROJECT = Path(__file__).parents[1] / "pyproject.toml"


def lowest(requirements: Iterable[str]) -> list[str]:
    """Return the pins of requirements to the lowest release of each; a ValueError if one has no lower bound."""
    pins = {}
    for requirement in map(Requirement, requirements):
        bounds = [one.version for one in requirement.specifier if one.operator in (">=", "==", "~=")]
        if len(bounds) != 1:
            raise ValueError(f"{requirement}: needs one lower bound")
        pins[requirement.name] = bounds[0]
    return [f"{name}=={version}" for name, version in sorted(pins.items(), key=lambda pin: pin[0].lower())]


if __name__ == "__main__":
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    extras = [entry for name in sys.argv[1:] for entry in project["optional-dependencies"][name]]
    print("\n".join(lowest(project["dependencies"] + extras)))
