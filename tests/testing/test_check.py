"""Classes that break one contract each are named by it; what says nothing of a class is told."""

import jax.numpy as jnp
import pytest

import jounce as jn
from jounce import planar
from jounce.jet import Jet, cross
from jounce.testing import ContractError, JointReport, check_joint

pytestmark = pytest.mark.long


class Frozen(jn.joints.AbstractConstraint, space="planar"):
    """A place that depends on time, whose rates it leaves out."""

    point_j: jn.joints.Vector

    def residual(self, body_i, body_j, time):
        late = Jet.constant(jnp.sin(time.coefficients[0]), time.order)
        return body_j.point(self.point_j)[0] - body_i.position[0] - late


class Mapped(jn.joints.AbstractConstraint, space="planar"):
    """A function taken of each coefficient by itself, which is none of jets."""

    def residual(self, body_i, body_j, time):
        del time
        return (body_j.angle - body_i.angle).map(jnp.sin)


class Global(jn.joints.AbstractConstraint, space="planar"):
    def residual(self, body_i, body_j, time):
        del time
        return body_j.position[0] - 0.3 * body_i.position[1]


class Twice(jn.joints.AbstractConstraint, space="planar"):
    point_j: jn.joints.Vector

    def residual(self, body_i, body_j, time):
        del time
        d = body_j.point(self.point_j) - body_i.position
        return jn.joints.rows(d[0], d[1], d[0] + d[1])


class Nowhere(jn.joints.AbstractConstraint, space="planar"):
    point_j: jn.joints.Vector

    def residual(self, body_i, body_j, time):
        del time
        d = body_j.point(self.point_j) - body_i.position
        return d.dot(d) + 1.0


class Across(jn.joints.AbstractConstraint, space="planar"):
    """Directions at a right angle, which are said to be parallel."""

    vector_i: jn.joints.Vector
    vector_j: jn.joints.Vector

    held_parallel = (("vector_i", "vector_j"),)

    def residual(self, body_i, body_j, time):
        del time
        return body_i.direction(self.vector_i).dot(body_j.direction(self.vector_j))


class Doubled(planar.DoubleRevolute):
    squared_distance = "length"

    def residual(self, body_i, body_j, time):
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return d.dot(d) - 2.0 * self.length**2 + 0.0 * time


class Beside(planar.Revolute):
    pair = "revolute"

    def residual(self, body_i, body_j, time):
        del time
        return body_j.point(self.point_j) - body_i.point(self.point_i) - body_i.direction(jnp.array([0.1, 0.0]))


class Slack(planar.DoubleRevolute):
    point_distance = "length"

    def residual(self, body_i, body_j, time):
        del time
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        return d.dot(d) - 4.0 * self.length**2


class Turned(planar.DoubleRevolute):
    dimensions = {"length": "angle"}


class Changing(planar.Revolute):
    def __hash__(self):
        return id(self)


class Constant(jn.joints.AbstractConstraint, space="planar"):
    def residual(self, body_i, body_j, time):
        del body_i, body_j
        return time - 1.0


@pytest.mark.parametrize(
    "kind, contract, words",
    [
        (Frozen, "derivatives", "derivative 1 along a motion is not that of the residual as a function of time"),
        (Mapped, "jacobian", "coefficient 1 of the residual is not its Jacobian by the coordinates"),
        (Constant, "jacobian", "does not depend on the poses of its bodies"),
        (Global, "frames", "changes where all bodies are moved together"),
        (Twice, "rank", "its 3 rows are 2 independent equations, not 3"),
        (Nowhere, "rank", "none was found in which the joint holds"),
        (Across, "facts", r"held_parallel \('vector_i', 'vector_j'\): .* at an angle of 90 deg"),
        (Doubled, "facts", "squared_distance 'length': the residual is not the square"),
        (Beside, "facts", "pair revolute: it does not hold"),
        (Slack, "facts", "point_distance 'length': where the joint holds, its points are .* m apart"),
        (Turned, "facts", "dimensions: a joint that holds no longer does where all lengths are multiplied by 3"),
        (Changing, "copies", "a joint from copy.copy is not equal to the original"),
    ],
)
def test_a_contract_that_is_broken_is_named(kind, contract, words):
    with pytest.raises(ContractError, match=f"{kind.__qualname__}: {contract}: .*{words}"):
        check_joint(kind, space="planar", contracts=[contract], order=2)


class Empty(jn.joints.AbstractConstraint, space="planar"):
    """A class without a residual."""


class Spaceless(jn.joints.AbstractConstraint):
    def residual(self, body_i, body_j, time): ...


@pytest.mark.parametrize(
    "kind, words", [(Empty, "kind: defines no method residual"), (Spaceless, "space: the class says")]
)
def test_a_class_that_is_not_complete_is_refused(kind, words):
    with pytest.raises(jn.errors.MechanismError, match=words):
        check_joint(kind)


class Fork(jn.joints.AbstractConstraint, space="planar"):
    """A fork of body i about a pin of body j, from a line of body i by a height."""

    point_i: jn.joints.Vector
    point_j: jn.joints.Vector
    vector_i: jn.joints.Vector
    height: jn.joints.Scalar
    side: str

    dimensions = {"height": "length"}
    choices = {"side": ("left", "right")}

    def residual(self, body_i, body_j, time):
        del time
        d = body_j.point(self.point_j) - body_i.point(self.point_i)
        along = body_i.direction(self.vector_i)
        sign = 1.0 if self.side == "left" else -1.0
        return cross(along, d) / jn.jet.sqrt(along.dot(along)) - sign * self.height


def test_a_joint_of_ones_own_is_held_to_all_of_them():
    names = ("jacobian", "rank", "facts", "equilibrium")
    report = check_joint(Fork, space="planar", order=2, values={"side": "right"}, contracts=names)
    assert report == JointReport(Fork, names, {})
    found = check_joint(Global, space="planar", contracts=["frames", "expressions", "files"], relative=False)
    assert not found.held
    assert [*found.left_out] == ["frames", "expressions", "files"]
    assert "files: it has no type name for files" in str(found)


@pytest.mark.parametrize(
    "arguments, words",
    [
        ((int, {}), "kind: must be a class derived from jn.joints.AbstractConstraint"),
        ((Fork, {"space": "flat"}), "space"),
        ((Fork, {"order": 0, "space": "planar"}), "order: must be a whole number, 1 or greater"),
        ((Fork, {"contracts": ["jacobin"], "space": "planar"}), "contracts: no contract has this name.*jacobian"),
        ((Fork, {"values": {"hight": 1.0}, "space": "planar"}), "values: no field has this name.*height"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(arguments, words):
    kind, options = arguments
    with pytest.raises(jn.errors.MechanismError, match=words):
        check_joint(kind, **options)
