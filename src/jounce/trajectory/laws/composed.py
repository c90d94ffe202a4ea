"""Motion laws composed of others: a law of the coordinate of another law, and the law of an output."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jounce.base.modules import field
from jounce.errors import JounceError, TrajectoryError
from jounce.jet import Jet
from jounce.trajectory.motion import AbstractMotion, ExpressionMotion, Untraced
from jounce.units.expression import Expression

LOOKS = 2001  # samples of a leader, for its range

Law = AbstractMotion | Expression | str
"""A law, or an expression of ``t`` and of parameters."""


class CompositeLaw(AbstractMotion):
    """A law whose parts may be expressions of parameters, whose values come from a mechanism."""

    parts: tuple[AbstractMotion, ...]
    recipe: Untraced = field(static=True)

    def _take(self, members: Sequence[Law], *arguments: Any) -> None:
        """Set the fields: the parts if their values are known, and the recipe."""
        laws = [Expression(member) if isinstance(member, str) else member for member in members]
        for k, member in enumerate(laws):
            if not isinstance(member, AbstractMotion | Expression):
                raise TrajectoryError("must be a motion law, or an expression of t", name=f"[{k}]", value=member)
        constant = all(_is_known(member) for member in laws)
        self.parts = tuple(with_values(member, {}) for member in laws) if constant else ()
        self.recipe = Untraced((tuple(laws), *arguments))

    @property
    def is_open(self) -> bool:
        """Whether anything other than the parts lacks the values of parameters."""
        return False

    def _resolved_parts(self, parameters: Mapping[str, Any]) -> list[AbstractMotion]:
        return [with_values(part, parameters) for part in self.recipe.value[0]]

    def _known_parts(self) -> tuple[AbstractMotion, ...]:
        if not self.parts:
            raise TrajectoryError("depends on parameters, whose values a mechanism knows; give numbers")
        return self.parts


def _is_known(part: AbstractMotion | Expression) -> bool:
    """Return whether a part has numbers in the place of all parameters."""
    if isinstance(part, CompositeLaw):
        return bool(part.parts) and not part.is_open
    return not getattr(part, "_open", ()) if isinstance(part, AbstractMotion) else part.names <= {"t"}


def with_values(part: AbstractMotion | Expression, parameters: Mapping[str, Any]) -> AbstractMotion:
    """Return a part as a law with numbers in the place of parameters."""
    if isinstance(part, AbstractMotion):
        return part.resolved(parameters)
    part.check({*parameters, "t"})
    return ExpressionMotion(part, {name: parameters[name] for name in sorted(part.names - {"t"})})


class FollowingMotion(CompositeLaw):
    """A motion law of the coordinate of another law: a cam on a driven shaft, or an electronic cam.

    Parameters
    ----------
    law : AbstractMotion, Expression or str
        Law of the coordinate of the leader instead of time: m or rad over rad or m. In an expression, ``t`` is that
        coordinate.
    leader : AbstractMotion, Expression or str
        Law of the leader; an expression of ``t`` and of the parameters of a mechanism.

    Raises
    ------
    TrajectoryError
        If one of them is no law, or the leader follows from an output.

    Examples
    --------
    >>> import math
    >>> import jounce as jn
    >>> rise, fall = (jn.laws.Segment("cycloidal", duration=math.pi, to=x) for x in (0.02, 0.0))
    >>> lift = jn.laws.SegmentedMotion([rise, fall], beyond="repeat")
    >>> follower = jn.laws.FollowingMotion(lift, leader="2*pi*t")  # the shaft turns once a second
    >>> [round(float(x), 12) for x in follower(jn.Jet.variable(7.25, order=1)).derivatives()]
    [0.01, 0.08]
    """

    def __init__(self, law: Law, leader: Law):
        if not isinstance(law, Law):
            raise TrajectoryError("must be a motion law, or an expression of t", name="law", value=law)
        if isinstance(leader, OutputMotion):
            raise TrajectoryError(
                f"the leader has the law of the output {leader.output}, and none of its own; solve the "
                "mechanism without the follower, and take the law that is found, motion.driver_law"
            )
        self._take([law, leader])

    def resolved(self, parameters: Mapping[str, Any]) -> "FollowingMotion":
        """Return the law with numbers in the place of parameters."""
        law, leader = self._resolved_parts(parameters)
        return FollowingMotion(law, leader)

    def check_instants(self, first: float, last: float) -> None:
        """Raise MechanismError if the leader is not defined at some instants, or the law at its coordinate."""
        if not self.parts:
            return None
        law, leader = self.parts
        try:
            law.check_instants(-np.inf, np.inf)
        except JounceError:
            if not np.isfinite([first, last]).all():
                raise  # the caller asks whether there are ends, as for a law that follows this one
        else:  # without ends
            return leader.check_instants(first, last)
        leader.check_instants(first, last)
        values = np.asarray(leader(Jet([np.linspace(first, last, LOOKS)])).coefficients[0], float)
        values = values[np.isfinite(values)]
        if not values.size:
            return None
        low, high = float(values.min()), float(values.max())
        try:
            law.check_instants(low, high)
        except JounceError as error:
            phrase = f"its leader goes from {low:.9g} to {high:.9g}: of that coordinate in the place of the time, "
            message = error.message.replace(" s, and the law", ", and the law")  # rad or m
            raise type(error)(phrase + message, value=error.value) from None

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet."""
        law, leader = self._known_parts()
        return law(leader(time))


class OutputMotion(CompositeLaw):
    """The motion of a driver for which an output of the mechanism follows a law, found by inversion.

    While the mechanism is solved, the output is held to its law instead of the driver. The coordinate of the driver is
    a result with all its derivatives: `Motion.driver`, and the outputs `DriverAngleOutput` and
    `DriverDisplacementOutput`. Forces are those of the driver.

    Parameters
    ----------
    output : str
        Name of an output that is an angle, a distance, a slide, or, with its component, a point: ``"C_y"``.
    law : AbstractMotion, Expression or str
        Law of the output, m or rad; an expression of ``t`` and of the parameters of the mechanism.

    Raises
    ------
    TrajectoryError
        If the law is invalid.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Body([0, 0], angle=0.2)
    >>> pin = jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])
    >>> law = jn.laws.OutputMotion("tip_y", "0.1 + 0.1*t")
    >>> motor = jn.drivers.CoordinateDriver(("ground", "rod"), "angle", motion=law)
    >>> lift = jn.Mechanism(
    ...     space="planar", bodies={"rod": rod}, joints={"pin": pin}, drivers={"motor": motor},
    ...     outputs={"tip": jn.outputs.PointOutput("rod", [0.2, 0])},
    ... )
    >>> jn.solve(lift, [0.0, 0.5], order=1).driver("motor").values.round(6).tolist()  # arcsin(y / 0.2)
    [[0.523599, 0.57735], [0.848062, 0.755929]]
    """

    output: str = field(static=True)

    def __init__(self, output: str, law: Law):
        if not isinstance(output, str) or not output:
            raise TrajectoryError("must be the name of an output", name="output", value=output)
        self.output = output
        self._take([law])

    @property
    def law(self) -> Law:
        """The law of the output, as given."""
        return self.recipe.value[0][0]

    def resolved(self, parameters: Mapping[str, Any]) -> "OutputMotion":
        """Return the law with numbers in the place of parameters."""
        return OutputMotion(self.output, *self._resolved_parts(parameters))

    def check_instants(self, first: float, last: float) -> None:
        """Raise MechanismError if the law of the output is not defined at some instants."""
        for law in self.parts:
            law.check_instants(first, last)

    def __call__(self, time: Jet) -> Jet:  # noqa: ARG002 - known only by solving
        """Raise TrajectoryError: the value is known only from a motion.

        Raises
        ------
        TrajectoryError
            Always.
        """
        message = (
            f"is known only once the mechanism is solved, as it follows from the output '{self.output}'; call "
            "jn.solve, and use motion.actuated, whose drivers have the resulting laws"
        )
        raise TrajectoryError(message)
