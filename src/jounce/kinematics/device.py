"""What programs run on: a processor, whose cache their batches have to fit, or a GPU, which they have to fill."""

import jax


def on_processor() -> bool:
    """Tell whether JAX computes on the processor: its default device where one is chosen, else its first backend.

    Examples
    --------
    >>> import jax
    >>> from jounce.kinematics.device import on_processor
    >>> with jax.default_device(jax.devices("cpu")[0]):
    ...     on_processor()
    True
    """
    chosen = getattr(jax.config, "jax_default_device", None)
    return (getattr(chosen, "platform", chosen) or jax.default_backend()) == "cpu"
