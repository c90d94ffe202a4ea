"""The results of many simulations side by side."""

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jounce.base.display import Displayed
from jounce.kinematics import Status
from jounce.kinematics.families.labels import labeled_family
from jounce.mechanism import Mechanism
from jounce.robot.robot import Robot


class JointCoordinate(NamedTuple):
    """The coordinate of a robot joint, as a column of results."""

    unit: str
    labels: tuple[str, ...] = ()
    axes: tuple[tuple[str, tuple[str, ...]], ...] = ()


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Batch(Displayed):
    """The results of many simulations.

    Attributes
    ----------
    time : numpy.ndarray of shape (time,)
        s.
    parameters : dict of str to numpy.ndarray of shape (runs,)
        Parameters of each run.
    outputs : dict of str to numpy.ndarray
        Outputs of the mechanism, or coordinates of the robot by joint, with derivatives, (runs, time, order + 1) or
        (runs, time, order + 1, component), SI; NaN at instants that a run did not reach. Forces and energies, which
        follow from a whole motion, are left out.
    status : numpy.ndarray of int, shape (runs, time)
        A `Status` for each run and instant.
    steps : numpy.ndarray of int, shape (runs,)
        Number of steps of each run.
    mechanism : Mechanism or Robot
        The mechanism or robot.
    order : int
        Highest derivative of the outputs.
    backend : str
        Backend that computed the results: "llvm", machine code, or "xla", with the device unless it is the processor.
    """

    time: Float[np.ndarray, " time"]
    parameters: dict[str, Any]
    outputs: dict[str, Any]
    status: Int[np.ndarray, "run time"]
    steps: Int[np.ndarray, " run"]
    mechanism: Mechanism | Robot
    order: int
    backend: str = ""

    @property
    def dataset(self) -> Any:
        """The results as an `xarray.Dataset` in the form of `jounce.solve_batch`, with the dimension ``run``.

        Variables are the outputs, with their units, the ``status``, and the ``steps`` of each run; parameters are
        coordinates.
        """
        if isinstance(self.mechanism, Robot):
            joints = self.mechanism.joints
            title = self.mechanism.name
            described = {name: JointCoordinate("rad" if joints[name].turning else "m") for name in self.outputs}
        else:
            title, described = self.mechanism.title, self.mechanism.outputs
        family = labeled_family(
            "run", title, described, self.time, self.order, self.parameters, self.outputs, self.status, self.backend
        )
        return family.assign(steps=("run", self.steps, {"long_name": "steps taken"}))

    def __repr__(self) -> str:
        complete = int((self.status == Status.OK).all(axis=1).sum())
        return f"<Batch {complete} of {len(self.status)} runs complete, {len(self.time)} instants>"
