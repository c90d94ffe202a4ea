"""The regime of all tests: float64, strict promotion of types and ranks; warnings are errors by pyproject.toml."""

import hypothesis
import jax

import jounce  # noqa: F401 - switches on double precision

jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
hypothesis.settings.register_profile("jounce", deadline=None, max_examples=25, derandomize=True)
hypothesis.settings.load_profile("jounce")
