"""Ratios of gear trains, as `jounce inspect` tells them, by the formulas of Willis."""

import pytest

import jounce as jn
from jounce.mechanism import build
from jounce.reporting.facts.mechanism.freedom_facts import StartingState
from jounce.reporting.facts.mechanism.gear_facts import train_facts


def ratios(mechanism):
    """Return the fractions told, by driver and body."""
    facts = train_facts(StartingState(mechanism, build(mechanism), 0.0))
    return {(x["driver"], x["body"]): x["fraction"] for x in facts}


@pytest.mark.slow
def test_a_bevel_differential_on_an_axle_that_leans():
    """The mean of both half shafts is the cage, 11/41 of the drive shaft; 16/10 of the rest is the pinion."""
    assert ratios(jn.load("examples/bevel_differential.yaml")) == {
        ("bump", "axle"): "1",
        ("bump", "drive"): "1",
        ("motor", "drive"): "1",
        ("motor", "cage"): "11/41",
        ("motor", "left"): "11/41",
        ("motor", "right"): "11/41",
        ("steer", "spider"): "8/5",
        ("steer", "left"): "1",
        ("steer", "right"): "-1",
    }


def test_what_carries_planets_is_reported():
    """24/(24 + 84) of the sun, and planets that turn by (1 + 24/30) 2/9 - 24/30 in all."""
    fractions = ratios(jn.load("examples/planetary_train.yaml"))
    assert fractions["motor", "carrier"] == "2/9"
    assert fractions["motor", "planet3"] == "-2/5"
