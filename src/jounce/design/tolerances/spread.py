"""Tolerance analysis: the spread of outputs and derivatives by deviations of parameters, and the share of each."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.activity import Count
from jounce.base.padding import padded
from jounce.design.tolerances.design_space import Sobol
from jounce.design.tolerances.variations import Variation, read_variations, reader_of, spreads
from jounce.errors import MechanismError, UnsupportedError, check_name, no_such, whole_number
from jounce.jet.turns import whole_periods
from jounce.kinematics import Motion, Status, solve
from jounce.kinematics.families.design_sides import Sides
from jounce.kinematics.families.solve_batch import solve_with_sides
from jounce.mechanism import Mechanism, check_mechanism, time_grid
from jounce.mechanism.building.preconditions import concrete
from jounce.mechanism.laws.law_breaks import laws_may_break
from jounce.mechanism.laws.output_drivers import with_outputs
from jounce.mechanism.time import TimeLike

if TYPE_CHECKING:
    import xarray

TOGETHER = 256  # designs solved in one program
MOST_NUMBERS = 100_000_000  # of the histories of all samples: 0.8 GB
PERCENTILES = (2.5, 97.5)
BAND = {"low": PERCENTILES[0], "high": PERCENTILES[1]}

Progress = Callable[[int, int], None]
Histories = dict[str, Float[np.ndarray, "sample time derivative *axes"]]


@concrete
def tolerance(
    mechanism: Mechanism,
    vary: Mapping[str, Any],
    time: TimeLike | None = None,
    order: int = 4,
    *,
    of: Sequence[str] | None = None,
    samples: int = 1024,
    linear: bool = True,
    indices: bool = False,
    progress: Progress | None = None,
) -> "xarray.Dataset":
    """Return the spread of outputs and their derivatives by independent deviations of parameters.

    It is computed to first order, by exact gradients, and by a Monte Carlo method on a scrambled Sobol sequence with a
    fixed seed, which solves every design and thus includes nonlinear effects.

    Parameters
    ----------
    mechanism : Mechanism
        The nominal design.
    vary : dict of str to object
        Parameters by name: ``"normal:0.1mm"`` (a standard deviation), ``"uniform:0.1mm"`` (a half-width), both about
        the nominal value, or the ends of a range of equally likely values, ``"14.1cm:14.3cm"`` or (0.141, 0.143).
    time : array_like of shape (time,), optional
        Instants, s; by default those of the mechanism.
    order : int, default 4
        Highest derivative, unless `of` is given.
    of : str or sequence of str, optional
        Names of the columns to compute: ``"psi"``, ``"psi_d3"``, ``"C_x_d2"``; all by default.
    samples : int, default 1024
        Number of designs to solve; powers of two fill the ranges best. 0 omits the Monte Carlo method.
    linear : bool, default True
        Whether to compute gradients.
    indices : bool, default False
        Whether to estimate Sobol indices of the peaks with SALib, from ``samples * (parameters + 2)`` further designs.
    progress : callable, optional
        Called with the number of designs done and their total.

    Returns
    -------
    xarray.Dataset
        For each output NAME, with the dimensions time and derivative (and component), SI: NAME itself, of the nominal
        design; NAME_linear_std, the standard deviation to first order; NAME_mean, NAME_std, NAME_low and NAME_high, the
        mean, the standard deviation, and the percentiles 2.5 and 97.5 of the samples. NAME_gradient (parameter, ...)
        has its derivatives by the parameters, NAME_share (parameter, ...) the share of each in the variance to first
        order. NAME_peak, NAME_peak_mean, and so on refer to the largest magnitude at the instants; with indices also
        NAME_peak_first_order and NAME_peak_total_order (Saltelli 2010). ``solved`` (time) is the number of solved
        samples; statistics omit the others, which lock or cannot be assembled.

    Raises
    ------
    MechanismError
        If a parameter or an output does not exist, or the samples would not fit into memory.
    SolveError
        If the nominal design is not solved at all instants.
    UnsupportedError
        If SALib is required but not installed.

    Notes
    -----
    Saltelli et al. 2010, Computer Physics Communications 181, 259-270; Owen 1998, ACM TOMACS 8, 71-102.

    Examples
    --------
    >>> import jounce as jn
    >>> four_bar = jn.load("examples/four_bar.yaml")
    >>> spread = jn.tolerance(four_bar, {"BC": "normal:0.1mm"}, [0.0, 0.5], of=["psi_d1"], samples=0)
    >>> spread["psi_share"].sel(parameter="BC", derivative=1).values.tolist()
    [1.0, 1.0]
    """
    check_mechanism(mechanism)
    variations = read_variations(vary, reader_of(mechanism))
    for name in variations:
        check_name("parameter", name, mechanism.parameters, MechanismError, name="vary")
    spreads(variations)
    samples = whole_number("samples", samples, 0, error=MechanismError)
    if not (samples or linear):
        message = "nothing is left to compute; take gradients, or give samples, two or more"
        raise MechanismError(message, name="samples", value=samples)
    if indices:
        check_salib(samples)
    selected = tuple(mechanism.outputs)
    if of is not None:
        chosen = [column_of(mechanism, name) for name in ((of,) if isinstance(of, str) else of)]
        order = max((atom[2] for atom in chosen), default=0)
        outputs = {name: output for name, output in mechanism.outputs.items() if name in {c[0] for c in chosen}}
        selected, mechanism = tuple(outputs), with_outputs(mechanism, outputs)
    if not mechanism.outputs:
        raise MechanismError("there is no output whose spread could be computed", name="outputs")
    instants = time_grid(mechanism.time if time is None else time, mechanism.parameter_values)
    nominal = solve(mechanism, instants, order)
    atom = _Spread(nominal, variations, selected)
    if linear:
        atom.add_gradients()
    with Count("solving", "designs", progress) as tell:
        if samples:
            atom.add_samples(samples, tell)
        if indices:
            atom.add_indices(samples, tell)
    return atom.dataset()


def column_of(mechanism: Mechanism, name: str) -> tuple[str, str, int]:
    """Return the output, the component (or an empty string), and the derivative in the name of a column.

    Raises
    ------
    MechanismError
        If the column does not exist.

    Examples
    --------
    >>> import jounce as jn
    >>> column_of(jn.load("examples/four_bar.yaml"), "C_x_d3")
    ('C', 'x', 3)
    """
    stem, _, digits = str(name).rpartition("_d")
    stem_name, order = (stem, int(digits)) if stem and digits.isdecimal() and len(digits) < 3 else (str(name), 0)
    for output, quantity in mechanism.outputs.items():
        if stem_name == output:
            return output, "", order
        if stem_name.startswith(f"{output}_") and stem_name[len(output) + 1 :] in quantity.component_labels(mechanism):
            return output, stem_name[len(output) + 1 :], order
    message = f"{no_such('output', stem_name, mechanism.outputs)}; components and derivatives as in C_x_d3"
    raise MechanismError(message, name="of", value=name)


def check_salib(samples: int) -> None:
    """Raise an error unless Sobol indices can be estimated."""
    from importlib.util import find_spec

    if find_spec("SALib") is None:
        message = "Sobol's indices need SALib, which is not installed; install it with: pip install SALib"
        raise UnsupportedError(message, name="indices")
    if samples < 2 or samples & (samples - 1):
        message = "Sobol's indices need a power of two of samples, 2 or more"
        raise MechanismError(message, name="samples", value=samples)


class _Spread:
    """The spread of the outputs of a mechanism about its nominal motion."""

    def __init__(self, nominal: Motion, variations: Mapping[str, Variation], selected: tuple[str, ...]):
        self.nominal, self.mechanism = nominal, nominal.mechanism
        self.names, self.variations = tuple(variations), spreads(variations)
        self.space = dict(self.mechanism.parameter_values)
        self.deviations = np.array([variation.deviation() for variation in self.variations.values()])
        dataset = nominal.dataset
        dataset = dataset.drop_vars([name for name in self.mechanism.outputs if name not in selected])
        self._variables: dict[str, Any] = {str(name): dataset[name].variable for name in dataset.data_vars}
        self._outputs = selected
        self._solved: np.ndarray | None = None
        sides, parameters = Sides(np.zeros((1, 0)), {}), {name: [self.space[name]] for name in self.names}
        if laws_may_break(self.mechanism):
            sides = solve_with_sides(self.mechanism, parameters, nominal.time, nominal.order)[1]
        for name in self._outputs:
            dims, values = dataset[name].dims[1:], dataset[name].values
            peak = self._peaks(name, values[None], sides)[0]
            self._put(f"{name}_peak", dims, peak, name, "largest magnitude of {} at the instants and breaks of laws")

    def add_gradients(self) -> None:
        """Add the derivatives by all parameters, from one forward pass."""
        start = jnp.array([self.space[name] for name in self.names])

        def outputs(values: Any) -> dict[str, Any]:
            changed = self.mechanism.with_parameters(**dict(zip(self.names, values, strict=True)))
            results = solve(changed, self.nominal.time, self.nominal.order).outputs
            return {name: results[name] for name in self._outputs}

        for name, gradient in jax.jacfwd(outputs)(start).items():
            dims = self._variables[name].dims
            slope = np.moveaxis(np.asarray(gradient), -1, 0)
            slope = slope.reshape(len(self.names), *self._variables[name].shape)
            contributions = (slope * self.deviations.reshape(-1, *[1] * (slope.ndim - 1))) ** 2
            variance = contributions.sum(axis=0)
            fractions = np.divide(contributions, variance, out=np.zeros_like(contributions), where=variance > 0)
            self._put(f"{name}_gradient", ("parameter", *dims), slope, name, "derivative of {} by the parameter")
            self._put(f"{name}_linear_std", dims, np.sqrt(variance), name, "standard deviation of {}, first order")
            self._put(f"{name}_share", ("parameter", *dims), fractions, "", "part of the variance of {}", name)

    def add_samples(self, count: int, progress: Progress | None) -> None:
        """Add the statistics of designs drawn from the distributions."""
        shapes = [self._variables[name].shape for name in self._outputs]
        numbers = count * sum(math.prod(shape) for shape in shapes)
        if numbers > MOST_NUMBERS:
            message = (
                f"so many samples need {numbers:.3g} numbers in memory, and the limit is {MOST_NUMBERS:.3g}; use "
                "fewer samples, instants or outputs, or sweep them (jn.sweep), which stores peaks only"
            )
            raise MechanismError(message, name="samples", value=count)
        space = Sobol(self.variations, self.space, count)
        histories: Histories = {n: np.full((count, *s), np.nan) for n, s in zip(self._outputs, shapes, strict=True)}
        peaks = {name: np.full((count, *s[1:]), np.nan) for name, s in zip(self._outputs, shapes, strict=True)}
        is_solved = np.zeros((count, len(self.nominal.time)), bool)
        for start, stop in _batches(count, progress):
            batch, sides = self._solved_designs(space.values(start, stop))
            is_solved[start:stop] = batch["status"].values == Status.OK
            for name in self._outputs:
                if name in batch:
                    histories[name][start:stop] = self._near_nominal(name, batch[name].values)
                    peaks[name][start:stop] = self._peaks(name, histories[name][start:stop], sides)
        self._solved = is_solved.sum(axis=0)
        for name, values in histories.items():
            dims = self._variables[name].dims
            self._add_statistics(name, "", dims, values)
            self._add_statistics(f"{name}_peak", name, dims[1:], peaks[name][is_solved.all(axis=1)])

    def add_indices(self, count: int, progress: Progress | None) -> None:
        """Add Sobol indices: the share of each parameter in the variance of the peaks, alone and with others."""
        from SALib.analyze import sobol as analyze
        from SALib.sample import sobol as sample

        bounds = [[0.0, 1.0]] * len(self.names)
        problem = {"num_vars": len(self.names), "names": list(self.names), "bounds": bounds}
        shares = np.asarray(sample.sample(problem, count, calc_second_order=False, seed=1))
        shares = np.clip(shares, 2.0**-31, 1 - 2.0**-31)
        values = {
            name: variation.quantile(shares[:, k], self.space[name])
            for k, (name, variation) in enumerate(self.variations.items())
        }
        peaks: dict[str, list[np.ndarray]] = {name: [] for name in self._outputs}
        for start, stop in _batches(len(shares), progress):
            batch, sides = self._solved_designs({name: x[start:stop] for name, x in values.items()})
            is_unsolved = (batch["status"].values != Status.OK).any(axis=1)
            if is_unsolved.any():
                phrase = f"{int(is_unsolved.sum())} of {stop - start} designs lock or cannot be assembled"
                message = f"{phrase}, and indices need all of them; narrow the spread"
                raise MechanismError(message, name="indices")
            for name in self._outputs:
                peaks[name].append(self._peaks(name, self._near_nominal(name, batch[name].values), sides))
        for name, chunks in peaks.items():
            samples = np.concatenate(chunks)
            flat = samples.reshape(len(samples), -1)
            first_order, total_order = np.full((2, len(self.names), flat.shape[1]), np.nan)
            for k in np.flatnonzero(flat.std(axis=0) > 1e-12 * np.abs(flat).max(axis=0)):
                settings = {"calc_second_order": False, "print_to_console": False, "seed": 1}
                indices = analyze.analyze(problem, flat[:, k], **settings)
                first_order[:, k], total_order[:, k] = indices["S1"], indices["ST"]
            dims, shape = self._variables[f"{name}_peak"].dims, (len(self.names), *samples.shape[1:])
            for kind, x, meaning in (("first", first_order, "alone"), ("total", total_order, "alone and with others")):
                indices = f"part of the variance of the peak of {{}} by the parameter {meaning}"
                self._put(f"{name}_peak_{kind}_order", ("parameter", *dims), x.reshape(shape), "", indices, name)

    def dataset(self) -> Any:
        """Return all results, labeled."""
        import xarray

        nominal = self.nominal.dataset
        coordinates = {str(name): x for name, x in nominal.coords.items()} | {"parameter": list(self.names)}
        coordinates["deviation"] = ("parameter", self.deviations, {"long_name": "standard deviation of the parameter"})
        variables = dict(self._variables)
        if self._solved is not None:
            variables["solved"] = ("time", self._solved, {"long_name": "samples solved"})
        return xarray.Dataset(variables, coordinates, {"title": nominal.attrs.get("title", ""), "source": "jounce"})

    def _solved_designs(self, values: Mapping[str, np.ndarray]) -> tuple[Any, Sides]:
        """Return designs solved side by side, padded to a constant number so that programs compile once."""
        count = len(next(iter(values.values())))
        designs = {name: padded(x, TOGETHER) for name, x in values.items()}
        batch, sides = solve_with_sides(self.mechanism, designs, self.nominal.time, self.nominal.order)
        return batch.isel(design=slice(count)), sides

    def _peaks(
        self, name: str, values: Float[np.ndarray, "sample time derivative *axes"], sides: Sides
    ) -> Float[np.ndarray, "sample derivative *axes"]:
        """Return the largest magnitudes of an output in each sample, at instants and on both sides of breaks."""
        peaks = np.abs(values).max(axis=1)
        one_sided = sides.values.get(name)
        if one_sided is None or not one_sided.shape[1]:
            return peaks
        one_sided = np.abs(one_sided[: len(values)].reshape(len(values), -1, *values.shape[2:]))
        if np.any(getattr(self.mechanism.outputs[name], "wraps", ())):
            one_sided[:, :, 0] = np.nan  # an angle itself, counted from the start of the motion
        return np.where(np.isnan(peaks), peaks, np.fmax(peaks, np.fmax.reduce(one_sided, axis=1)))

    def _near_nominal(
        self, name: str, values: Float[np.ndarray, "sample time derivative *axes"]
    ) -> Float[np.ndarray, "sample time derivative *axes"]:
        """Return samples of an output with whole turns added so that they start nearest to the nominal motion.

        Euler angles start within half a turn of zero in every design, so that both signs occur near half a turn.
        """
        wraps = np.array(getattr(self.mechanism.outputs[name], "wraps", ()))
        if wraps.any():
            deviation = values[:, 0, 0] - self._variables[name].values[0, 0]
            values[:, :, 0] -= (whole_periods(deviation) * wraps)[:, None]
        return values

    def _add_statistics(self, name: str, of: str, dims: tuple[str, ...], values: np.ndarray) -> None:
        """Store the statistics of the solved samples."""
        import warnings

        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # NaN where no sample is solved
            statistics = {"mean": np.nanmean(values, axis=0), "std": np.nanstd(values, axis=0, ddof=1)}
            bounds = (
                np.nanpercentile(values, PERCENTILES, axis=0)
                if len(values)
                else np.full((2, *values.shape[1:]), np.nan)
            )
        statistics |= dict(zip(BAND, bounds, strict=True))
        descriptions = {"mean": "mean", "std": "standard deviation", "low": "percentile 2.5", "high": "percentile 97.5"}
        for kind, x in statistics.items():
            long_name = f"{descriptions[kind]} of {'the peak of ' if of else ''}{{}} over the samples"
            self._put(f"{name}_{kind}", dims, x, of or name, long_name)

    def _put(
        self, name: str, dims: tuple[Any, ...], values: np.ndarray, unit_of: str, template: str, of: str = ""
    ) -> None:
        if name in self._variables:
            message = f"two arrays of the result would be called {name}; give the output another name"
            raise MechanismError(message, name=f"outputs.{name}")
        units = self.mechanism.outputs[unit_of].unit if unit_of else "1"
        from xarray import Variable

        self._variables[name] = Variable(dims, values, {"units": units, "long_name": template.format(of or unit_of)})


def _batches(count: int, progress: Progress | None) -> Iterator[tuple[int, int]]:
    """Yield the bounds of batches of designs, and report the number of designs done."""
    for start in range(0, count, TOGETHER):
        stop = min(start + TOGETHER, count)
        yield start, stop
        if progress is not None:
            progress(stop, count)
