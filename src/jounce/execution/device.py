"""What programs run on: a processor, whose cache their batches have to fit, or a GPU, which they have to fill."""

from typing import Any, TypeVar

import jax

from jounce.settings import under_own_settings

T = TypeVar("T")


@under_own_settings
def on_processor() -> bool:
    """Tell whether JAX computes on the processor: its default device where one is chosen, else its first backend.

    Examples
    --------
    >>> import jax
    >>> from jounce.execution.device import on_processor
    >>> with jax.default_device(jax.devices("cpu")[0]):
    ...     on_processor()
    True
    """
    return device_name() == "cpu"


def device_name() -> str:
    """Return the name of the kind of device that JAX computes on."""
    chosen: Any = getattr(jax.config, "jax_default_device", None)
    return str(getattr(chosen, "platform", chosen) or jax.default_backend())


def resident(arrays: T) -> T:
    """Return arrays that many programs take, where they are computed: a processor reads those of NumPy as they are."""
    return arrays if on_processor() else jax.device_put(arrays)
