"""Many simulations of one mechanism side by side: initial conditions, masses, forces and lengths by parameters."""

import dataclasses
import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import numpy as np
from jax.core import Tracer

from jounce.dynamics.energies import gravity_of, masses_of
from jounce.dynamics.forward import Equations, State
from jounce.dynamics.start import driven, start, with_rates
from jounce.errors import MechanismError, did_you_mean
from jounce.integrate.events import output_series
from jounce.integrate.marching import Outcome, departed, march
from jounce.integrate.methods import AbstractMethod
from jounce.integrate.projection import projected
from jounce.integrate.simulate import STEPS, checked, instants_of
from jounce.integrate.simulation import continuous, expanded, pose_coordinates
from jounce.kinematics import Status
from jounce.kinematics.compilation import compiled
from jounce.mechanism import Mechanism, Model, build

LANES = 64  # runs marched together: more fall out of the cache
STAGES = 8  # in which parameters go from those of the first run to their own, so that positions follow


@dataclasses.dataclass(frozen=True)
class Batch:
    """The results of many simulations.

    Attributes
    ----------
    time : numpy.ndarray of shape (time,)
        s.
    parameters : dict of str to numpy.ndarray of shape (runs,)
        What the runs differ in.
    outputs : dict of str to numpy.ndarray
        Outputs of the mechanism with derivatives, (runs, time, order + 1) or (runs, time, order + 1, component), SI;
        NaN where a run did not get so far.
    status : numpy.ndarray of int, shape (runs, time)
        See `Status`.
    steps : numpy.ndarray of int, shape (runs,)
        Steps taken.
    """

    time: np.ndarray
    parameters: dict[str, np.ndarray]
    outputs: dict[str, np.ndarray]
    status: np.ndarray
    steps: np.ndarray


def simulate_batch(
    mechanism: Mechanism,
    parameters: Mapping[str, Any],
    time: Any = None,
    order: int = 2,
    *,
    method: AbstractMethod | None = None,
    tolerance: float = 1e-15,
    longest_step: float = np.inf,
) -> Batch:
    """Return many simulations of a mechanism that differ in its parameters, computed side by side.

    Initial conditions differ where their laws have parameters. What is compiled serves all runs.

    Parameters
    ----------
    mechanism : Mechanism
        As for `simulate`.
    parameters : dict of str to array_like of shape (runs,)
        Values of some parameters in each run, SI.
    time, order, method, tolerance, longest_step
        As for `simulate`; each run has steps of its own.

    Returns
    -------
    Batch
        A run that fails does not stop the others: `status` says so.

    Raises
    ------
    MechanismError
        If a parameter does not exist, or values are not finite or of unequal number; and as `simulate`.

    Examples
    --------
    >>> import jounce as jn
    >>> pendulum = jn.Mechanism(
    ...     space="planar",
    ...     gravity=[0, -9.81],
    ...     parameters={"lift": 0.1},
    ...     bodies={"rod": jn.Body([0, 0], mass=2.0, inertia=0.5, center_of_mass=[1, 0])},
    ...     joints={"O": jn.planar.Revolute(("ground", "rod"), [0, 0], [0, 0])},
    ...     initial={"rise": jn.drivers.CoordinateDriver(("ground", "rod"), "angle", motion="lift")},
    ...     outputs={"angle": jn.AngleOutput("rod")},
    ... )
    >>> jn.simulate_batch(pendulum, {"lift": [0.1, 0.2, 0.3]}, [0.0, 0.5]).outputs["angle"].shape
    (3, 2, 3)
    """
    values = _checked_parameters(mechanism, parameters)
    names, rows = tuple(values), np.stack(list(values.values()), axis=-1)
    first = mechanism.with_parameters(**dict(zip(names, rows[0].tolist(), strict=True)))
    order, method = checked(order, method, tolerance, longest_step)
    instants = instants_of(mechanism.time if time is None else time, first.parameter_values)
    nominal = start(first, float(instants[0]))
    family = _Family(first, nominal.model, names)
    begun = _Family(driven(first), build(driven(first)), names) if first.initial else family

    def run(lanes: np.ndarray) -> Any:
        state = _started(begun, nominal.state, rows[0], rows[lanes], float(instants[0]))
        return _marched(family, rows[lanes], state, instants, order, method, float(tolerance), float(longest_step))

    count = len(rows)
    width = min(LANES, 1 << (count - 1).bit_length())
    chunks = [np.minimum(np.arange(k, k + width), count - 1) for k in range(0, count, width)]
    with ThreadPoolExecutor(min(len(chunks), os.cpu_count() or 1)) as pool:  # XLA works outside of Python's lock
        parts = [run(chunks[0]), *pool.map(run, chunks[1:])]
    outputs, status, steps = (
        jax.tree.map(lambda *xs: np.concatenate(xs)[:count], *p) for p in zip(*parts, strict=True)
    )
    ordered = {name: outputs[name] for name in mechanism.outputs if name in outputs}
    return Batch(instants, values, ordered, status, steps)


def _checked_parameters(mechanism: Mechanism, parameters: Mapping[str, Any]) -> dict[str, np.ndarray]:
    if not parameters:
        raise MechanismError("a batch differs in at least one parameter", name="parameters", value=dict(parameters))
    values, count = {}, None
    for name, given in parameters.items():
        if name not in mechanism.parameters:
            message = f"no parameter has this name; {did_you_mean(name, mechanism.parameters)}"
            raise MechanismError(message, name="parameters", value=name)
        try:
            array = np.asarray(given, float)
        except (TypeError, ValueError):
            array = np.zeros(0)
        if array.ndim != 1 or not array.size or not np.isfinite(array).all():
            raise MechanismError(
                "must be a list of finite numbers, one for each run", name=f"parameters.{name}", value=given
            )
        if count is not None and len(array) != count:
            message = f"must have one value for each run, {count} as those before"
            raise MechanismError(message, name=f"parameters.{name}", value=len(array))
        values[name], count = array, len(array)
    return values


class _Family:
    """A mechanism whose values follow from parameters: those that do have one entry for each run, last."""

    def __init__(self, mechanism: Mechanism, model: Model, names: tuple[str, ...]):
        self.mechanism, self.model, self.names = mechanism, model, names
        self.scale = np.float64(np.max(masses_of(mechanism)[0]))
        self._moved: list[bool] = []
        self._leaves, self._structure = jax.tree.flatten(self._made(mechanism, model))

    def _made(self, mechanism: Mechanism, model: Model) -> tuple[Equations, Any]:
        system = dataclasses.replace(model.system, outputs=())
        masses, gravity = masses_of(mechanism), gravity_of(mechanism)
        return Equations(system, *masses, gravity, self.scale, model.pose_type), model.system.outputs

    def of(self, rows: np.ndarray) -> tuple[Equations, Any]:
        """Return equations of motion and outputs for values of the parameters, (runs, parameters)."""

        def one(row: Any) -> list[Any]:
            varied = self.mechanism.with_parameters(**dict(zip(self.names, row, strict=True)))
            leaves = jax.tree.leaves(self._made(varied, build(varied, like=self.model)))
            self._moved = [isinstance(leaf, Tracer) for leaf in leaves]
            return [leaf for leaf in leaves if isinstance(leaf, Tracer)]

        varied = iter(jax.vmap(one, out_axes=-1)(rows))
        pairs = zip(self._leaves, self._moved, strict=True)
        leaves = [np.asarray(next(varied))[..., 0, :] if moved else leaf for leaf, moved in pairs]
        return jax.tree.unflatten(self._structure, leaves)


def _started(begun: _Family, state: State, first: Any, rows: np.ndarray, instant: float) -> State:
    """Return consistent states of runs: positions followed from those of the first run, least velocities."""
    lanes, clock = len(rows), np.full((1, len(rows)), instant)
    state = State(*(np.repeat(np.asarray(part), lanes, axis=-1) for part in state))
    state = state._replace(velocity=np.zeros_like(state.velocity), spin=np.zeros_like(state.spin))
    equations, _ = begun.of(rows)
    for stage in range(1, STAGES + 1):
        nearer, _ = begun.of(first + (rows - first) * (stage / STAGES))
        state = _followed(nearer, state, clock)
        state = state._replace(velocity=np.zeros_like(state.velocity), spin=np.zeros_like(state.spin))
    return jax.tree.map(np.asarray, with_rates(equations, state, clock))


@compiled()
def _followed(equations: Equations, state: State, clock: Any) -> State:
    return projected(equations, state, clock)[0]


def _marched(
    family: _Family,
    rows: np.ndarray,
    state: State,
    instants: np.ndarray,
    order: int,
    method: AbstractMethod,
    tolerance: float,
    longest: float,
) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Return outputs, status and numbers of steps of some runs."""
    equations, outputs = family.of(rows)
    lanes, stop = len(rows), instants[-1]
    lost = max((o.lost_orders for o in family.mechanism.outputs.values()), default=0)
    front = departed(equations, state, np.full(lanes, instants[0]), order=method.expansion_order(tolerance))
    sense = 1.0 if stop >= instants[0] else -1.0
    shape = (len(instants), lanes)
    found: Any = None
    step, reached = np.zeros(shape), np.zeros(shape, bool)
    count = np.zeros(lanes, int)
    if len(instants) == 1:
        found = jax.tree.map(lambda x: np.asarray(x)[None], front.expansion.state)
        reached[:] = np.asarray(front.outcome) != Outcome.LOST
    while (np.asarray(front.outcome) == Outcome.RUNNING).any() and len(instants) > 1:
        front, steps, tried = march(equations, front, stop, tolerance, longest, method=method, count=STEPS)
        start, length, taken, polynomial = jax.tree.map(lambda x, n=int(tried): np.asarray(x)[:n], steps)
        if found is None:
            found = jax.tree.map(lambda x: np.zeros((len(instants), *x.shape[1:])), polynomial)
        count += taken.sum(axis=0)
        for lane in range(lanes):
            mine = np.flatnonzero(taken[:, lane])
            if not len(mine):
                continue
            begin, end = start[mine, lane], start[mine[-1], lane] + length[mine[-1], lane]
            inside = (sense * instants >= sense * begin[0]) & (sense * instants <= sense * end + 1e-14 * abs(end))
            which = np.flatnonzero(inside)
            chosen = mine[np.searchsorted(sense * begin, sense * instants[which], side="right") - 1]
            step[which, lane], reached[which, lane] = instants[which] - start[chosen, lane], True
            for whole, part in zip(found, polynomial, strict=True):
                whole[which, ..., lane] = part[chosen, ..., lane]
    states = [
        expanded(
            equations,
            State(*(part[k] for part in found)),
            step[k],
            np.full(lanes, instants[k]),
            order=order + max(lost, 1),
        )
        for k in range(len(instants))
    ]
    whole = jax.tree.map(lambda *xs: np.stack([np.asarray(x) for x in xs], axis=-2), *states)
    results = _outputs(family, outputs, whole, instants, order, reached)
    status = np.where(reached, int(Status.OK), int(Status.NOT_REACHED)).T
    stuck = ~reached.all(axis=0)
    status[stuck, np.argmin(reached[:, stuck], axis=0)] = int(Status.COLLAPSED)
    return results, status, count


def _outputs(
    family: _Family, outputs: Any, state: State, instants: np.ndarray, order: int, reached: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the outputs with derivatives, (runs, time, order + 1[, component])."""
    times, lanes = reached.shape
    flat = State(*(part.reshape(*part.shape[:-2], times * lanes) for part in state))
    coordinates = pose_coordinates(flat)
    results = {}
    for group, names in zip(outputs, family.model.outputs, strict=True):
        wide = jax.tree.map(lambda x: np.tile(x, times) if np.shape(x)[-1:] == (lanes,) and lanes > 1 else x, group)
        series = np.array(output_series(wide, coordinates, family.model.pose_type))[: order + 1]
        series = np.moveaxis(series.reshape(*series.shape[:-1], times, lanes), -1, -2)  # the time last
        series = continuous(group, series, instants)
        factorials = np.cumprod([1.0, *range(1, len(series))])
        for k, name in enumerate(names):
            values = np.moveaxis(series[:, :, k] * factorials[:, None, None, None], (2, 3, 0, 1), (0, 1, 2, 3))
            values = np.where(reached.T[:, :, None, None], values, np.nan)
            results[name] = values[..., 0] if values.shape[-1] == 1 else values
    return results
