"""The result of a solve: outputs and points of bodies, with their derivatives, at every instant."""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from jounce.base.modules import with_fields
from jounce.base.shapes import ArrayLike, Numbers
from jounce.errors import MechanismError, check_name
from jounce.execution.backends import xla_backend
from jounce.execution.on_demand import OnDemand, read_only_arrays
from jounce.jet.derivatives import plain_derivatives
from jounce.jet.turns import shifted_by_turns
from jounce.kinematics.continuation.anchors import ChangePoint
from jounce.kinematics.results.pose_outputs import check_output, output_group, series_along
from jounce.kinematics.results.tables import Tabulated
from jounce.kinematics.status import Status
from jounce.mechanism import (
    AbstractMotionOutput,
    AbstractOutput,
    AbstractQuantity,
    AngleOutput,
    AngularVelocityOutput,
    DriverAngleOutput,
    DriverDisplacementOutput,
    Mechanism,
    Model,
    PointOutput,
)
from jounce.mechanism.laws.driver_outputs import is_turning
from jounce.mechanism.outputs.attitude_outputs import continued, euler_angles_of
from jounce.mechanism.outputs.derivative_outputs import bound_output
from jounce.mechanism.system import Group
from jounce.mechanism.transmissions.axis_angles import AttitudeHistory, attitudes_of, measures_angle
from jounce.trajectory import HermiteMotion
from jounce.units.shown_units import component_axes, derivatives_of, time_axes

if TYPE_CHECKING:
    import xarray

_UNDEFINED = Status.UNDEFINED.advice.partition(": ")[2]


class Motion(Tabulated):
    """The motion of a mechanism at the instants of a time grid.

    Attributes
    ----------
    mechanism : Mechanism
        The mechanism solved.
    model : Model
        The numeric model, with the drivers of the mechanism.
    solved_model : Model
        The model that was solved: the same, unless drivers follow from outputs; then it holds the outputs instead.
        Instants, s.
    order : int
        Highest derivative of the outputs.
    status : numpy.ndarray of int, shape (time,)
        Outcome at each instant, see `Status`; where it is not 0, all results are NaN.
    faults : dict of int to str
        Body farthest from its prediction, or driver at fault, for each instant that failed, by index.
    change_points : numpy.ndarray of shape (points,)
        Instants at which the motion passed a singular position smoothly, where assembly branches cross, s. Another
        motion could have branched off there. Forces are not determined there and are NaN, as are their rates where
        rounding decides them.
    passages : tuple of ChangePoint
        The change points, each with the radius of the Taylor series of the motion there.
    derived : dict
        Values computed from the motion and kept for reuse, by name, such as the forces.
    backend : str
        Backend that computed the numbers: "llvm" (machine code), "xla" (with the device, if not the CPU), or both.

    A motion is made from the Taylor coefficients of the coordinates of all bodies, or a function that computes them,
    and the derivatives of the outputs, (order + 1, components, instances, time) for each group.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.solve(jn.load("examples/four_bar.yaml"), [0.0, 0.1], order=1).outputs["C"].shape
    (2, 2, 2)
    """

    traced = False  # by JAX
    singular_distance: Any = np.ones(1)  # at each instant, in radii of the series; 1 if it is large, or in `passages`
    check_idle: Callable[[dict[str, AbstractQuantity]], None] | None = None  # raises if outputs depend on idle motions

    def __init__(
        self,
        mechanism: Mechanism,
        model: Model,
        time: np.ndarray,
        order: int,
        state: tuple[dict[str, Any] | Callable[[], dict[str, Any]], tuple[Any, ...]],
        status: Numbers,
        faults: dict[int, str],
        passages: Sequence[ChangePoint] = (),
        history: AttitudeHistory | Callable[[], AttitudeHistory | None] | None = None,
        backend: str = "",
    ):
        self.backend = backend or xla_backend()
        self.mechanism, self.time, self.order = mechanism, time, order
        self.status, self.faults, self.passages = status, faults, tuple(passages)
        self.change_points = np.array([point.instant for point in self.passages])
        self.derived: dict[str, Any] = {}
        self.model, self.solved_model, self._history = model, model, history
        self._bodies, self._groups = state[0], dict(zip(model.outputs, state[1], strict=True))
        self._known_outputs: dict[str, Any] = {}
        self._actuated: Mechanism | None = None  # with the laws found, if drivers follow from outputs

    @cached_property
    def _coordinates(self) -> dict[str, Any]:
        """Taylor coefficients of the coordinates of all bodies, computed again if they were not kept."""
        return self._bodies() if callable(self._bodies) else self._bodies

    @cached_property
    def history(self) -> AttitudeHistory | None:
        """Attitudes of spatial bodies along the motion, from which turns are counted; None where none are kept."""
        return self._history() if callable(self._history) else self._history

    @property
    def poses(self) -> tuple[type, dict[str, Any]]:
        """Type of the poses, and Taylor coefficients of the coordinates of all bodies by name, the ground first."""
        return self.model.pose_type, self._coordinates

    @cached_property
    def forces(self) -> tuple[Group, ...]:
        """Applied forces in the groups of the model, with turns of angles about axes at every instant."""
        return self._counting(self.model.system.forces)

    @property
    def counted_outputs(self) -> tuple[Group, ...]:
        """Outputs of poses in the groups of the model, with turns of angles about axes at every instant."""
        return self._counting(self.model.system.outputs)

    @property
    def continued_outputs(self) -> tuple[Float[np.ndarray, "component instance time"], ...]:
        """Values of wrapped angles among the outputs of poses, made continuous, for each group of them."""
        pairs = zip(self._groups.values(), self.model.system.outputs, strict=True)
        continued: Any = tuple(self._continued(g, c)[0] for c, g in pairs if getattr(g.element, "wraps", ()))
        return continued

    def moved_by(self, model: Model, actuated: Mechanism) -> "Motion":
        """Return the same motion with a model of the drivers that move the bodies, and the laws of these drivers."""
        state = self._bodies, tuple(self._groups.values())
        outcome = self.status, self.faults, self.passages, self._history, self.backend
        motion = Motion(self.mechanism, model, self.time, self.order, state, *outcome)
        motion._actuated, motion.solved_model = actuated, self.model
        return motion

    @property
    def actuated(self) -> Mechanism:
        """The mechanism with laws of all drivers; for drivers that follow from outputs, those found by this motion.

        These laws interpolate all derivatives at the instants of the motion, and end at its first and last instants.
        """
        return self.mechanism if self._actuated is None else self._actuated

    def driver(self, name: str) -> "xarray.DataArray":
        """Return the coordinate of a driver and its derivatives, from the poses of its bodies.

        Parameters
        ----------
        name : str
            Name of the driver.

        Returns
        -------
        xarray.DataArray
            Dimensions time and derivative; rad or m.

        Raises
        ------
        MechanismError
            If there is no such driver, or its class does not define its coordinate.

        Examples
        --------
        >>> import jounce as jn
        >>> motion = jn.solve(jn.load("examples/four_bar.yaml"), [0.0, 0.5], order=2)
        >>> motion.driver("theta").values.round(6).tolist()[1]
        [1.570796, 0.0, -10.335426]
        """
        check_name("driver", name, self.mechanism.drivers, MechanismError, name="driver")
        is_angle = is_turning(self.mechanism.drivers[name])
        return self.evaluate((DriverAngleOutput if is_angle else DriverDisplacementOutput)(name), name)

    def driver_law(self, name: str) -> HermiteMotion:
        """Return the law of a driver through the solved instants, with the derivatives of the motion.

        Raises
        ------
        MechanismError
            As `driver`.
        """
        values, solved = self.driver(name).values, self.status == Status.OK
        return HermiteMotion(self.time[solved], values[solved])

    def driver_coefficients(self, name: str) -> Float[Numbers, "order 1 time"]:
        """Return the Taylor coefficients of the coordinate of a driver, from the poses of its bodies."""
        without_law: Any = dataclasses.replace(self.mechanism.drivers[name], motion=0.0)
        return self._coefficients(output_group(without_law, self.mechanism, self.model, f"drivers.{name}"))[:, :, 0]

    def __repr__(self) -> str:
        solved = int(np.sum(self.status == Status.OK))
        title = f"{self.mechanism.title}: " if self.mechanism.title else ""
        return f"<Motion {title}{solved} of {len(self.time)} instants solved, order {self.order}>"

    @property
    def outputs(self) -> Mapping[str, Any]:
        """Outputs by name: arrays of shape (time, order + 1) or (time, order + 1, component), SI.

        The nine components of a rotation matrix are in row-major order. An output is computed on first request. Its
        array is read-only, since the motion uses it; `numpy.array` copies it.
        """
        # not cached, as it refers to the motion: the last reference frees the arrays, without garbage collection
        outputs = OnDemand(self.mechanism.outputs, self._outputs_with, self._known_outputs)
        return dict(outputs) if self.traced else outputs  # JAX needs a plain tree

    def _outputs_with(self, name: str) -> dict[str, Any]:
        """Return an output, and the others of its group, by name."""
        output = self.mechanism.outputs[name]
        if isinstance(output, AbstractMotionOutput):
            return read_only_arrays({name: self._derivatives(output.coefficients(self))})
        groups = zip(self._groups.items(), self.model.system.outputs, strict=True)
        ((names, values), group) = next(entry for entry in groups if name in entry[0][0])
        return read_only_arrays(dict(zip(names, self._each_shown(self._continued(group, values)), strict=True)))

    def _each_shown(self, values: Float[Numbers, "order component instance time"]) -> Sequence[Any]:
        """Return each output of a group in the form of `outputs`."""
        return [self._shown(values[:, :, k]) for k in range(values.shape[2])]

    @cached_property
    def dataset(self) -> "xarray.Dataset":
        """Outputs as an `xarray.Dataset` with dimensions time, derivative and component; units in the attributes.

        Euler parameters have the dimension euler_parameter instead of component, Euler angles euler_angle, and rotation
        matrices row_axis and column_axis. The unit of a variable is that of derivative 0; each derivative adds ``/s``.
        """
        import xarray

        variables = {
            name: self._labeled(name, values, self.mechanism.outputs[name]) for name, values in self.outputs.items()
        }
        title = self.mechanism.title or "motion of a mechanism"
        attributes: dict[str, Any] = {"title": title, "source": "jounce", "backend": self.backend}
        if self.change_points.size:
            attributes["change_points"] = self.change_points
        return xarray.Dataset(variables, coords=time_axes(self.time, self.order + 1), attrs=attributes)

    def point(self, body: str, point: ArrayLike) -> "xarray.DataArray":
        """Return the position of any point of a body in the global frame and its derivatives.

        Parameters
        ----------
        body : str
            Name of the body.
        point : sequence
            Point in the frame of the body, (2,) or (3,), m.

        Returns
        -------
        xarray.DataArray
            Dimensions time, derivative, component; m and its time derivatives.
        """
        return self.evaluate(PointOutput(body, point), name="position")

    def angle(self, body: str) -> "xarray.DataArray":
        """Return the angle of a planar body and its derivatives, rad, with dimensions time and derivative."""
        return self.evaluate(AngleOutput(body), name="angle")

    def angular_velocity(self, body: str, frame: str = "global") -> "xarray.DataArray":
        """Return the angular velocity of a body and its derivatives, rad/s, in the frame ``global`` or ``body``.

        The result has one order less than the motion.
        """
        return self.evaluate(AngularVelocityOutput(body, frame), name="angular_velocity")

    def evaluate(self, output: AbstractOutput | AbstractMotionOutput, name: str = "output") -> "xarray.DataArray":
        """Return any output as an `xarray.DataArray`, without solving again.

        Raises
        ------
        MechanismError
            If the output names a body, joint, driver or force that does not exist, or does not fit the mechanism.
        """
        given: Any = bound_output(output, self.mechanism)
        check_output(given, self.mechanism, name)
        self._check_order(given, name)
        if self.check_idle is not None:
            self.check_idle({name: given})
        if isinstance(given, AbstractMotionOutput):
            return self._labeled(name, self._derivatives(given.coefficients(self)), given)
        group = output_group(given, self.mechanism, self.model, name)
        values = self._derivatives(self._continued(group, self._coefficients(group))[:, :, 0])
        self._check_finite(values, name)
        return self._labeled(name, values, given)

    def series(self, output: AbstractQuantity) -> Float[Numbers, "order component time"]:
        """Return the Taylor coefficients of any output, (order + 1, components, time), angles modulo whole turns."""
        if isinstance(output, AbstractMotionOutput):
            return output.coefficients(self)
        posed: Any = output
        return self._coefficients(output_group(posed, self.mechanism, self.model))[:, :, 0]

    def _check_order(self, output: AbstractQuantity, name: str) -> None:
        """Raise MechanismError for an output that needs more derivatives than the motion has."""
        levels = len(self.poses[1]["position"])
        if output.lost_orders >= levels:
            message = f"needs the motion to order {output.lost_orders}, and it was solved to order {levels - 1}"
            raise MechanismError(f"{message}: solve it to a higher order", name=name)

    def _check_finite(self, values: Float[np.ndarray, "time derivative *component"], name: str) -> None:
        """Raise MechanismError for the first solved instant at which an output is not finite."""
        finite = np.isfinite(values).all(axis=tuple(range(2, values.ndim)))
        undefined = ~finite & (self.status == Status.OK)[:, None]
        if undefined.any():
            lane, level = (int(k) for k in np.argwhere(undefined)[0])
            subject = f"its derivative {level}" if level else "it"
            message = f"{subject} has no finite value at t = {self.time[lane]:g} s"
            raise MechanismError(f"{message}; {_UNDEFINED}", name=name)

    def _continued(
        self, group: Group, coefficients: Float[Numbers, "order component instance time"]
    ) -> Float[Numbers, "order component instance time"]:
        """Return Taylor coefficients or derivatives of outputs, with the turns of angles counted along the motion."""
        element = group.element
        if not (measures_angle(group) or getattr(element, "wraps", ())) or (history := self._attitudes) is None:
            return coefficients
        coefficients = np.array(coefficients)
        if measures_angle(group):
            (counted,) = history.counting((group,), self.time)
            coefficients[0, 0] = shifted_by_turns(coefficients[0, 0], counted.element.datum.near)
            return coefficients
        for k, bodies in enumerate(zip(*group.bodies, strict=True)):
            angles = np.where(self.status == Status.OK, coefficients[0, :, k], np.nan)
            samples = history.sampled(lambda q, b=bodies: euler_angles_of(element.sequence, attitudes_of(b, q)))
            coefficients[0, :, k] = continued(element, angles, self.time, samples)
        return coefficients

    @property
    def _attitudes(self) -> AttitudeHistory | None:
        """Attitudes of all bodies along the motion, where they are known."""
        return self.history

    def _coefficients(self, group: Group) -> Float[Numbers, "order component instance time"]:
        """Return the Taylor coefficients of outputs, (order + 1, components, instances, time).

        The compiled program receives only the ground and the bodies of the group, so that it serves any other bodies.
        """
        moving, index = [body for slot in group.bodies for body in slot if body], itertools.count(1)
        indices = tuple(tuple(next(index) if body else 0 for body in slot) for slot in group.bodies)
        coordinates = {name: part[..., [0, *moving], :] for name, part in self._coordinates.items()}
        groups = tuple(with_fields(counted, bodies=indices) for counted in self._counting((group,)))

        (series,) = series_along(groups, coordinates, self.model.pose_type)
        return series

    def _counting(self, groups: tuple[Group, ...]) -> tuple[Group, ...]:
        return groups if self.history is None else self.history.counting(groups, self.time)

    def _derivatives(
        self, coefficients: Float[Numbers, "order component time"]
    ) -> Float[np.ndarray, "time derivative *component"]:
        """Return the derivatives that Taylor coefficients stand for, in the shape of an output."""
        return self._shown(plain_derivatives(np.asarray(coefficients[: self.order + 1])))

    def _shown(self, values: Float[Numbers, "order component time"]) -> Float[np.ndarray, "time derivative *component"]:
        """Reshape derivatives (order, component, time) to (time, derivative[, component]), NaN at failed instants."""
        values = np.moveaxis(np.asarray(values[: self.order + 1]), -1, 0)
        if (failed := self.status != Status.OK).any():
            values = np.where(failed[:, None, None], np.nan, values)
        return values[..., 0] if values.shape[-1] == 1 else values

    def _labeled(
        self, name: str, values: Float[Numbers, "time derivative *component"], output: AbstractQuantity
    ) -> "xarray.DataArray":
        import xarray

        coordinates = time_axes(self.time, values.shape[1])
        if values.ndim == 3:
            axes = component_axes(output, values.shape[2])
            values = values.reshape(*values.shape[:2], *map(len, axes.values()))
            coordinates |= axes
        dims = tuple(coordinates)
        attributes = {"units": output.unit, "long_name": derivatives_of(name)}
        if isinstance(output, AbstractMotionOutput) and not self.traced and (remark := output.remark(self, values)):
            attributes["comment"] = remark
        return xarray.DataArray(values, dims=dims, coords=coordinates, name=name, attrs=attributes)
