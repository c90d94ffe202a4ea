"""All public names of the package: the most used ones, and those of its modules by subject."""

import functools

import jounce as jn
from jounce.base import moved_names


def offered():
    """Return what is public by its name within the package, such as "solve" and "outputs.PointOutput"."""
    old = [*moved_names.RENAMED, *(name for names in moved_names.MOVED.values() for name in names.split())]
    names = dict.fromkeys([*jn.__all__, *map(moved_names.new_name, old)])
    for module in (jn.outputs, jn.laws, jn.joints, jn.cams, jn.energy):
        subject = module.__name__.partition(".")[2]
        names |= dict.fromkeys(f"{subject}.{name}" for name in vars(module) if not name.startswith("_"))
    return {name: functools.reduce(getattr, name.split("."), jn) for name in names}
