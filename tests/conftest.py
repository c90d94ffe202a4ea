"""The regime of all tests: float64, strict promotion of types and ranks; warnings are errors by pyproject.toml."""

import hypothesis
import jax
import pytest

from jounce.constraints import base  # importing jounce switches on double precision

jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
hypothesis.settings.register_profile("jounce", deadline=None, max_examples=15, derandomize=True)
hypothesis.settings.load_profile("jounce")


@pytest.fixture(autouse=True)
def _own_catalogue():
    """Forget the joints that a test defines, or the next test finds them in the catalogue."""
    before = {key: dict(types) for key, types in base._REGISTRY.items()}
    yield
    base._REGISTRY.clear()
    base._REGISTRY.update(before)
