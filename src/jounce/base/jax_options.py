"""The options of JAX under which this package computes, by the names that JAX gives them."""

from typing import Any

OPTIONS: dict[str, Any] = {
    "jax_enable_x64": True,
    # Numbers that are not finite are used where a case does not apply, and results say where there are none.
    "jax_debug_nans": False,
    "jax_debug_infs": False,
    # One operation after another, a solution takes minutes.
    "jax_disable_jit": False,
    "jax_default_matmul_precision": None,
    # Numbers go to the device with each call, and come back.
    "jax_transfer_guard_host_to_device": "allow",
    "jax_transfer_guard_device_to_device": "allow",
    "jax_transfer_guard_device_to_host": "allow",
}
"""Those that would change results, or stop a computation, each with the value that it has meanwhile."""
