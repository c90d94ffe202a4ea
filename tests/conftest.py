"""The regime of all tests: float64, strict promotion of types and ranks, warnings as errors (in pyproject.toml)."""

import hypothesis
import jax
import pytest

import jounce  # noqa: F401 - switches on double precision

hypothesis.settings.register_profile("jounce", deadline=None, print_blob=True, max_examples=50)
hypothesis.settings.load_profile("jounce")


@pytest.fixture(autouse=True)
def _strict_jax():
    """Make mixtures of types or ranks that the library did not say aloud fail."""
    with jax.numpy_dtype_promotion("strict"), jax.numpy_rank_promotion("raise"):
        yield
