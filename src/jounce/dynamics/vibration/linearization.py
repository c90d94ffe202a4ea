"""Equations of small motions about an equilibrium or along a motion, for control and vibration."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jounce.base.display import Displayed
from jounce.base.shapes import Refused
from jounce.dynamics.statics.independent_coordinates import Reduction
from jounce.dynamics.statics.static_equilibrium import Equilibrium
from jounce.dynamics.statics.variations import reaches
from jounce.dynamics.vibration.modes import Modes
from jounce.errors import MechanismError, check_name
from jounce.mechanism import Mechanism


class StateSpace(NamedTuple):
    """A linear system ``x' = A x + B u``, ``z = C x + D u``, of small changes of a motion.

    ``scipy.signal.StateSpace(*space[:4])`` and ``control.ss(*space[:4])`` take it.

    Attributes
    ----------
    A, B, C, D : numpy.ndarray
        Matrices in SI units.
    states, inputs, outputs : tuple of str
        Names along the axes; the name of a rate ends in ``_d1``.
    """

    A: Float[np.ndarray, "state state"]
    B: Float[np.ndarray, "state input"]
    C: Float[np.ndarray, "output state"]
    D: Float[np.ndarray, "output input"]
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


class Linearization(Displayed):
    """The equations of small motions ``M y'' + C y' + K y = B u`` of independent coordinates y.

    They hold about an equilibrium, or about one instant of a motion, with all velocity terms of inertia, joints and
    forces.

    Attributes
    ----------
    mechanism : Mechanism
        The mechanism.
    equilibrium : Equilibrium or None
        The equilibrium; None along a motion.
    time : float
        The instant, s.
    coordinates, units : tuple of str
        Names and units of y: released drivers, outputs, or coordinates of bodies such as ``rod.angle``.
    mass, damping, stiffness : numpy.ndarray of shape (coordinates, coordinates)
        Matrices in SI units. The stiffness includes that of applied forces and weight, and the geometric stiffness of
        joint and driver reactions.
    inputs : tuple of str
        Names of u: forces of released drivers in addition to their force in the motion, N or N m, and components of
        applied forces in addition to their law.
    input_matrix : numpy.ndarray of shape (coordinates, inputs)
        Generalized forces for a unit of each input.
    held : tuple of str
        Drivers that are not released; they may also be inputs of `state_space`.
    """

    def __init__(self, reduction: Reduction, about: Equilibrium | None, *, by_forces: bool = True):
        self._reduction, self.equilibrium, self._by_forces = reduction, about, by_forces
        self.mechanism, self.time = reduction.point.mechanism, reduction.point.instant
        self.coordinates, self.units, self.held = reduction.names, reduction.units, reduction.held
        self.mass, self.damping, self.stiffness = (reduction.part(level) for level in (2, 1, 0))

    def __repr__(self) -> str:
        title = f"{self.mechanism.title}: " if self.mechanism.title else ""
        reference = "a motion" if self.equilibrium is None else f"an equilibrium that is {self.equilibrium.stability}"
        return f"<Linearization {title}{', '.join(self.coordinates)} about {reference} at {self.time:g} s>"

    @cached_property
    def modes(self) -> Modes:
        """Natural frequencies, damping ratios and shapes; along a motion, those of the equations at the instant."""
        return Modes(self._reduction)

    @cached_property
    def _inputs(self) -> tuple[tuple[str, ...], Float[np.ndarray, "coordinate input"]]:
        reduction, point = self._reduction, self._reduction.point
        count = len(self.coordinates)
        names, columns = [], []
        for k, name in enumerate(reduction.released):
            names.append(name)
            columns.append(np.eye(count)[k])
        if self._by_forces and point.equations.system.forces:
            changes = point.changes(reduction.changes[:, :, reduction.lanes(0)])
            forces = reaches(point.equations, point.coordinates, point.clock, changes)
            for members, reach in zip(point.model.forces, map(np.asarray, forces), strict=True):
                for instance, name in enumerate(members):
                    labels = "xyz"[: len(reach)] if len(reach) > 1 else ("",)
                    names += [f"{name}_{label}" if label else name for label in labels]
                    columns += list(reach[:, instance])
            order = {name: k for k, name in enumerate(reduction.released)} | {
                name: len(reduction.released) + k for k, name in enumerate(self.mechanism.forces)
            }
            ranks = [order[name if name in order else name[:-2]] for name in names]
            names, columns = ([x[k] for k in np.argsort(ranks, kind="stable")] for x in (names, columns))
        return tuple(names), np.array(columns).reshape(-1, count).T

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of forces and torques that act in addition to those of the operating point."""
        return self._inputs[0]

    @property
    def input_matrix(self) -> Float[np.ndarray, "coordinate input"]:
        """Generalized forces for a unit of each input, shape (coordinates, inputs)."""
        return self._inputs[1]

    def state_space(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> StateSpace:
        """Return the linear system in the coordinates and their rates.

        Parameters
        ----------
        inputs : sequence of str, optional
            Names from `inputs`, by default all, or from `held`. The input of a held driver is the second derivative of
            its coordinate, rad/s^2 or m/s^2; the change of the coordinate and its rate are then states.
        outputs : sequence of str, optional
            Outputs of the mechanism that are functions of the poses, or their components such as ``C_x``; by default
            all. Each gives its change and the rate of the change.

        Returns
        -------
        StateSpace
            Matrices, and names of states, inputs and outputs.

        Raises
        ------
        MechanismError
            If a name is not that of an input or of an output.

        Examples
        --------
        >>> import jounce as jn
        >>> import scipy.signal
        >>> pendulum = jn.linearize(jn.load("examples/simple_pendulum.yaml"))
        >>> space = pendulum.state_space(outputs=["angle"])
        >>> space.A.round(9).tolist(), space.outputs
        ([[0.0, 1.0], [-9.81, -0.0]], ('angle', 'angle_d1'))
        """
        names = self.inputs if inputs is None else named("inputs", inputs)
        input_names = (*self.inputs, *self.held)
        for name in names:
            check_name("input", name, input_names, MechanismError, name="inputs")
        forces = [name for name in names if name in self.inputs]
        drivers = [name for name in names if name not in self.inputs]
        return _state_space(self, names, forces, drivers, None if outputs is None else named("outputs", outputs))

    @property
    def A(self) -> Float[np.ndarray, "state state"]:  # noqa: N802 - the field's name
        """State matrix of the coordinates and their rates, ``[[0, 1], [-M^-1 K, -M^-1 C]]``."""
        return self.state_space(outputs=()).A

    @property
    def B(self) -> Float[np.ndarray, "state input"]:  # noqa: N802 - the field's name
        """Input matrix of all `inputs`."""
        return self.state_space(outputs=()).B

    @property
    def C(self) -> Float[np.ndarray, "output state"]:  # noqa: N802 - the field's name
        """Output matrix of all outputs and their rates."""
        return self.state_space().C

    @property
    def D(self) -> Float[np.ndarray, "output input"]:  # noqa: N802 - the field's name
        """Feedthrough matrix from all `inputs` to all outputs and their rates."""
        return self.state_space().D


def named(kind: str, names: str | Sequence[str] | Refused) -> tuple[str, ...]:
    """Return names from a sequence or a single name, or raise MechanismError."""
    if isinstance(names, str):
        return (names,)
    if not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
        raise MechanismError("must be a list of names", name=kind, value=names)
    return tuple(names)


def _state_space(
    system: Linearization,
    inputs: Sequence[str],
    forces: Sequence[str],
    drivers: Sequence[str],
    outputs: tuple[str, ...] | None,
) -> StateSpace:
    """Return the state space, in which a driver acts by the generalized forces of its change and two rates."""
    r, n, m = system._reduction, len(system.coordinates), len(drivers)
    chosen = [r.held.index(name) for name in drivers]
    by_law = [-r.matrices[:, r.lanes(level, drivers=True)][:, chosen] for level in range(3)]
    by_force = system.input_matrix[:, [system.inputs.index(name) for name in forces]]
    # second derivatives of the coordinates by coordinates, laws, their rates, and inputs
    right = np.concatenate([-system.stiffness, by_law[0], -system.damping, by_law[1], by_force, by_law[2]], axis=1)
    second = np.linalg.solve(system.mass, right) if n else right
    size = n + m
    a, b = np.zeros((2 * size, 2 * size)), np.zeros((2 * size, len(inputs)))
    a[:size, size:] = np.eye(size)
    a[size : size + n] = second[:, : 2 * size]
    columns = [inputs.index(name) for name in (*forces, *drivers)]
    b[size : size + n, columns] = second[:, 2 * size :]
    for k, name in enumerate(drivers):
        b[size + n + k, inputs.index(name)] = 1.0
    names = (*system.coordinates, *drivers)
    states = (*names, *(f"{name}_d1" for name in names))
    c, d, output_names = _outputs(system, outputs, chosen, (a, b))
    return StateSpace(a, b, c, d, states, tuple(inputs), output_names)


def _outputs(
    system: Linearization,
    selection: tuple[str, ...] | None,
    drivers: Sequence[int],
    state: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Return the matrices C and D of outputs and their rates, and the names of the rows."""
    r, (a, b) = system._reduction, state
    size = len(a) // 2
    point = r.point
    if (selection is not None and not selection) or not point.model.system.outputs:
        for name in selection or ():
            check_name("output", name, (), MechanismError, name="outputs")
        return np.zeros((0, 2 * size)), np.zeros((0, b.shape[1])), ()
    varied = point.outputs_varied(r.changes)
    components = point.components([x.shape[1] for x in varied])
    names = _components(system.mechanism, components, selection)
    # lanes of coordinates and driver laws, of their rates, and of their second derivatives
    lanes = [[*np.arange(r.lanes(k).start, r.lanes(k).stop), *(r.lanes(k, drivers=True).start + x for x in drivers)]
             for k in range(3)]  # fmt: skip
    c, d = [], []
    for name in names:
        group, component, instance = components[name]
        for level in range(2):
            value, rate, second = (varied[group][level, component, instance, lanes[k]] for k in range(3))
            c.append(np.concatenate([value, rate]) + second @ a[size:])
            d.append(second @ b[size:])
    labels = tuple(label for name in names for label in (name, f"{name}_d1"))
    return np.reshape(c, (len(c), 2 * size)), np.reshape(d, (len(d), b.shape[1])), labels


def _components(mechanism: Mechanism, components: Any, selection: tuple[str, ...] | None) -> list[str]:
    """Return the names of the components of the selected outputs, or raise MechanismError for an unknown one."""
    if selection is None:
        return list(components)
    selected = []
    for name in selection:
        matches = [c for c in components if c == name or (name in mechanism.outputs and c.startswith(f"{name}_"))]
        if not matches:
            if name in mechanism.outputs:
                message = "follows from the whole motion, as a force or an energy does; name outputs of poses"
                raise MechanismError(message, name=f"outputs.{name}")
            check_name("output", name, (*mechanism.outputs, *components), MechanismError, name="outputs")
        selected += matches
    return selected
