"""Contracts of the forms of a joint: copies, pickles, files, and programs of both back ends."""

import copy
import dataclasses
import pickle
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jounce.constraints import catalogue
from jounce.constraints.facts import field_kinds
from jounce.errors import UnitWarning
from jounce.execution.backends import LLVM
from jounce.execution.mapped import Mapped
from jounce.io import load, write_mechanism
from jounce.jet import Jet
from jounce.mechanism import Body, Mechanism
from jounce.rigid import PlanarPose, SpatialPose
from jounce.testing.samples import BODIES, INSTANT, group_of, pose_of, random_motion
from jounce.testing.subject import Broken, SkippedContract, Subject, residual

LANES = 9  # instants: more than one vector of the processor, with a remainder


def copies(subject: Subject) -> None:
    """Check that copies and pickles of a joint equal the joint and have the same hash."""
    element = subject.samples.element(subject.random())
    vectors = (name for name, kind in field_kinds(type(element)).items() if kind == "vector")
    given = {name: tuple(value) for name in vectors if (value := getattr(element, name)) is not None}
    names = (name for name, kind in field_kinds(type(element)).items() if kind == "points")
    given |= {name: tuple(map(tuple, getattr(element, name))) for name in names}
    element = dataclasses.replace(element, **given)  # lists have no hash
    copies_made = {"copy.copy": copy.copy(element), "copy.deepcopy": copy.deepcopy(element)}
    kind = type(element)
    if _by_name(kind) is kind:
        copies_made["pickle"] = pickle.loads(pickle.dumps(element))
    for method, other in copies_made.items():
        if type(other) is not kind or not bool(other == element) or hash(other) != hash(element):
            raise Broken(f"a joint from {method} is not equal to the original, or has another hash")
    if "pickle" not in copies_made:
        raise SkippedContract(
            f"copies are equal; pickle finds no class {kind.__qualname__} in the module {kind.__module__}"
        )


def _by_name(kind: type[Any]) -> Any:
    value: Any = sys.modules.get(kind.__module__)
    for name in kind.__qualname__.split("."):
        value = getattr(value, name, None)
    return value


def files(subject: Subject) -> None:
    """Check that writing a mechanism with the joint to a file and reading it gives the same mechanism."""
    kind, space = subject.samples.kind, subject.space
    role = kind.role or "joint"
    if catalogue(space, role).get(kind.type_name) is not kind:
        raise SkippedContract("it has no type name for files")
    element = subject.samples.element(subject.random())
    mechanism = Mechanism(
        space=space,
        bodies={name: Body([0.0] * (2 if space == "planar" else 3)) for name in BODIES[1:]},
        joints={"own": element} if role == "joint" else {},
        drivers={"own": element} if role == "driver" else {},
    )
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", UnitWarning)  # numbers are random
        path = Path(folder) / "mechanism.json"
        write_mechanism(mechanism, path)
        read = getattr(load(path), f"{role}s")["own"]
    motion = random_motion(subject.random(), space, 2)
    first, second = (residual(group_of([variant], space), motion) for variant in (element, read))
    if type(read) is not kind or not np.array_equal(first, second):
        raise Broken("a joint that was written to a file and read is not the same")


def back_ends(subject: Subject) -> None:
    """Check that machine code, XLA, and evaluation one operation after another give the same residual derivatives."""
    random, pose_type = subject.random(), PlanarPose if subject.space == "planar" else SpatialPose
    group = group_of([subject.samples.element(random)], subject.space)
    pose = pose_of(random_motion(random, subject.space, 2, batch=LANES))
    coordinates = {name: [np.asarray(c) for c in jet.dense().coefficients] for name, jet in pose.coordinates().items()}
    instants = np.linspace(INSTANT, INSTANT + 0.2, LANES)[None]

    def run(group: Any, lanes: Any) -> Any:
        coordinates, instant = lanes
        pose = pose_type.from_coordinates({name: Jet(given) for name, given in coordinates.items()})
        return list(group.residual(pose, Jet.variable(instant, 2)).dense().coefficients)

    lanes = (coordinates, instants)
    expected = np.array(run(group, lanes))
    subject.same(jax.jit(run)(group, lanes), expected, 1e-13, "XLA's program gives another residual")
    program = Mapped(run).program(group, lanes)
    if program.backend != LLVM:
        raise SkippedContract(
            "XLA agrees; there is no machine code for an operation of the residual, or none is made here"
        )
    subject.same(program(lanes), expected, 1e-13, "machine code gives another residual")
