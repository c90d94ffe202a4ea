"""The options of JAX under which this package computes."""

from typing import Any

OPTIONS: dict[str, Any] = {
    "jax_enable_x64": True,
    # Nonfinite numbers occur in cases that do not apply, and mark missing results.
    "jax_debug_nans": False,
    "jax_debug_infs": False,
    # Without compilation a solution takes minutes.
    "jax_disable_jit": False,
    "jax_default_matmul_precision": None,
    # Each call transfers numbers to the device and back.
    "jax_transfer_guard_host_to_device": "allow",
    "jax_transfer_guard_device_to_device": "allow",
    "jax_transfer_guard_device_to_host": "allow",
}
"""Options that would change results or stop a computation, with their values during computations."""
