"""The device that runs programs: a processor, whose cache batches must fit, or a GPU, which batches must fill."""

from typing import Any, TypeVar

import jax

from jounce.settings import under_own_settings

T = TypeVar("T")


@under_own_settings
def on_processor() -> bool:
    """Return whether JAX computes on the processor: its default device if one is chosen, otherwise its first backend.

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
    """Return shared arguments of many programs on their device; a processor reads NumPy arrays without a transfer."""
    return arrays if on_processor() else jax.device_put(arrays)
