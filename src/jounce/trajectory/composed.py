"""Motion laws made of others: one law after another, a law of what another prescribes, and the law of an output."""

from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from jounce.errors import MechanismError, TrajectoryError
from jounce.jet import Jet
from jounce.trajectory.checks import finite
from jounce.trajectory.knots import SMOOTH, derivative_sizes
from jounce.trajectory.motion import AbstractMotion, ExpressionMotion, Untraced
from jounce.units.expression import Expression

Law = AbstractMotion | Expression | str
"""A law, or an expression of ``t`` and of parameters."""


class _MadeOfOthers(AbstractMotion):
    """A law whose parts may be expressions of parameters, which have their values from a mechanism."""

    parts: tuple[AbstractMotion, ...]
    recipe: Untraced = eqx.field(static=True)

    def _take(self, parts: Sequence[Law], *rest: Any) -> None:
        """Fill in the fields: the parts where they are known, and how they were given."""
        read = [Expression(part) if isinstance(part, str) else part for part in parts]
        for k, part in enumerate(read):
            if not isinstance(part, AbstractMotion | Expression):
                raise TrajectoryError("must be a motion law, or an expression of t", name=f"[{k}]", value=part)
        known = all(_is_known(part) for part in read)
        self.parts = tuple(_with(part, {}) for part in read) if known else ()
        self.recipe = Untraced((tuple(read), *rest))

    def _resolved_parts(self, parameters: Mapping[str, Any]) -> list[AbstractMotion]:
        return [_with(part, parameters) for part in self.recipe.value[0]]

    def _known_parts(self) -> tuple[AbstractMotion, ...]:
        if not self.parts:
            raise TrajectoryError("depends on parameters, whose values a mechanism knows; give numbers")
        return self.parts


def _is_known(part: AbstractMotion | Expression) -> bool:
    """Tell whether a part has numbers already, and waits for no parameters."""
    if isinstance(part, _MadeOfOthers):
        return bool(part.parts)
    return not getattr(part, "_open", ()) if isinstance(part, AbstractMotion) else part.names <= {"t"}


def _with(part: AbstractMotion | Expression, parameters: Mapping[str, Any]) -> AbstractMotion:
    """Return a part as a law, with numbers in the place of parameters."""
    if isinstance(part, AbstractMotion):
        return part.resolved(parameters)
    part.check({*parameters, "t"})
    return ExpressionMotion(part, {name: parameters[name] for name in sorted(part.names - {"t"})})


class FollowingMotion(_MadeOfOthers):
    """A motion law of what another law prescribes: a cam on a driven shaft, or an electronic cam.

    Parameters
    ----------
    law : AbstractMotion
        Of the coordinate of the leader in the place of the time: m or rad over rad or m.
    leader : AbstractMotion, Expression or str
        The law of that coordinate; an expression of ``t`` and of the parameters of a mechanism.

    Raises
    ------
    TrajectoryError
        If one of them is no law, or the leader has the law of an output.

    Examples
    --------
    >>> import math
    >>> import jounce as jn
    >>> rise, fall = (jn.Segment("cycloidal", duration=math.pi, to=x) for x in (0.02, 0.0))
    >>> lift = jn.SegmentedMotion([rise, fall], beyond="repeat")
    >>> follower = jn.FollowingMotion(lift, leader="2*pi*t")  # the shaft turns once a second
    >>> [round(float(x), 12) for x in follower(jn.Jet.variable(7.25, order=1)).derivatives()]
    [0.01, 0.08]
    """

    def __init__(self, law: AbstractMotion, leader: Law):
        if not isinstance(law, AbstractMotion):
            raise TrajectoryError("must be a motion law", name="law", value=law)
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
        """Raise MechanismError if the leader says nothing of some instants."""
        for part in self.parts[1:]:
            part.check_instants(first, last)

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet."""
        law, leader = self._known_parts()
        return law(leader(time))


class OutputMotion(_MadeOfOthers):
    """The motion of a driver with which an output of the mechanism has a law: found by inversion, not by a formula.

    While such a mechanism is solved, the output is held to the law in the place of the driver, whose coordinate then
    is a result with all its derivatives: `Motion.driver`, and the outputs `DriverAngleOutput` and
    `DriverDisplacementOutput`. Forces are those of the driver.

    Parameters
    ----------
    output : str
        Name of an output that is an angle, a distance, a slide, or, with its component, a point: ``"C_y"``.
    law : AbstractMotion, Expression or str
        That of the output, m or rad; an expression of ``t`` and of the parameters of the mechanism.

    Raises
    ------
    TrajectoryError
        If the law is none.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Body([0, 0], angle=0.2)
    >>> pin = jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])
    >>> motor = jn.drivers.CoordinateDriver(("ground", "rod"), "angle", motion=jn.OutputMotion("tip_y", "0.1 + 0.1*t"))
    >>> lift = jn.Mechanism(
    ...     space="planar", bodies={"rod": rod}, joints={"pin": pin}, drivers={"motor": motor},
    ...     outputs={"tip": jn.PointOutput("rod", [0.2, 0])},
    ... )
    >>> jn.solve(lift, [0.0, 0.5], order=1).driver("motor").values.round(6).tolist()  # arcsin(y / 0.2)
    [[0.523599, 0.57735], [0.848062, 0.755929]]
    """

    output: str = eqx.field(static=True)

    def __init__(self, output: str, law: Law):
        if not isinstance(output, str) or not output:
            raise TrajectoryError("must be the name of an output", name="output", value=output)
        self.output = output
        self._take([law])

    @property
    def law(self) -> Law:
        """The law of the output, as it was given."""
        return self.recipe.value[0][0]

    def resolved(self, parameters: Mapping[str, Any]) -> "OutputMotion":
        """Return the law with numbers in the place of parameters."""
        return OutputMotion(self.output, *self._resolved_parts(parameters))

    def check_instants(self, first: float, last: float) -> None:
        """Raise MechanismError if the law of the output says nothing of some instants."""
        for part in self.parts:
            part.check_instants(first, last)

    def __call__(self, time: Jet) -> Jet:  # noqa: ARG002 - known by solving only
        """There is no value without a motion.

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


class PiecewiseMotion(_MadeOfOthers):
    """A motion law that is one law until an instant, another until the next, and so on.

    Where two of them meet, derivatives are those from the right; `jumps` tells which are not continuous.

    Parameters
    ----------
    laws : sequence of AbstractMotion, Expression or str
        In their order; expressions are of ``t``, the time since zero, and of the parameters of a mechanism.
    until : sequence of float
        Increasing instants at which all but the last end, s.

    Raises
    ------
    TrajectoryError
        If the instants are not increasing, or not one fewer than the laws.

    Examples
    --------
    >>> import jounce as jn
    >>> law = jn.PiecewiseMotion(["t**2", "2*t - 1"], until=[1.0])
    >>> [float(x) for x in law(jn.Jet.variable(3.0, order=2)).derivatives()]
    [5.0, 2.0, 0.0]
    >>> instants, jumps = law.jumps(2)
    >>> instants.tolist(), jumps[:, 0].tolist()  # acceleration goes from 2 to 0 at 1 s
    ([1.0], [0.0, 0.0, -2.0])
    """

    until: Any

    def __init__(self, laws: Sequence[Law], until: Sequence[float]):
        if isinstance(laws, str) or not isinstance(laws, Sequence) or not laws:
            raise TrajectoryError("must be a list of laws", name="laws", value=laws)
        ends = [x if isinstance(x, Tracer) else finite(f"until[{k}]", x) for k, x in enumerate(until)]
        if len(ends) != len(laws) - 1:
            message = f"{len(laws)} laws need {len(laws) - 1} instants, at which all but the last end"
            raise TrajectoryError(message, name="until", value=len(ends))
        if not any(isinstance(x, Tracer) for x in ends) and (np.diff(ends) <= 0).any():
            raise TrajectoryError("must increase", name="until", value=ends)
        self.until = tuple(ends)
        self._take(laws)

    def resolved(self, parameters: Mapping[str, Any]) -> "PiecewiseMotion":
        """Return the law with numbers in the place of parameters."""
        return PiecewiseMotion(self._resolved_parts(parameters), self.until)

    def check_instants(self, first: float, last: float) -> None:
        """Raise MechanismError if one of the laws says nothing of instants that are its own."""
        begins, ends = (-np.inf, *self.until), (*self.until, np.inf)
        for part, begin, end in zip(self.parts, begins, ends, strict=bool(self.parts)):
            if first < end and last >= begin:
                part.check_instants(max(first, begin), min(last, end))

    def __call__(self, time: Jet) -> Jet:
        """Return the jet of the law at the instants of the time jet."""
        parts, instants = self._known_parts(), time.coefficients[0]
        begins, ends = (-jnp.inf, *self.until), (*self.until, jnp.inf)
        value: tuple[Any, ...] = ()
        for part, begin, end in zip(parts, begins, ends, strict=True):
            own = (instants >= begin) & (instants < end)
            # elsewhere a law may have no value: it is asked for an instant of its own
            some = jnp.clip(instants, begin, jnp.where(jnp.isinf(begin), end, begin))
            found = part(Jet((jnp.where(own, instants, some), *time.coefficients[1:]))).dense().coefficients
            value = tuple(jnp.where(own, f, v) for f, v in zip(found, value or found, strict=True))
        return Jet(value)

    def jumps(self, order: int = 4) -> tuple[Float[np.ndarray, " knots"], Float[np.ndarray, "{order}+1 knots"]]:
        """Return the instants between two laws, and by how much derivatives jump there.

        Parameters
        ----------
        order : int, default 4
            The highest derivative that is looked at.

        Returns
        -------
        instants : ndarray of shape (knots,)
            s.
        jumps : ndarray of shape (order + 1, knots)
            The value from the right less that from the left, m or rad by s to the power of the order; rounding is zero.

        Examples
        --------
        >>> import jounce as jn
        >>> jn.PiecewiseMotion(["t**3", "0"], until=[0.0]).jumps(3)[1][:, 0].tolist()
        [0.0, 0.0, 0.0, -6.0]
        """
        sizes = self._sizes(order) if self.until else []
        found = []
        for k, instant in enumerate(self.until):
            left, right = (
                np.asarray(part(Jet.variable(np.asarray(instant, float), order)).derivatives())
                for part in self._known_parts()[k : k + 2]
            )
            jump = right - left
            found.append(np.where(np.abs(jump) <= SMOOTH * np.maximum(*sizes[k : k + 2]), 0.0, jump))
        return np.array(self.until), np.stack(found, axis=-1) if found else np.zeros((order + 1, 0))

    def _sizes(self, order: int) -> list[Float[np.ndarray, " levels"]]:
        """Return how large the derivatives of each law are; the first and the last go as far as their neighbours."""
        lengths = np.diff(self.until) if len(self.until) > 1 else [abs(self.until[0]) or 1.0]
        borders = [self.until[0] - lengths[0], *self.until, self.until[-1] + lengths[-1]]
        found = []
        for part, begin, end in zip(self._known_parts(), borders, borders[1:], strict=False):
            try:
                found.append(derivative_sizes(part, begin, end, order))
            except MechanismError:  # samples that end before: what they are where laws meet is known
                instant = begin if begin == self.until[-1] else end
                found.append(derivative_sizes(part, instant, instant, order))
        return found
