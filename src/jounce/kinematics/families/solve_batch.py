"""Families: many designs of one mechanism solved side by side, each with its own outcome at every instant."""

import itertools
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from jax.core import Tracer
from jaxtyping import Bool, Float, Int

from jounce.base.activity import Count
from jounce.base.shapes import ArrayLike, Labeled, Refused
from jounce.errors import AssemblyError, JounceError, MechanismError, MobilityError, SolveError
from jounce.execution.backends import joined
from jounce.execution.threads import thread_count
from jounce.kinematics.assembly.assemble import assemble
from jounce.kinematics.continuation.solver import Solver
from jounce.kinematics.families.design_paths import DesignPaths
from jounce.kinematics.families.design_sides import Sides, sides_of_designs
from jounce.kinematics.families.design_values import assembled_designs, joined_designs, without_forces
from jounce.kinematics.families.known_outputs import with_outputs
from jounce.kinematics.families.labels import labeled_family
from jounce.kinematics.families.parameter_values import check_parameter, checked_values
from jounce.kinematics.families.varied_tree import VariedTree
from jounce.kinematics.position_analysis.idle_holding import with_idle_held_in_family
from jounce.kinematics.position_analysis.solve import LOWEST_ORDER, checked_settings, solve
from jounce.kinematics.results.motion import Motion
from jounce.kinematics.status import Status
from jounce.mechanism import (
    AbstractMotionOutput,
    Mechanism,
    Model,
    build,
    check_mechanism,
    time_grid,
    with_output_drivers,
)
from jounce.mechanism.building.preconditions import concrete
from jounce.mechanism.carriages import has_ends
from jounce.mechanism.laws.law_breaks import laws_may_break, laws_of
from jounce.mechanism.laws.law_checks import check_laws
from jounce.mechanism.outputs.base import lost_orders
from jounce.mechanism.time import TimeLike
from jounce.mechanism.transmissions.axis_angles import measures_angle
from jounce.settings import under_own_settings
from jounce.trajectory.motion import SplineMotion

if TYPE_CHECKING:
    import xarray

SPOILED = (AssemblyError, MobilityError, SolveError)  # errors that concern one design, not the family


@concrete
def solve_batch(
    mechanism: Mechanism,
    parameters: Mapping[str, ArrayLike] | Labeled | Refused,
    time: TimeLike | None = None,
    order: int = 4,
    *,
    tolerance: float = 1e-12,
    progress: Callable[[int, int], None] | None = None,
    threads: int | None = None,
    alone: bool = True,  # a public name
) -> "xarray.Dataset":
    """Return the motions of many designs of a mechanism that differ in its parameters, solved side by side.

    Each design takes its own steps, the same as those of `jounce.solve`. A design that locks, or comes to a singular
    position, is solved individually. All designs are solved individually if outputs are forces, energies or Euler
    angles, if constraints are redundant, if piecewise laws depend on the varied parameters, or if the mechanism selects
    one of its assemblies.

    Parameters
    ----------
    mechanism : Mechanism
        As in `jounce.solve`.
    parameters : dict of str to array_like of shape (designs,), or pandas.DataFrame
        Values of parameters in each design, SI; for a table, by column names.
    time : array_like of shape (time,), optional
        Strictly increasing instants, s, the same for all designs; those of the mechanism by default.
    order, tolerance
        As in `jounce.solve`.
    progress : callable, optional
        Called with the number of designs done and their total.
    threads : int, optional
        As in `jounce.solve`; results do not depend on it.
    alone : bool, default True
        Whether to solve individually the designs that lock or are otherwise out of the ordinary, which takes long for
        many of them. Otherwise their status is NOT_REACHED.

    Returns
    -------
    xarray.Dataset
        Outputs with the dimensions design, time, derivative and, for vectors, component, SI. The values of the
        parameters are coordinates of the designs, called ``parameter_NAME`` if NAME is taken. ``status`` (design, time)
        is the outcome, see `Status`; where it is not 0, outputs are NaN. An output that no design has is left out. The
        attribute ``backend`` names the backend, as in `Motion`.

    Raises
    ------
    MechanismError
        If a parameter does not exist, or values are not finite, differ in number, or are invalid for a mechanism; and
        as in `jounce.solve`.

    Examples
    --------
    >>> import jounce as jn
    >>> family = jn.solve_batch(jn.load("examples/four_bar.yaml"), {"BC": [0.13, 0.14, 0.15]}, [0.0, 0.5], order=1)
    >>> dict(family["psi"].sizes), family["BC"].values.tolist()
    ({'design': 3, 'time': 2, 'derivative': 2}, [0.13, 0.14, 0.15])
    >>> int(family["status"].max())
    0
    """
    with Count("solving", "designs", progress) as report:
        family = _Family(mechanism, parameters, time, order, tolerance, report)
        family.solve(thread_count(threads), individually=alone)
    return family.dataset


@under_own_settings
def solve_with_sides(
    mechanism: Mechanism,
    parameters: Mapping[str, ArrayLike],
    instants: Float[np.ndarray, " time"],
    order: int,
    *,
    tolerance: float = 1e-12,
    threads: int | None = None,
) -> tuple["xarray.Dataset", Sides]:
    """Return the dataset of `solve_batch`, and the outputs on both sides of each break of the laws of each design.

    Parameters
    ----------
    mechanism, parameters, order, tolerance, threads
        As in `solve_batch`.
    instants : array of shape (time,)
        Strictly increasing instants, s.
    """
    family = _Family(mechanism, parameters, instants, order, tolerance)
    family.add_sides_of_breaks()
    family.solve(thread_count(threads))
    return family.dataset, family.sides


class _Family:
    """The designs of a family, and their results so far."""

    def __init__(
        self,
        mechanism: Mechanism,
        parameters: Mapping[str, ArrayLike] | Labeled | Refused,
        time: TimeLike | None,
        order: int,
        tolerance: float,
        progress: Callable[[int, int], None] | None = None,
    ):
        check_mechanism(mechanism)
        self.parameters = checked_values(parameters, "design", partial(check_parameter, mechanism))
        for name in ("design", "status"):
            if name in mechanism.outputs:
                message = f"the name {name!r} is that of an array of a family; give the output another name"
                raise MechanismError(message, name=f"outputs.{name}")
        self.names, self.rows = tuple(self.parameters), np.stack(list(self.parameters.values()), axis=-1)
        self.order, self.tolerance = checked_settings(mechanism, order, tolerance), float(tolerance)
        self.instants = time_grid(mechanism.time if time is None else time, mechanism.parameter_values)
        samples = [self._design(k, mechanism) for k in (0, len(self.rows) // 2, -1)]
        self.mechanism = with_idle_held_in_family(mechanism, samples, self.instants, tolerance, solve)
        self.held = with_output_drivers(self.mechanism)  # the mechanism solved side by side
        self.progress = progress
        self.outputs: dict[str, np.ndarray] = {}
        self.backends: set[str] = set()
        self._set_instants(np.zeros((len(self.rows), 0)), np.zeros((len(self.rows), 0)))

    def _set_instants(
        self, side_instants: Float[np.ndarray, "design side"], breaks: Float[np.ndarray, "design side"]
    ) -> None:
        """Set the instants: the common ones first, then the additional ones of each design."""
        self.breaks, common = breaks, np.broadcast_to(self.instants, (len(self.rows), len(self.instants)))
        self.all_instants = np.concatenate([common, side_instants], axis=1)
        self.status: Int[np.ndarray, "design time"] = np.full(self.all_instants.shape, int(Status.NOT_REACHED))

    def add_sides_of_breaks(self) -> None:
        """Add the instants on both sides of each break of the laws of each design."""
        first, last = float(self.instants[0]), float(self.instants[-1])
        level = self.order + lost_orders(self.mechanism.outputs.values())
        breaks, side_instants = sides_of_designs(self.mechanism, self.parameters, first, last, level)
        self._set_instants(side_instants, breaks)

    @property
    def sides(self) -> Sides:
        """Outputs on both sides of the breaks."""
        count = len(self.instants)
        return Sides(self.breaks, {name: values[:, count:] for name, values in self.outputs.items()})

    def _design(self, k: int, mechanism: Mechanism) -> Mechanism:
        """Return a mechanism with the values of one design."""
        return mechanism.with_parameters(**dict(zip(self.names, self.rows[k].tolist(), strict=True)))

    def solve(self, threads: int, *, individually: bool = True) -> None:
        """Solve all designs: most side by side, the others one by one unless `individually` is false."""
        count = len(self.rows)
        all_individually = self.mechanism.assembly is not None or self._of_whole_motions() or self._pieces_vary()
        all_individually = all_individually or has_ends(self.mechanism)  # ends are found in whole motions
        remaining = np.arange(count) if all_individually else self._side_by_side(threads)
        if not (individually or all_individually):
            return
        for done, k in enumerate(remaining.tolist()):
            self._solve_individually(k)
            if self.progress is not None:
                self.progress(count - len(remaining) + done + 1, count)

    @property
    def dataset(self) -> Any:
        """The results as labeled arrays."""
        count = len(self.instants)
        outputs = {name: series[:, :count] for name, series in self.outputs.items()}
        described = self.mechanism.title, self.mechanism.outputs, self.instants, self.order, self.parameters
        return labeled_family("design", *described, outputs, self.status[:, :count], joined(self.backends))

    def _of_whole_motions(self) -> bool:
        """Return whether an output depends on the whole motion, not on one instant."""
        outputs = self.mechanism.outputs.values()
        return any(isinstance(output, AbstractMotionOutput) or getattr(output, "wraps", ()) for output in outputs)

    def _pieces_vary(self) -> bool:
        """Return whether piecewise laws depend on varied parameters; their tables have no lane per design."""
        tables: list[Any] = []

        def pieces(values: Any) -> Any:
            design = self.held.with_parameters(**dict(zip(self.names, values, strict=True)))
            for law in laws_of(design):
                parts = jax.tree.leaves(law, is_leaf=lambda x: isinstance(x, SplineMotion))
                tables.extend(part for part in parts if isinstance(part, SplineMotion))
            return values

        if laws_may_break(self.mechanism):
            jax.eval_shape(pieces, self.rows[0])
        return any(isinstance(leaf, Tracer) for table in tables for leaf in jax.tree.leaves(table))

    def _side_by_side(self, threads: int) -> Int[np.ndarray, " design"]:
        """Solve designs side by side and store their results; return those left to be solved individually."""
        count = len(self.rows)
        first, last = float(self.instants[0]), float(self.instants[-1])
        attempts = ((k, assembled) for k in range(count) if (assembled := self._assembled(k)) is not None)
        index, (model, _) = next(attempts, (0, (None, None)))
        if model is None or model.system.rank is not None:
            return np.arange(count)
        extra_order = lost_orders(self.mechanism.outputs.values())
        check_laws(self._design(index, self.mechanism), np.array([first, last]), self.order + extra_order, forces=False)
        model = without_forces(model)
        systems, coordinates, plain, chosen = self._assembled_designs(model)
        levels, values_of_first = max(self.order + extra_order, LOWEST_ORDER), systems.own(slice(1))
        solver = Solver(model, levels, self.tolerance, finite_order=self.order, own=values_of_first)
        paths = DesignPaths(solver, systems, self.all_instants[chosen], last)
        paths.follow(coordinates, plain, threads)
        outputs, status = paths.solved(threads)
        self.backends.add(solver.backend)
        complete = ~paths.individual
        self.status[chosen[complete]] = status[complete]
        names = itertools.chain(*solver.model.outputs)
        for name, values in zip(names, itertools.chain(*outputs), strict=bool(outputs)):
            values[paths.individual] = np.nan
            self._put(name, chosen, values)
        if self.progress is not None:
            self.progress(int(complete.sum()), count)
        return np.setdiff1d(np.arange(count), chosen[complete])

    def _assembled_designs(
        self, model: Model
    ) -> tuple[VariedTree, dict[str, Any], Bool[np.ndarray, " lane"], Int[np.ndarray, " lane"]]:
        """Return the systems of designs, their start coordinates, whether each may be followed, and its index.

        They are assembled one by one if angles about axes require it, or if equations are too many or too few.
        """
        system = model.system
        if not any(map(measures_angle, (*system.groups, *system.outputs))) and system.shape[0] == system.shape[1]:
            arguments = self.names, self.rows, float(self.instants[0]), self.tolerance
            systems, attempts = assembled_designs(self.held, model, *arguments)
            return systems, attempts.coordinates, np.asarray(attempts.plain), np.arange(len(self.rows))
        assembled = {k: attempt for k in range(len(self.rows)) if (attempt := self._assembled(k)) is not None}
        models, positions = zip(*assembled.values(), strict=True)
        coordinates = jax.tree.map(lambda *parts: np.concatenate(parts, axis=-1), *positions)
        systems, chosen = joined_designs(model, models), np.array(list(assembled))
        return systems, coordinates, np.ones(len(chosen), bool), chosen

    def _assembled(self, k: int) -> tuple[Model, dict[str, Any]] | None:
        """Return the model and start of a design whose outputs follow laws; None if it cannot be assembled."""
        try:
            return assemble(build(self._design(k, self.held)), float(self.instants[0]), self.tolerance)
        except SPOILED:
            return None
        except JounceError as error:
            raise self._located(error, k) from None

    def _solve_individually(self, k: int) -> None:
        """Solve one design as `jounce.solve` does."""
        try:
            grid, indices = np.unique(self.all_instants[k], return_inverse=True)
            design = self._design(k, self.mechanism)
            motion: Motion = solve(design, grid, self.order, tolerance=self.tolerance, strict=False)
            motion, outputs = with_outputs(motion)
        except SPOILED as error:
            status = getattr(error, "status", None)
            self.status[k] = int(Status.NOT_ASSEMBLED if status is None else status)
            return
        except JounceError as error:
            raise self._located(error, k) from None
        self.backends.update(motion.backend.split(", "))
        self.status[k] = motion.status[indices]
        for name, values in outputs.items():
            values = values[indices]
            self._put(name, np.array([k]), values[None] if values.ndim == 3 else values[None, ..., None])

    def _put(self, name: str, designs: np.ndarray, values: np.ndarray) -> None:
        """Store the values of an output, (designs, time, derivative, component), for some designs."""
        values = values[..., 0] if values.shape[-1] == 1 else values
        if name not in self.outputs:
            if len(designs) == len(self.rows):
                self.outputs[name] = values
                return
            self.outputs[name] = np.full((len(self.rows), *values.shape[1:]), np.nan)
        self.outputs[name][designs] = values

    def _located(self, error: JounceError, k: int) -> JounceError:
        """Return an error whose message names the design."""
        values = ", ".join(f"{name} = {value:g}" for name, value in zip(self.names, self.rows[k], strict=True))
        error.message = f"{error.message} (design {k}: {values})"
        return error
