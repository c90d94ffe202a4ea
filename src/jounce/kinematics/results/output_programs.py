"""Programs of outputs that follow from a motion, compiled while the motion is solved."""

import numpy as np

from jounce.execution.background import prepare_later
from jounce.kinematics.results.motion import Motion
from jounce.mechanism import AbstractMotionOutput, Mechanism, Model
from jounce.mechanism.laws.output_drivers import output_laws
from jounce.mechanism.transmissions.axis_angles import AttitudeHistory


def prepare_outputs(mechanism: Mechanism, model: Model, order: int) -> None:
    """Compile, in another thread, the programs that the outputs of a mechanism need of a motion.

    Parameters
    ----------
    mechanism : Mechanism
        If drivers follow from its outputs, they are unknown before the motion, and nothing is compiled.
    model : Model
        Model of its bodies.
    order : int
        Highest Taylor coefficient of the motion.
    """
    outputs = [x for x in mechanism.outputs.values() if isinstance(x, AbstractMotionOutput)]
    if not outputs or output_laws(mechanism):
        return

    def prepare() -> None:
        coordinates = {name: np.zeros((order + 1, *np.shape(x)[:-1], 1)) for name, x in model.guess.items()}
        history = None
        if "quaternion" in coordinates:
            coordinates["angular_velocity"] = np.zeros_like(coordinates["position"][1:])
            history = AttitudeHistory(np.asarray(model.guess["quaternion"]), np.zeros(1))
        groups = tuple(np.zeros((order + 1, 1, group.instances, 1)) for group in model.system.outputs)
        like = Motion(
            mechanism, model, np.zeros(1), order, (coordinates, groups), np.zeros(1, int), {}, history=history
        )
        for output in outputs:
            output.prepare(like)

    prepare_later(prepare, "outputs", (model.system, outputs), order)
