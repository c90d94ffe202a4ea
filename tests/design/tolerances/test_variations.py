"""What varies and how: forms with units, grids and low-discrepancy sequences, and what is refused."""

import numpy as np
import pytest

import jounce as jn
from jounce.design.tolerances.design_space import Grid, Sobol, sample_space, sobol_shares
from jounce.design.tolerances.variations import (
    Interval,
    Normal,
    Uniform,
    Values,
    named_forms,
    read_variations,
    reader_of,
)
from jounce.errors import JounceError


@pytest.fixture(scope="module")
def four_bar():
    return jn.load("examples/four_bar.yaml")


def read(mechanism, form, name="BC"):
    return read_variations({name: form}, reader_of(mechanism))[name]


def test_forms_have_units_and_may_be_numbers(four_bar):
    assert read(four_bar, "3cm:50 mm:101") == Interval(0.03, 0.05, 101)
    assert read(four_bar, " 0.12 : 16cm ") == Interval(0.12, 0.16)
    assert read(four_bar, "2*AB:0.1") == Interval(0.08, 0.1)
    assert read(four_bar, "normal:0.1mm") == Normal(1e-4)
    assert read(four_bar, "uniform:1 mm") == Uniform(1e-3)
    assert read(four_bar, (0.12, 0.16, 3)) == read(four_bar, "12cm:16cm:3") == Interval(0.12, 0.16, 3)
    assert read(four_bar, [0.1, 0.3, 0.2]).values.tolist() == [0.1, 0.3, 0.2]
    assert read(four_bar, "0.14:0.14:1").values.tolist() == [0.14]


@pytest.mark.parametrize(
    "form, message",
    [
        ("5cm:3cm:4", "lower bound must be below"),
        ((0.2, 0.1), "lower bound must be below"),
        ("3cm:3cm", "lower bound must be below"),
        ("3cm", "must be LOW:HIGH"),
        ("nomal:3cm", "must be LOW:HIGH"),
        ("3cm:5cm:2:1", "must be LOW:HIGH"),
        ("3cm:5cm:1", "one value has one bound"),
        ("3cm:5cm:0", "count must be a whole number"),
        ("3cm:5cm:2.5", "count must be a whole number"),
        ("3cm:5cm:99999999999", "count must be a whole number"),
        ("3cm:5kg:2", "this is a mass, but the parameter is a length"),
        ("normal:0", "spread must be above zero"),
        ("normal:-1mm", "spread must be above zero"),
        ("normal:1mm:2", "must be normal:SIZE"),
        ("nan:1", "finite"),
        ([np.nan], "finite numbers"),
        ([], "finite numbers"),
        ((0.1, True), "finite number"),
        (None, "finite numbers"),
    ],
)
def test_what_is_refused(four_bar, form, message):
    with pytest.raises(JounceError, match=message) as caught:
        read(four_bar, form)
    assert caught.value.name == "vary BC"


def test_names_are_checked_and_given_once(four_bar):
    with pytest.raises(JounceError, match="did you mean 'BC'"):
        read(four_bar, "1:2", "BCC")
    with pytest.raises(JounceError, match="say what varies"):
        read_variations({}, reader_of(four_bar))
    assert named_forms(["BC = 1:2"]) == {"BC": "1:2"}
    for texts, message in ((["BC"], "NAME=FORM"), (["=1:2"], "NAME=FORM"), (["BC=1:2", "BC=1:3"], "more than once")):
        with pytest.raises(JounceError, match=message):
            named_forms(texts)


def test_a_grid_has_every_combination_once_the_last_parameter_fastest():
    grid = Grid({"a": Interval(0.0, 1.0, 3), "b": Values(np.array([5.0, 7.0]))})
    whole = grid.values(0, grid.count)
    assert whole["a"].tolist() == [0.0, 0.0, 0.5, 0.5, 1.0, 1.0]
    assert whole["b"].tolist() == [5.0, 7.0] * 3
    part = grid.values(2, 5)
    assert {name: x.tolist() for name, x in part.items()} == {name: x[2:5].tolist() for name, x in whole.items()}
    with pytest.raises(JounceError, match="LOW:HIGH:COUNT"):
        Grid({"a": Normal(1.0)})
    many = Interval(0.0, 1.0, 10**7)
    with pytest.raises(JounceError, match="at most"):
        Grid({"a": many, "b": many})


@pytest.mark.parametrize("count", [1, 5, 37, 64])
def test_any_stretch_of_a_sobol_sequence_is_that_of_the_whole(count):
    whole = sobol_shares(3, 0, 64)
    assert (sobol_shares(3, 0, count) == whole[:count]).all()
    assert (sobol_shares(3, 7, 7 + count)[: 64 - 7] == whole[7 : 7 + count]).all()


def test_samples_follow_their_distributions():
    space = Sobol({"a": Interval(1.0, 3.0), "b": Normal(0.1), "c": Uniform(0.5)}, {"a": 0.0, "b": 2.0, "c": -1.0}, 4096)
    found = space.values(0, 4096)
    for name, mean, deviation in (("a", 2.0, 2 / 12**0.5), ("b", 2.0, 0.1), ("c", -1.0, 1 / 12**0.5)):
        assert abs(found[name].mean() - mean) < 1e-3 * deviation + 1e-4
        assert abs(found[name].std() / deviation - 1) < 2e-3
        variation = space.variations[name]
        assert abs(variation.deviation() / deviation - 1) < 1e-14
    assert found["a"].min() > 1.0
    assert found["a"].max() < 3.0
    assert np.isfinite(found["b"]).all()


@pytest.mark.parametrize("sample", ["lhs:10", "sobol", "sobol:0", "sobol:1e3", "sobol:99999999999"])
def test_samples_that_are_refused(sample):
    with pytest.raises(JounceError) as caught:
        sample_space({"a": Interval(0.0, 1.0)}, sample, {})
    assert caught.value.name == "sample"


def test_a_sample_is_drawn_from_ranges():
    with pytest.raises(JounceError, match="not a list"):
        sample_space({"a": Interval(0.0, 1.0, 3)}, "sobol:8", {})
