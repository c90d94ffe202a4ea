"""Proved paths beside closed forms, of which the sign of the root is the branch, and beside mpmath."""

import mpmath
import numpy as np
import pytest

from tests.oracles.linkage_paths import Law, derivatives, driven, follow, full, polished, rounding
from tests.problems.branch_study import FAMILIES
from tests.problems.linkages import FourBar

CLOSED = [name for name in FAMILIES if name not in ("Stephenson III at the link", "Stephenson II")]
TRIADS = ["Stephenson III at the link", "Stephenson II"]


class Sides:
    """Chooses given sides of dyads in turn, in place of a random generator."""

    def __init__(self, *sides):
        self.sides = list(sides)

    def choice(self, _):
        return self.sides.pop(0)


def paths(family, count, instants=41, seed=5):
    """Return random linkages, the driven values that they visit, and their paths."""
    drawn = [family.linkage(np.random.default_rng([seed, k]), near=k % 2 == 0) for k in range(count)]
    linkages, values = [linkage for linkage, _ in drawn], []
    for linkage, stop in drawn:
        turning = linkage.law.turning_times(stop)
        values.append(linkage.law(np.sort(np.concatenate([np.linspace(0, stop, instants), turning]))))
    forms = np.stack([linkage.tracked_form for linkage in linkages])
    starts = np.stack([linkage.start[: forms.shape[1]] for linkage in linkages])
    return linkages, values, follow(forms, family.circular, starts, values)


def assembly(linkage, value, sides):
    position = linkage.family.assembly(linkage.values, np.asarray(value), Sides(*sides))
    return None if position is None else position[: len(linkage.tracked_form)]


def sides_of(linkage):
    """Return the sides that give the start of a linkage."""
    for sides in [(1, 1), (1, -1), (-1, 1), (-1, -1)]:
        position = assembly(linkage, linkage.law(0.0), sides)
        if position is not None and np.abs(position - linkage.start[: len(position)]).max() < 1e-9:
            return sides
    raise AssertionError("no assembly is the start")


@pytest.mark.slow
@pytest.mark.parametrize("name", CLOSED)
def test_paths_keep_the_sign_of_the_closed_form_and_end_where_it_does(name):
    linkages, values, path = paths(FAMILIES[name], 16)
    compared, ended = 0, 0
    for k, linkage in enumerate(linkages):
        sides = sides_of(linkage)
        for value, position, determinant in zip(values[k], path.position[k], path.determinant[k], strict=False):
            if np.isfinite(position).all():
                np.testing.assert_allclose(
                    position, assembly(linkage, value, sides), rtol=0, atol=1e-10 + 1e-12 / abs(determinant)
                )
                compared += 1
        if np.isfinite(path.limit[k]) and path.proved[k]:
            after = values[k][np.isfinite(path.position[k, : len(values[k]), 0]).sum()]
            ahead = np.sign(after - path.limit[k])
            assert assembly(linkage, path.limit[k] - 1e-7 * ahead, sides) is not None
            assert assembly(linkage, path.limit[k] + 1e-7 * ahead, sides) is None
            ended += 1
    assert compared > 100
    assert ended >= 2


@pytest.mark.slow
@pytest.mark.parametrize("name", TRIADS)
def test_paths_of_triads_are_those_of_tiny_steps(name):
    linkages, values, path = paths(FAMILIES[name], 10)
    compared = 0
    for k, linkage in enumerate(linkages):
        reached = np.isfinite(path.position[k, : len(values[k]), 0])
        if path.margin[k][: reached.sum()].min() < 0.05:
            continue
        x, form = linkage.start[None], linkage.form[None]
        for before, after in zip(values[k][reached][:-1], values[k][reached][1:], strict=True):
            for value in np.linspace(before, after, 2 + int(abs(after - before) / 2e-3))[1:]:
                x, size = polished(form, True, x, np.array([value]), 6)
                assert size[0] < 1e-12
        np.testing.assert_allclose(x[0], path.position[k][reached.sum() - 1], atol=1e-9)
        compared += 1
    assert compared >= 2


@pytest.mark.slow
@pytest.mark.parametrize("name", FAMILIES)
def test_positions_are_roots_in_forty_digits(name):
    family = FAMILIES[name]
    linkages, values, path = paths(family, 6, instants=9)
    for k, linkage in enumerate(linkages):
        last = np.isfinite(path.position[k, : len(values[k]), 0]).sum() - 1
        value, form = values[k][last], linkage.tracked_form
        position = path.position[k, last]
        with mpmath.workdps(40):
            matrices = [mpmath.matrix(part.tolist()) for part in form]
            u = [mpmath.cos(value), mpmath.sin(value)] if family.circular else [mpmath.mpf(value), mpmath.mpf(0)]

            def equations(*x, matrices=matrices, u=u):
                z = mpmath.matrix([*x, *u, 1])
                return [(z.T * m * z)[0] for m in matrices]

            exact = np.array(mpmath.findroot(equations, position.tolist(), maxsteps=40), dtype=object).ravel()
        allowed = rounding(form[None], family.circular, position[None], np.array([value]))[0]
        assert (np.abs(np.array(exact - position, dtype=float)) <= 1e-14 * allowed).all()


def test_derivatives_of_a_four_bar_are_those_of_its_closed_form():
    family, values = FourBar(), {"a": 0.4, "b": 1.1, "c": 0.9, "d": 1.2}
    law = Law(0.3, 0.0, 1.3, 2.1, 0.4)
    form, time = np.stack(family.forms(values)), np.array([0.0, 0.7])
    start = np.stack([family.assembly(values, law(t), Sides(1)) for t in time])
    found = derivatives(form, True, law, time, start, 5)

    def rocker_tip(t, component):
        angle = law.start + law.wave * mpmath.sin(law.speed * t + law.phase)
        p, q = values["a"] * mpmath.expj(angle), mpmath.mpf(values["d"])
        square = abs(q - p) ** 2
        along = (square + values["b"] ** 2 - values["c"] ** 2) / (2 * square)
        tip = p + (q - p) * (along + 1j * mpmath.sqrt(values["b"] ** 2 / square - along**2))
        return (tip.real, tip.imag)[component]

    with mpmath.workdps(40):
        for k, t in enumerate(time):
            for c in range(2):
                expected = mpmath.taylor(lambda s, c=c: rocker_tip(s, c), t, 5)
                expected = [float(term * mpmath.factorial(n)) for n, term in enumerate(expected)]
                np.testing.assert_allclose(found[k, :, c], expected, rtol=1e-11, atol=1e-11)


@pytest.mark.slow
def test_a_start_is_where_the_equations_hold():
    for name, family in FAMILIES.items():
        for k in range(3):
            linkage, _ = family.linkage(np.random.default_rng([6, k]), near=True)
            z = full(linkage.start, driven(np.asarray(linkage.law(0.0)), family.circular)[0])
            residual = np.einsum("ijk,j,k->i", linkage.form, z, z)
            assert np.abs(residual).max() < 1e-13 * (1 + np.abs(z).max() ** 2), name
