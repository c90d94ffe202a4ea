"""Results of designs, or of simulation runs, as labeled arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from jounce.kinematics.status import Status
from jounce.units.shown_units import component_axes, derivatives_of, time_axes


def labeled_family(
    lane: str,
    title: str,
    described: Mapping[str, Any],
    instants: Float[np.ndarray, " time"],
    order: int,
    values: Mapping[str, np.ndarray],
    outputs: Mapping[str, np.ndarray],
    status: Int[np.ndarray, "lane time"],
    backend: str,
) -> Any:
    """Return the results of designs or runs as an `xarray.Dataset`, with their parameters as coordinates.

    Parameters
    ----------
    lane : str
        Name of the first dimension: design or run.
    title : str
        Title of the dataset; by default, it names the designs or runs.
    described : mapping of str to AbstractOutput or JointCoordinate
        Outputs or joint coordinates, for units, labels and axes.
    instants : numpy.ndarray of shape (time,)
        Time, s.
    order : int
        Highest derivative of the outputs.
    values : mapping of str to numpy.ndarray of shape (lane,)
        Values of the parameters that vary.
    outputs : mapping of str to numpy.ndarray of shape (lane, time, order + 1) or (lane, time, order + 1, component)
        Outputs that were computed.
    status : numpy.ndarray of shape (lane, time)
        Outcomes, see `Status`.
    backend : str
        Backend that computed the numbers.
    """
    import xarray

    coordinates: dict[str, Any] = {lane: np.arange(len(status)), **time_axes(instants, order + 1)}
    variables = {}
    for name, output in described.items():
        series = outputs.get(name)
        if series is None:
            continue
        dims = [lane, "time", "derivative"]
        if series.ndim == 4:
            axes = component_axes(output, series.shape[3])
            series = series.reshape(*series.shape[:3], *map(len, axes.values()))
            coordinates |= axes
            dims += axes
        variables[name] = (dims, series, {"units": output.unit, "long_name": derivatives_of(name)})
    meanings = " ".join(member.name.lower() for member in Status)
    status_attributes = {"long_name": "outcome", "flag_values": list(map(int, Status)), "flag_meanings": meanings}
    variables["status"] = ((lane, "time"), status, status_attributes)
    used_names = {*variables, *coordinates}
    coordinate_names = {name: name if name not in used_names else f"parameter_{name}" for name in values}
    coordinates |= {coordinate_names[name]: (lane, value, {"long_name": name}) for name, value in values.items()}
    attributes = {"title": title or f"{lane}s of a mechanism", "source": "jounce", "backend": backend}
    return xarray.Dataset(variables, coordinates, attributes)
