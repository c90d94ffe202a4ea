"""Values of parameters that vary among designs, or among simulation runs."""

from collections.abc import Callable, Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np

from jounce.base.shapes import is_traced, real_numbers
from jounce.errors import JounceError, MechanismError, check_name
from jounce.mechanism import Mechanism
from jounce.trajectory.labels import labels_of_rows


def checked_values(
    parameters: Any,
    item: str,
    check: Callable[[str], None],
    error: type[JounceError] = MechanismError,
) -> dict[str, Any]:
    """Return the values of parameters of many designs or runs, one for each; arrays of JAX if it traces them.

    Parameters
    ----------
    parameters : mapping or table of pandas
        Values by parameter name.
    item : str
        Name of the varied item: design or run.
    check : callable
        Raises if a name is not that of a parameter.
    error : type
        Error to raise if values are not finite, differ in number, or have labels in different orders.
    """
    parameters = by_parameter(parameters, item, error)
    if not parameters:
        raise error("a batch differs in at least one parameter", name="parameters", value=dict(parameters))
    values, count, known_labels = {}, None, []
    for name, given in parameters.items():
        check(name)
        expected, traced = f"a list of finite numbers, one for each {item}", is_traced(given)
        array = jnp.asarray(given, float) if traced else real_numbers(f"parameters.{name}", given, error, expected)
        if array.ndim != 1 or not array.size or not (traced or np.isfinite(array).all()):
            raise error(f"must be {expected}", name=f"parameters.{name}", value=given)
        if count is not None and len(array) != count:
            message = f"must have one value for each {item}, {count} as those before"
            raise error(message, name=f"parameters.{name}", value=len(array))
        labels = labels_of_rows(given)
        if known_labels and labels != known_labels and set(labels) == set(known_labels):
            message = f"has the labels of the parameter before it in another order: give each {item} the same place"
            raise error(message, name=f"parameters.{name}", value=labels[:10])
        values[name], count, known_labels = array, len(array), labels or known_labels
    return values


def by_parameter(parameters: Any, item: str, error: type[JounceError]) -> dict[Any, Any]:
    """Return values by parameter name, from a mapping or from the columns of a pandas table.

    Raises
    ------
    JounceError
        Of the given type, if they are neither, or a column occurs twice.
    """
    if isinstance(parameters, Mapping):
        return dict(parameters)
    if not (hasattr(parameters, "columns") and hasattr(parameters, "iloc")):
        message = f"must be a dict of lists by the name of a parameter, one value for each {item}, or a table of pandas"
        raise error(message, name="parameters", value=parameters)
    names = list(parameters.columns)
    if len(set(names)) < len(names):
        raise error("the table has a column twice", name="parameters", value=", ".join(map(str, names)))
    return {name: parameters[name] for name in names}


def check_parameter(mechanism: Mechanism, name: str) -> None:
    """Raise MechanismError if a mechanism has no such parameter."""
    check_name("parameter", name, mechanism.parameters, MechanismError, name="parameters")
