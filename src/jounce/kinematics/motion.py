"""The result of a solve: outputs and any point of any body, with their derivatives, at every instant."""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.display import Displayed
from jounce.errors import MechanismError, did_you_mean
from jounce.jet import Jet
from jounce.kinematics.compilation import compiled
from jounce.kinematics.status import Status
from jounce.mechanism import (
    AbstractMotionOutput,
    AngleOutput,
    AngularVelocityOutput,
    Mechanism,
    Model,
    PointOutput,
)
from jounce.mechanism.builder import placed
from jounce.mechanism.datums import Way
from jounce.mechanism.mechanism import GROUND
from jounce.mechanism.system import POSITION_COMPONENTS, Group, group_elements

COMPONENTS = ("x", "y", "z")


@compiled("pose_type")
def _evaluated(group: Group, coordinates: dict[str, Any], pose_type: type) -> Any:
    pose = pose_type.from_coordinates({name: Jet(tuple(c)) for name, c in coordinates.items()})
    return jnp.stack(group.evaluate(pose).dense().coefficients)


def check_output(output: Any, mechanism: Mechanism, name: str = "output") -> None:
    """Raise MechanismError unless an output names what the mechanism has, and exists in its space."""
    names = (GROUND, *mechanism.bodies)
    for body in output.bodies:
        if body not in names:
            message = f"no body has this name; {did_you_mean(body, names)}"
            raise MechanismError(message, name="body", value=body)
    if output.space and output.space != mechanism.space:
        raise MechanismError(f"this output is {output.space}, the mechanism is {mechanism.space}", name=name)
    output.check(mechanism)


def output_group(output: Any, mechanism: Mechanism, model: Model | None = None, name: str = "output") -> Group:
    """Return an output of poses as a group of one, which acts on the pose of all bodies.

    With a model, angles about axes are counted as those of the outputs that it was put together with.
    """
    index = {body: k for k, body in enumerate((GROUND, *mechanism.bodies))}
    components = POSITION_COMPONENTS[mechanism.space]
    groups, _ = group_elements({name: output}, mechanism.parameter_values, index, components)
    (group,) = groups if model is None else placed(groups, model)
    return group


class Motion(Displayed):
    """The motion of a mechanism at the instants of a time grid.

    Attributes
    ----------
    mechanism : Mechanism
        What was solved.
    time : numpy.ndarray of shape (time,)
        Instants, s.
    order : int
        Highest derivative of the outputs.
    status : numpy.ndarray of int, shape (time,)
        Outcome at each instant, see `Status`; where it is not 0, all results are NaN.
    culprits : dict of int to str
        For the instants that failed, by index: the body farthest from its prediction, or the driver at fault.
    change_points : numpy.ndarray of shape (points,)
        When the motion passed a singular position smoothly, where assembly branches cross, s: there another motion
        could have branched off, and forces are not determined.
    derived : dict
        What was computed of the motion and may be wanted again, by name: the forces, for one.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        model: Model,
        time: np.ndarray,
        order: int,
        state: tuple[dict[str, Any], tuple[Any, ...]],
        status: np.ndarray,
        culprits: dict[int, str],
        change_points: np.ndarray | None = None,
        way: Way | None = None,
    ):
        self.mechanism, self.time, self.order, self.status = mechanism, time, order, status
        self.culprits = culprits
        self.change_points = np.zeros(0) if change_points is None else change_points
        self.derived: dict[str, Any] = {}
        self._model, self._way = model, way
        self._coordinates, groups = state
        self._groups = dict(zip(model.outputs, groups, strict=True))

    @property
    def model(self) -> Model:
        """The numeric model that was solved."""
        return self._model

    @property
    def poses(self) -> tuple[type, dict[str, Any]]:
        """Type of the poses of all bodies, the ground first, and Taylor coefficients of their coordinates by name."""
        return self._model.pose_type, self._coordinates

    @cached_property
    def forces(self) -> tuple[Group, ...]:
        """The applied forces, in the groups of the model, with the turns of angles about axes at every instant."""
        return self._counting(self._model.system.forces)

    def __repr__(self) -> str:
        solved = int(np.sum(self.status == Status.OK))
        title = f"{self.mechanism.title}: " if self.mechanism.title else ""
        return f"<Motion {title}{solved} of {len(self.time)} instants solved, order {self.order}>"

    @cached_property
    def outputs(self) -> dict[str, np.ndarray]:
        """Outputs by name: arrays of shape (time, order + 1) or (time, order + 1, component), SI."""
        found = {}
        for names, coefficients in self._groups.items():
            for k, name in enumerate(names):
                found[name] = self._derivatives(coefficients[:, :, k])
        for name, output in self.mechanism.outputs.items():
            if isinstance(output, AbstractMotionOutput):
                found[name] = self._derivatives(output.coefficients(self))
        return {name: found[name] for name in self.mechanism.outputs}

    @cached_property
    def dataset(self) -> Any:
        """Outputs as an `xarray.Dataset` with dimensions time, derivative and component; units in the attributes.

        The unit of a variable is that of its derivative 0; each derivative adds ``/s``.
        """
        import xarray

        variables = {
            name: self._labelled(name, values, self.mechanism.outputs[name].unit)
            for name, values in self.outputs.items()
        }
        attributes: dict[str, Any] = {"title": self.mechanism.title or "motion of a mechanism", "source": "jounce"}
        if self.change_points.size:
            attributes["change_points"] = self.change_points
        dataset = xarray.Dataset(variables, coords=self._axes(), attrs=attributes)
        dataset["time"].attrs = {"units": "s", "long_name": "time"}
        dataset["derivative"].attrs = {"long_name": "order of the time derivative"}
        return dataset

    def point(self, body: str, point: Sequence[Any]) -> Any:
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
            Dimensions time, derivative, component; m and its derivatives by s.
        """
        return self.evaluate(PointOutput(body, point), name="position")

    def angle(self, body: str) -> Any:
        """Return the angle of a planar body and its derivatives, rad, with dimensions time and derivative."""
        return self.evaluate(AngleOutput(body), name="angle")

    def angular_velocity(self, body: str, frame: str = "global") -> Any:
        """Return the angular velocity of a body and its derivatives, rad/s, in the frame ``global`` or ``body``.

        The highest derivative of the motion is used up: the result has one order less.
        """
        return self.evaluate(AngularVelocityOutput(body, frame), name="angular_velocity")

    def evaluate(self, output: Any, name: str = "output") -> Any:
        """Return any output, as an `xarray.DataArray`, without solving again.

        Raises
        ------
        MechanismError
            If the output names a body, joint, driver or force that does not exist, or does not fit the mechanism.
        """
        check_output(output, self.mechanism, name)
        if isinstance(output, AbstractMotionOutput):
            return self._labelled(name, self._derivatives(output.coefficients(self)), output.unit)
        values = self._coefficients(output_group(output, self.mechanism, self._model, name))[:, :, 0]
        return self._labelled(name, self._derivatives(values), output.unit)

    def _coefficients(self, group: Group) -> np.ndarray:
        """Return the Taylor coefficients of outputs, (order + 1, components, instances, time)."""
        (group,) = self._counting((group,))
        return np.asarray(_evaluated(group, self._coordinates, self._model.pose_type))

    def _counting(self, groups: tuple[Group, ...]) -> tuple[Group, ...]:
        return groups if self._way is None else self._way.counting(groups, self.time)

    def _derivatives(self, coefficients: np.ndarray) -> np.ndarray:
        """Turn Taylor coefficients (order, component, time) into derivatives (time, derivative[, component])."""
        coefficients = coefficients[: self.order + 1]
        factorials = np.array([math.factorial(k) for k in range(len(coefficients))], float)
        values = np.moveaxis(coefficients * factorials[:, None, None], (2, 0, 1), (0, 1, 2))
        values = np.where((self.status == Status.OK)[:, None, None], values, np.nan)
        return values[..., 0] if values.shape[-1] == 1 else values

    def _labelled(self, name: str, values: np.ndarray, unit: str) -> Any:
        import xarray

        dims = ("time", "derivative", "component")[: values.ndim]
        coordinates = {"time": self.time, "derivative": np.arange(values.shape[1])}
        if values.ndim == 3:
            coordinates["component"] = list(COMPONENTS[: values.shape[2]])
        attributes = {"units": unit, "long_name": name}
        return xarray.DataArray(values, dims=dims, coords=coordinates, name=name, attrs=attributes)

    def _axes(self) -> dict[str, Any]:
        return {"time": self.time, "derivative": np.arange(self.order + 1)}
