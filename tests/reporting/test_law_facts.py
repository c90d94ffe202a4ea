"""To which derivative laws are continuous, in words."""

import pytest

import jounce as jn
from jounce.reporting.law_facts import jump_facts, law_words


@pytest.mark.parametrize("power", [0.5, 2.5])
def test_derivatives_that_are_infinite_or_none_are_told(power):
    told = jn.continuity(jn.PiecewiseMotion(["0", f"(t-1)**{power}"], until=[1.0]), 0.0, 2.0, order=1)
    law = {"of": "ram", "unit": "m", "continuous_to": told.smoothness, "remark": ""}
    (words,) = law_words([{**law, "derivatives": jump_facts(told)}])
    assert words.startswith("law of ram: continuous to position; ")
    assert all(word in words for word in ("velocity", "no finite value", "1 s"))
