"""Recursive Newton-Euler algorithm on jets: forces and torques of a tree of bodies, with rates of any order.

Vectors are in the frame of each body, whose z is the axis of its joint. The outward pass carries jets of the angular
velocity w and of the velocity v of the origin. A force is the rate of a momentum in the rotating frame,
``f = p' + w x p``; only these products and the rotations between frames are nonlinear. Gravity is represented by a base
that accelerates the other way.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import Numbers
from jounce.jet import Jet, components, concatenate, cross, matvec, next_sine_cosine
from jounce.jet.algebra import bilinear, stacked, total
from jounce.robot.model.tree import Tree
from jounce.robot.recursions.tree_scan import (
    Series,
    entries,
    fill_slots,
    joint_coordinates,
    materialised,
    read_slot,
    write_slot,
)

BodyWrenches = Float[Numbers, "levels body 6 batch"]
"""Taylor coefficients of a force and a moment about the origin of each body, in its frame."""
Rates = Float[Numbers, "order-2 body batch"]
RatesOfVectors = Float[Numbers, "order-2 body 3 batch"]

QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])  # a quarter turn about z, of x and y


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Turn:
    """The rotation from a body to its parent, ``M Rz(d)``: the matrix M at the instant, and the jet of the rotation d.

    The jet starts at zero, so that sine and ``versine = cosine - 1`` have no first coefficients, and most products
    vanish. Both are computed for all joints at once before the scans, where XLA would evaluate them again for each use.
    Computing the matrix takes less time than storing it.
    """

    constant: Any  # the matrix is constant + across cosine + quarter sine, each (..., 3, 3, batch or 1)
    across: Any = None
    quarter: Any = None
    start: tuple[Any, Any] | None = None  # cosine and sine of the coordinate
    sine: Jet | None = None
    versine: Jet | None = None

    @classmethod
    def of(cls, tree: Tree, coordinates: Jet) -> "Turn":
        """Return the rotations of all bodies, for coordinates of shape (bodies, 1, batch)."""
        placement = jnp.asarray(tree.rotation)
        if not tree.shape.turning:
            return cls(placement[..., None])
        along_z = np.array([0.0, 0.0, 1.0])[None, None, :]
        constant, transverse, quarter = placement * along_z, placement * (1 - along_z), placement @ QUARTER
        angle = coordinates * jnp.asarray(tree.turning)[:, None, None] if tree.shape.sliding else coordinates
        s, c = [None], [1.0]
        for _ in range(angle.order):
            following = next_sine_cosine(s, c, angle)
            s.append(following[0])
            c.append(following[1])
        value = angle.coefficients[0][:, None]
        start = (jnp.cos(value), jnp.sin(value))
        return cls(constant[..., None], transverse[..., None], quarter[..., None], start, Jet(s), Jet([None, *c[1:]]))

    @property
    def matrix(self) -> Any:
        """The rotation matrix at the instant, shape (3, 3, batch)."""
        if self.start is None:
            return self.constant
        cosine, sine = self.start
        return self.constant + self.across * cosine + self.quarter * sine

    def outward(self, vector: Jet) -> Jet:
        """Return a vector in the frame of the body from its components in that of the parent."""
        rows = zip(self.matrix, components(vector), strict=True)
        return self._turned(total(bilinear(jnp.multiply, row, component) for row, component in rows), 1)

    def inward(self, vector: Jet) -> Jet:
        """Return a vector in the frame of the parent from its components in that of the body."""
        return matvec(self.matrix, self._turned(vector, -1))

    def _turned(self, vector: Jet, sign: int) -> Jet:
        if self.sine is None or self.versine is None:
            return vector
        x, y, z = components(vector)
        sine_terms = [bilinear(jnp.multiply, self.sine, component) for component in (y, x)]
        first, second = sine_terms if sign > 0 else (-sine_terms[0], -sine_terms[1])
        x, y = (component + bilinear(jnp.multiply, self.versine, component) for component in (x, y))
        return concatenate([x + first, y - second, z])


def _constant(value: Any) -> Any:
    return value[:, None]


def recursive_newton_euler(
    tree: Tree, q: Series, wrenches: BodyWrenches | None = None, base: tuple[Any, Any] | None = None
) -> tuple[Rates, RatesOfVectors, RatesOfVectors, tuple[Any, Any]]:
    """Return the generalized forces and the wrenches of the joints.

    Parameters
    ----------
    tree : Tree
        Arrays of the robot.
    q : array of shape (order + 1, coordinates, batch)
        Taylor coefficients of the coordinates, order 2 or more.
    wrenches : array of shape (order - 1, bodies, 6, batch), optional
        Taylor coefficients of external forces and of their moments about the origin, in the frame of each body.
    base : tuple of two arrays of shape (order, 3, batch), optional
        Angular velocity of a moving base, and velocity of its origin plus that of a fall against gravity, in base axes;
        by default a base at rest.

    Returns
    -------
    along : array of shape (order - 1, bodies, batch)
        Taylor coefficients of the force or torque along the axis of each joint.
    force, moment : array of shape (order - 1, bodies, 3, batch)
        Force on each body through its joint, and moment about the origin of the body, in its frame.
    carried : tuple of two arrays of shape (order - 1, 3, batch)
        Force and moment about its origin that the base exerts on the bodies that it carries, in base axes.
    """
    order = q.shape[0] - 1
    coordinates = joint_coordinates(tree, q)
    samples = q.shape[-1]
    if base is None:
        zero = jnp.zeros((3, samples))
        falling = jnp.broadcast_to(-jnp.asarray(tree.gravity)[:, None], (3, samples))
        base = jnp.stack([zero] * order), jnp.stack([zero, falling, *[zero] * (order - 2)])
    along_joints = Jet(tuple(coordinates[:, :, None]))
    # rotations are computed before the scan, where XLA would evaluate sine and cosine again for each use
    bodies = (
        entries(tree),
        along_joints,
        Turn.of(tree, along_joints),
        wrenches if wrenches is None else jnp.moveaxis(wrenches, 1, 0),
    )

    def outward(state: Any, entry: Any) -> tuple[Any, Any]:
        body, coordinate, turn, applied = entry
        w, v = (Jet(tuple(c)) for c in read_slot(tree, state, body.parent_slot))
        w, v = turn.outward(w), turn.outward(v + cross(w, _constant(body.position)))
        rate = coordinate.differentiate()
        if tree.shape.turning:
            turn_rate = rate * body.turning if tree.shape.sliding else rate
            x, y, z = components(w)
            w = concatenate([x, y, z + turn_rate])
        if tree.shape.sliding:
            slide = coordinate * (1 - body.turning)
            x, y, z = components(w)
            v = v + concatenate([y * slide, -(x * slide), rate * (1 - body.turning)])
        w, v = materialised((w, v))
        force, moment = inertial_wrench(body.mass, body.center, body.inertia, w, v)
        if applied is not None:
            force = Jet(f - a[:3] for f, a in zip(force.coefficients, applied, strict=True))
            moment = Jet(m - a[3:] for m, a in zip(moment.coefficients, applied, strict=True))
        state = write_slot(tree, state, body.slot, (stacked(w), stacked(v)))
        return state, (force.dense(), moment.dense())

    def inward(state: Any, entry: Any) -> tuple[Any, Any]:
        body, coordinate, turn, (force, moment) = entry
        from_children = read_slot(tree, state, body.slot)
        force, moment = (at_body + Jet(tuple(c)) for at_body, c in zip((force, moment), from_children, strict=True))
        along = Jet(c[2] for c in moment.coefficients)
        if tree.shape.sliding:
            along = along * body.turning + Jet(c[2] for c in force.coefficients) * (1 - body.turning)
        at_joint = moment
        if tree.shape.sliding:
            slide = coordinate * (1 - body.turning)
            x, y, _ = components(force)
            at_joint = moment + concatenate([-(slide * y), slide * x, 0 * x])
        parent = turn.inward(force)
        parent_moment = turn.inward(at_joint) + cross(_constant(body.position), parent)
        if tree.shape.slots > 1:
            state = write_slot(tree, state, body.slot, jax.tree.map(jnp.zeros_like, from_children))
            parent_state = read_slot(tree, state, body.parent_slot)
            passed_wrench = tuple(a + stacked(b) for a, b in zip(parent_state, (parent, parent_moment), strict=True))
            state = write_slot(tree, state, body.parent_slot, passed_wrench)
        else:
            state = (stacked(parent), stacked(parent_moment))
        return state, (stacked(along), stacked(force), stacked(moment))

    _, by_body = jax.lax.scan(outward, fill_slots(tree, base), bodies)
    nothing = jnp.zeros((order - 1, 3, samples))
    state, results = jax.lax.scan(inward, fill_slots(tree, (nothing, nothing)), (*bodies[:3], by_body), reverse=True)
    along, force, moment = (jnp.moveaxis(x, 0, 1) for x in results)
    return along, force, moment, state if tree.shape.slots == 1 else jax.tree.map(lambda x: x[0], state)


def inertial_wrench(mass: Any, center: Any, inertia: Any, w: Jet, v: Jet) -> tuple[Jet, Jet]:
    """Return the force on a body and the moment about its origin that cause a motion, all in body axes."""
    momentum = (v + cross(w, _constant(center))) * mass
    spin = matvec(inertia[:, :, None], w)
    momentum, spin = materialised((momentum, spin))
    force = momentum.differentiate() + cross(w, momentum)
    return force, spin.differentiate() + cross(w, spin) + cross(_constant(center), force)
