"""Arrays by name, each computed at its first request."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import jax
import numpy as np

from jounce.errors import did_you_mean, show_value
from jounce.settings import under_own_settings


class OnDemand(Mapping[str, Any]):
    """A mapping whose values are computed at their first request and cached. For JAX it is a pytree of all values.

    Parameters
    ----------
    names : iterable of str
        Names in their order.
    compute : callable
        Function from a name to its value and others that are computed with it, by name.
    known : dict, optional
        Cache of the values.

    Examples
    --------
    >>> from jounce.execution.on_demand import OnDemand
    >>> doubles = OnDemand("abc", lambda name: {name: 2 * name})
    >>> doubles["b"], list(doubles), len(doubles)
    ('bb', ['a', 'b', 'c'], 3)
    """

    def __init__(
        self, names: Iterable[str], compute: Callable[[str], Mapping[str, Any]], known: dict[str, Any] | None = None
    ):
        self._names, self._compute = dict.fromkeys(names), compute
        self._known = {} if known is None else known

    @under_own_settings
    def __getitem__(self, name: str) -> Any:
        """Return the value of a name."""
        if name not in self._known:
            if name not in self._names:
                raise KeyError(f"{show_value(name)}; {did_you_mean(name, self._names)}")
            self._known.update(self._compute(name))
        return self._known[name]

    def __contains__(self, name: object) -> bool:
        """Return whether a name is in the mapping; nothing is computed."""
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._names)

    def __len__(self) -> int:
        """Return the number of names."""
        return len(self._names)

    def __repr__(self) -> str:
        """Show all values, as a dictionary does."""
        return repr(dict(self))


def read_only_arrays(arrays: dict[str, Any]) -> dict[str, Any]:
    """Make NumPy arrays read-only, as they are views of shared arrays; JAX arrays are read-only anyway."""
    for array in arrays.values():
        if isinstance(array, np.ndarray):
            array.setflags(write=False)
    return arrays


def _of_values(names: tuple[str, ...], values: Iterable[Any]) -> OnDemand:
    by_name = dict(zip(names, values, strict=True))
    return OnDemand(names, lambda _: by_name)


jax.tree_util.register_pytree_node(OnDemand, lambda tree: (tuple(tree.values()), tuple(tree)), _of_values)
