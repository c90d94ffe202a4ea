"""A file with other values of some parameters: nothing else changes, units stay, and it reads back."""

import dataclasses
import pathlib

import numpy as np
import pytest

import jounce as jn
from jounce.errors import OutputError
from jounce.io.mechanisms.revision import with_value, write_revised
from jounce.units.values import parse_value

FOUR_BAR = pathlib.Path("examples/four_bar.yaml")


@pytest.mark.parametrize("unit", ["mm", "cm", "m", "in", "kN", "kg*m^2"])
def test_a_value_reads_back_to_the_bit_in_its_unit(unit):
    generator = np.random.default_rng(0)
    for value in (generator.normal(size=50) * 10.0 ** generator.uniform(-4, 4, 50)).tolist():
        text = with_value(f"1.5 {unit}", value)
        assert text.endswith(f" {unit}")
        assert parse_value(text).value == value


def test_an_angle_stays_one_in_degrees():
    for value in np.random.default_rng(1).normal(size=50).tolist():
        assert parse_value(with_value("30 deg", value)).value == pytest.approx(value, rel=4e-16)
        assert with_value("30*deg", value).endswith("*deg")
    assert with_value("2*AB", 0.5) == 0.5


def test_all_else_of_a_file_stays_as_it_is(tmp_path):
    changed = jn.load(FOUR_BAR).with_parameters(BC=0.1375, tau=3.0)
    path = tmp_path / "better.yaml"
    write_revised(changed, ["BC", "tau"], FOUR_BAR, path)
    expected = FOUR_BAR.read_text().replace("BC: 14.23 cm", "BC: 13.75 cm").replace("tau: 2 s", "tau: 3 s")
    assert path.read_text() == expected
    assert jn.load(path) == changed


@pytest.mark.parametrize("suffix", [".yaml", ".toml", ".json"])
def test_every_format_takes_values_and_an_assembly(tmp_path, suffix):
    original, path = tmp_path / f"first{suffix}", tmp_path / f"second{suffix}"
    jn.write_mechanism(jn.load(FOUR_BAR), original)
    text = original.read_text()
    if suffix == ".toml":
        original.write_text(f"# of a friend\n{text}")
    changed = dataclasses.replace(jn.load(original).with_parameters(BC=0.1375), assembly=2)
    write_revised(changed, ["BC"], original, path)
    assert jn.load(path) == changed
    again = dataclasses.replace(changed, assembly=1)
    write_revised(again, ["BC"], path, tmp_path / f"third{suffix}")
    assert jn.load(tmp_path / f"third{suffix}") == again


def test_nothing_is_written_over_the_input_or_in_another_format(tmp_path):
    path = tmp_path / "input.yaml"
    path.write_text(FOUR_BAR.read_text())
    mechanism = jn.load(path).with_parameters(BC=0.13)
    with pytest.raises(OutputError, match="--overwrite"):
        write_revised(mechanism, ["BC"], path, path)
    with pytest.raises(OutputError, match="of the format of"):
        write_revised(mechanism, ["BC"], path, tmp_path / "out.toml")
    assert path.read_text() == FOUR_BAR.read_text()
    write_revised(mechanism, ["BC"], path, path, overwrite=True)
    assert jn.load(path).parameters["BC"] == 0.13
