"""The coordinates of a mechanism and their derivatives as inputs of a graph."""

import math
from collections.abc import Sequence

import numpy as np

from jounce.mechanism import Mechanism, Model
from jounce.written_equations.operations.functions import Argument
from jounce.written_equations.operations.graph import Graph
from jounce.written_equations.operations.reading import Entries

EULER_PARAMETERS = ("e0", "e1", "e2", "e3")


class Inputs:
    """The coordinates of all bodies and their derivatives, as inputs of a graph."""

    def __init__(self, graph: Graph, mechanism: Mechanism, model: Model, order: int):
        self.graph, self.order = graph, order
        shifts, spatial = model.pose_type.shifts, mechanism.space == "spatial"
        names, bodies = "xyz"[:shifts], list(mechanism.bodies)
        attitude = EULER_PARAMETERS if spatial else ("angle",)
        turns = ("wx", "wy", "wz") if spatial else ("angle",)
        self.coordinates = [f"{body}.{name}" for body in bodies for name in (*names, *attitude)]
        columns = [f"{body}.{name}" for body in bodies for name in (*names, *turns)]
        self.columns = tuple(columns)
        self.derivatives = tuple(tuple(f"{c}_d{k}" for c in columns) for k in range(1, order + 1))
        self.time = graph.input("t")
        self.t = Argument("t", "t", "the time, s")
        self.q = Argument("q", tuple(self.coordinates), "COORDINATES, (coordinate,)")
        width, spins = shifts + len(attitude), shifts + len(turns)
        ground = [0.0] * shifts + ([1.0, 0.0, 0.0, 0.0] if spatial else [0.0])
        at_rest = list(map(graph.constant, ground))
        self._place = np.array(at_rest + list(map(graph.input, self.coordinates)), np.int64).reshape(-1, width)
        zeros = np.full(spins, graph.constant(0.0))
        moving = [[graph.input(name) for name in row] for row in self.derivatives]
        self._moving = [np.concatenate([zeros, row]).reshape(-1, spins) for row in moving]
        self._shifts, self._attitude = shifts, "quaternion" if spatial else "angle"

    def velocities(self, lead: int) -> Argument:
        """Return the argument of derivatives of the coordinates; the first result needs `lead` of them."""
        return Argument("velocities", self.derivatives, "q', q'', ..., (order, column)", lead)

    def place(self) -> dict[str, Entries]:
        """Return the coordinates at one instant, the ground first, as in `Motion.poses`."""
        position, attitude = self._place[:, : self._shifts], self._place[:, self._shifts :]
        arrays = {"position": position.T, self._attitude: attitude.T if attitude.shape[1] > 1 else attitude[:, 0]}
        return {name: Entries(x[None, ..., None], float) for name, x in arrays.items()}

    def series(self, unknown: Sequence[int], order: int | None = None) -> dict[str, Entries]:
        """Return the coefficients of the coordinates, one instant for each order from which they are zero.

        The coefficients reach to an order, by default the highest.
        """
        graph, order = self.graph, self.order if order is None else order
        zero = graph.constant(0.0)

        def level(k: int, own: int, moving: np.ndarray) -> np.ndarray:
            """Return the coefficients of order k where those of order `own` are not known."""
            if k >= own:
                return np.full(moving.shape, zero)
            factor = graph.constant(float(math.factorial(k)))
            return np.asarray(np.frompyfunc(lambda x: graph.apply("div", x, factor), 1, 1)(moving), np.int64)

        place, elements = self.place(), {}
        if not order:
            return place
        levels = range(1, order + 1)
        repeated = {name: np.repeat(x.numbers, len(unknown), axis=-1) for name, x in place.items()}
        shifts = [[level(k, own, self._moving[k - 1][:, : self._shifts].T) for own in unknown] for k in levels]
        turns = [[level(k, own, self._moving[k - 1][:, self._shifts :].T) for own in unknown] for k in levels]
        elements["position"] = np.concatenate([repeated["position"], np.moveaxis(np.array(shifts), 1, -1)])
        if self._attitude == "angle":
            elements["angle"] = np.concatenate([repeated["angle"], np.moveaxis(np.array(turns), 1, -1)[:, 0]])
        else:
            elements["quaternion"] = repeated["quaternion"]
            rates = [
                [level(k - 1, own - 1, self._moving[k - 1][:, self._shifts :].T) for own in unknown] for k in levels
            ]
            elements["angular_velocity"] = np.moveaxis(np.array(rates), 1, -1)
        return {name: Entries(x, float) for name, x in elements.items()}

    def instants(self, count: int) -> Entries:
        """Return the time, repeated for a number of instants."""
        return Entries(np.full(count, self.time), float)
