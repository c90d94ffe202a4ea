"""LaTeX of the joints of Sommer 2024, read as numbers and compared with the equations of the paper."""

import jax.numpy as jnp
import numpy as np
import pytest

import jounce as jn
from jounce.constraints.angles import perpendiculars
from jounce.errors import MechanismError
from jounce.mechanism import build
from jounce.settings import under_own_settings
from jounce.written_equations.joint_forms.axial_forms import axial_equations, is_axial
from jounce.written_equations.joint_forms.latex import joint_equations, source_of
from jounce.written_equations.joint_forms.symbolic_joint import symbolic_joint
from tests.oracles import sommer_planar as plane, sommer_spatial as space
from tests.problems.mechanisms import example
from tests.problems.reading_latex import Reader, assert_well_formed
from tests.problems.written import between_free_bodies

DOTS = ("", r"\dot", r"\ddot", r"\dddot", r"\ddddot")
SIDES = (r"\mathbf{v}", r"\boldsymbol{\gamma}", r"\boldsymbol{\eta}", r"\boldsymbol{\sigma}")
PLANAR, SPATIAL = jn.planar, jn.spatial
S_I, S_J, A_I, A_J = np.array([[0.3, -0.7], [-0.4, 0.2], [0.8, 0.5], [-0.6, 0.9]])
P_I, P_J, U_I, U_J = np.array([[0.3, -0.7, 0.2], [-0.4, 0.2, 0.5], [0.8, 0.5, -0.3], [-0.6, 0.9, 0.4]])
LENGTH, RATIO, OFFSET, RADIUS = 0.7, -0.45, 0.21, 0.37
F = np.array([0.9, 0.4, -0.3, 0.25, 0.15])


def dotted(symbol, index, n):
    return f"{DOTS[n]}{{{symbol}}}{index}" if n else symbol + index


def common():
    laws = {"f": F[0]} | {f"f_{{{'t' * n}}}": F[n] for n in range(1, 5)}
    return laws | {"L": LENGTH, "K": RATIO, "C": OFFSET, r"\rho": RADIUS}


def column(values):
    return np.asarray(values, float)[:, None]


def in_plane(bodies):
    i, j, _ = bodies
    symbols = common() | {r"\mathbf{R}": plane.R, r"\mathbf{I}_2": np.eye(2)}
    for name, body, s, a in zip("ijm", bodies, (S_I, S_J, S_I), (A_I, A_J, A_I), strict=True):
        A, _, B = plane.equation_009(body.phi[0])
        symbols |= {dotted(r"\phi", f"_{name}", n): body.phi[n] for n in range(5)}
        symbols |= {rf"\mathbf{{A}}_{name}": A, rf"\mathbf{{B}}_{name}": B, rf"\mathbf{{a}}_{name}": column(A @ a)}
        symbols |= {rf"\mathbf{{s}}_{name}'^{{P}}": column(s), rf"\mathbf{{a}}_{name}'": column(a)}
    relative = [
        e(i, j, S_I, S_J) for e in (plane.equation_015, plane.equation_016, plane.equation_017, plane.equation_018)
    ]
    symbols |= {dotted(r"\mathbf{d}", "_{ij}", n): column(d) for n, d in enumerate(relative)}
    sides = (plane.equation_023, plane.equation_024, plane.equation_025)
    return symbols | {f"{SIDES[n]}^{{r}}": column(e(i, j, S_I, S_J)) for n, e in enumerate(sides, 1)}


def in_space(bodies):
    i, j = bodies
    symbols = common() | {r"\mathbf{I}_3": np.eye(3)}
    for name, body, s, a in zip("ij", bodies, (P_I, P_J), (U_I, U_J), strict=True):
        skew = space.equation_060
        symbols |= {dotted(r"\tilde{\boldsymbol{\omega}}", f"_{name}'", n): skew(body.w[n]) for n in range(4)}
        symbols |= {
            rf"\mathbf{{H}}_{name}'": space.equation_063(body),
            rf"\mathbf{{W}}_{name}'": space.equation_065(body),
        }
        symbols |= {rf"\mathbf{{A}}_{name}": body.A, rf"\mathbf{{a}}_{name}": column(body.A @ a)}
        symbols |= {rf"\mathbf{{s}}_{name}'^{{P}}": column(s), rf"\mathbf{{a}}_{name}'": column(a)}
        for letter, x in zip("fg", perpendiculars(U_I[:, None]), strict=True):  # of the axis of body i
            local = np.asarray(x)[:, 0]
            symbols |= {rf"\mathbf{{{letter}}}_{name}": column(body.A @ local)}
            symbols |= {rf"\mathbf{{{letter}}}_{name}'": column(local)}
            symbols |= {rf"\tilde{{\mathbf{{{letter}}}}}_{name}'": skew(local)}
        symbols |= {rf"\mathbf{{u}}_{name}": column(body.A @ a), rf"\mathbf{{u}}_{name}'": column(a)}
        symbols |= {rf"\tilde{{\mathbf{{u}}}}_{name}'": skew(a)}
        symbols |= {rf"\tilde{{\mathbf{{s}}}}_{name}'^{{P}}": skew(s), rf"\tilde{{\mathbf{{a}}}}_{name}'": skew(a)}
    relative = [
        e(i, j, P_I, P_J) for e in (space.equation_067, space.equation_068, space.equation_069, space.equation_070)
    ]
    symbols |= {dotted(r"\mathbf{d}", "_{ij}", n): column(d) for n, d in enumerate(relative)}
    sides = (space.equation_080, space.equation_081, space.equation_082)
    return symbols | {f"{SIDES[n]}^{{s}}": column(e(i, j, P_I, P_J)) for n, e in enumerate(sides, 1)}


def random_bodies(spatial):
    random = np.random.default_rng(5)
    found = []
    for _ in range(2 if spatial else 3):
        if spatial:
            q, _ = np.linalg.qr(random.normal(size=(3, 3)))
            found.append(space.Body(random.normal(size=(5, 3)), q * np.linalg.det(q), random.normal(size=(4, 3))))
        else:
            found.append(plane.Body(random.normal(size=(5, 2)), random.normal(size=5)))
    return found


@under_own_settings
def equations_of(element, joint_space, order=4):
    model = build(between_free_bodies(element, joint_space))
    return joint_equations(symbolic_joint(model.system.groups[0], model.pose_type, order))


def numbers(pairs, symbols, slots, shifts):
    """Return residual, blocks of the Jacobian, and right sides of each equation, read off the text."""
    residuals, sides, blocks = [], [], []
    for left, right in pairs:
        if left.startswith(r"\Phi_{q"):
            r, turn = Reader(right, symbols).blocks()
            blocks.append((left[7], r, turn))
        elif left.startswith(r"\Phi"):
            residuals.append(np.ravel(Reader(right, symbols).whole()))
        elif "^" not in left:
            sides.append(np.ravel(Reader(right, symbols).whole()))
        else:
            np.testing.assert_allclose(Reader(right, symbols).whole(), symbols[left], atol=1e-13)
    jacobian = {}
    for slot, r, turn in blocks:
        rows = max(len(part) if np.ndim(part) == 2 else 1 for part in (r, turn))
        turns = 3 if shifts == 3 else 1
        whole = np.hstack([np.broadcast_to(r, (rows, shifts)), np.broadcast_to(turn, (rows, turns))])
        jacobian.setdefault(slot, []).append(whole)
    jacobian = [np.vstack(jacobian[slot]) for slot in slots]
    sides = [np.concatenate(sides[n::4]) for n in range(4)]
    return np.concatenate(residuals), jacobian, sides


BODIES = ("one", "two")


def planar_cases():
    i, j, m = random_bodies(spatial=False)
    e = plane
    pin, points, line = (i, j, S_I, S_J), (BODIES, S_I, S_J), (i, j, S_I, S_J, A_I)
    zero = np.zeros(2)
    apart = (i, j, A_I, A_J)
    along = (e.equation_036(*line), e.equation_037(*line), e.equation_038(*line))
    together = [np.r_[a, b] for a, b in zip(e.equation_033_anywhere(*apart), along, strict=True)]
    return {
        "21-25": (PLANAR.Revolute(*points), e.equation_021(*pin), e.equation_022(*pin),
                  (zero, e.equation_023(*pin), e.equation_024(*pin), e.equation_025(*pin))),
        "26-30": (PLANAR.DoubleRevolute(*points, LENGTH), e.equation_026(*pin, LENGTH), e.equation_027(*pin),
                  (0, e.equation_028(*pin), e.equation_029(*pin), e.equation_030(*pin))),
        "31-33": (PLANAR.Parallel1(BODIES, A_I, A_J), e.equation_031(*apart), e.equation_032(*apart),
                  (0, *e.equation_033_anywhere(*apart))),
        "34-38": (PLANAR.Parallel2(*points, A_I), e.equation_034(*line), e.equation_035(*line),
                  (0, e.equation_036(*line), e.equation_037(*line), e.equation_038(*line))),
        "31-38": (PLANAR.Prismatic(*points, A_I, A_J), np.r_[e.equation_031(*apart), e.equation_034(*line)],
                  [np.vstack(x) for x in zip(e.equation_032(*apart), e.equation_035(*line), strict=True)],
                  (zero, *together)),
        "39-40": (jn.drivers.CoordinateDriver(BODIES, "angle", "t", RATIO, OFFSET),
                  e.equation_039(i, j, RATIO, OFFSET, F), (np.r_[0, 0, -RATIO], np.r_[0, 0, 1]), F[1:]),
        "41-43": (PLANAR.Gear((*BODIES, "three"), ratio=RATIO, offset=OFFSET), e.equation_041(i, j, m, RATIO, OFFSET),
                  e.equation_042(RATIO), e.equation_043()),
        "44-49": (jn.drivers.SlideDriver(*points, A_I, "t"), e.equation_044(*line, F), e.equation_045(*line),
                  (e.equation_046(F), e.equation_047(*line, F), e.equation_048(*line, F), e.equation_049(*line, F))),
        "50-52": (PLANAR.Rolling(*points, A_I, RADIUS, OFFSET), e.equation_050(*line, RADIUS, OFFSET),
                  e.equation_051(*line, RADIUS), e.equation_052(*line)),
        "53-55": (jn.drivers.DistanceDriver(*points, "t"), e.equation_053(*pin, F), e.equation_054(*pin),
                  e.equation_055(*pin, F)),
    }  # fmt: skip


def hinge(element, i, j, ball, blocks):
    """Return a revolute of section 5, as section 6 has it: spherical, and two dot-1 across the axis of body i."""
    e = space
    side, other = (np.asarray(x) for x in perpendiculars(U_I[:, None]))
    pairs = [(i, j, x[:, 0], U_J) for x in (side, other)]
    parts = [blocks(e.equation_078(), e.equation_079(*ball))]
    parts += [blocks(e.equation_090(), e.equation_091(*pair)) for pair in pairs]
    sides = [np.zeros(5)]
    for ball_side, arm in zip(("080", "081", "082"), ("092", "093", "094"), strict=True):
        first = getattr(e, f"equation_{ball_side}")(*ball)
        sides.append(np.r_[first, [getattr(e, f"equation_{arm}")(*pair) for pair in pairs]])
    residual = np.r_[e.equation_077(*ball), [e.equation_089(*pair) for pair in pairs]]
    return element, residual, [np.vstack(x) for x in zip(*parts, strict=True)], sides


def spatial_cases():
    i, j = random_bodies(spatial=True)
    e = space
    ball, points, plate, arms = (i, j, P_I, P_J), (BODIES, P_I, P_J), (i, j, P_I, P_J, U_I), (i, j, U_I, U_J)

    def blocks(shifts, turns):
        rows = [np.atleast_2d(x) for x in (*shifts, *turns)]
        return np.hstack(rows[::2]), np.hstack(rows[1::2])

    side = (e.equation_080(*ball), e.equation_081(*ball), e.equation_082(*ball))
    arm = (e.equation_092(*arms), e.equation_093(*arms), e.equation_094(*arms))
    return {
        "77-82": (SPATIAL.Spherical(*points), e.equation_077(*ball), blocks(e.equation_078(), e.equation_079(*ball)),
                  (np.zeros(3), *side)),
        "83-88": (SPATIAL.DoubleSpherical(*points, LENGTH), e.equation_083(*ball, LENGTH),
                  blocks(e.equation_084(*ball), e.equation_085(*ball)),
                  (0, e.equation_086(*ball), e.equation_087(*ball), e.equation_088(*ball))),
        "89-94": (SPATIAL.Dot1(BODIES, U_I, U_J), e.equation_089(*arms),
                  blocks(e.equation_090(), e.equation_091(*arms)), (0, *arm)),
        "95-100": (SPATIAL.Dot2(*points, U_I), e.equation_095(*plate),
                   blocks(e.equation_096(i, U_I), e.equation_097(*plate)),
                   (0, e.equation_098(*plate), e.equation_099(*plate), e.equation_100(*plate))),
        "104-107": (jn.drivers.SpatialDistanceDriver(*points, "t"), e.equation_104(*ball, F),
                    blocks(e.equation_105(*ball), e.equation_106(*ball)), e.equation_107(*ball, F)),
        "108-111": (jn.drivers.SpatialSlideDriver(*points, U_I, "t"), e.equation_108(*plate, F),
                    blocks(e.equation_109(i, U_I), e.equation_110(*plate)), e.equation_111(*plate, F)),
        "revolute": hinge(SPATIAL.Revolute(*points, U_I, U_J), i, j, ball, blocks),
        "universal": (SPATIAL.Universal(*points, U_I, U_J), np.r_[e.equation_077(*ball), e.equation_089(*arms)],
                      [np.vstack(x) for x in zip(blocks(e.equation_078(), e.equation_079(*ball)),
                                                 blocks(e.equation_090(), e.equation_091(*arms)), strict=True)],
                      (np.zeros(4), *(np.r_[s, a] for s, a in zip(side, arm, strict=True)))),
    }  # fmt: skip


PLANE_CASES, SPACE_CASES = planar_cases(), spatial_cases()


@pytest.mark.parametrize("case", [*PLANE_CASES, *SPACE_CASES])
def test_printed_equations_are_those_of_the_paper(case):
    spatial = case in SPACE_CASES
    element, residual, jacobian, sides = (SPACE_CASES if spatial else PLANE_CASES)[case]
    bodies = random_bodies(spatial)
    symbols = in_space(bodies) if spatial else in_plane(bodies)
    pairs = equations_of(element, "spatial" if spatial else "planar")
    slots, shifts = "ijm"[: len(element.bodies)], 3 if spatial else 2
    rows = len(np.ravel(residual))
    found = numbers(pairs, symbols, slots, shifts)
    np.testing.assert_allclose(found[0], np.ravel(residual), atol=1e-13)
    for block, expected in zip(found[1], jacobian, strict=True):
        np.testing.assert_allclose(block, np.reshape(expected, (rows, -1)), atol=1e-13)
    for side, expected in zip(found[2], sides, strict=True):
        if not np.any(expected):
            assert not np.any(side)
            continue
        np.testing.assert_allclose(side, np.ravel(expected), atol=1e-12)
    if case[0].isdigit():
        first, last = case.split("-")
        assert source_of(type(element)).startswith(f"equations {first}") or case in ("31-38",), last


def test_the_double_revolute_reads_as_it_is_printed():
    found = dict(equations_of(PLANAR.DoubleRevolute(BODIES, S_I, S_J, LENGTH), "planar"))
    d, v, gamma = r"\mathbf{d}_{ij}", r"\dot{\mathbf{d}}_{ij}", r"\boldsymbol{\gamma}"
    assert found[r"\Phi"] == rf"{d}^T {d} - L^{{2}}"
    assert found[gamma] == f"2 {d}^T {gamma}^{{r}} - 2 {v}^T {v}"


@pytest.mark.parametrize("vectors", [{}, {"vector_i": [0, 0, 1.0], "vector_j": [1.0, 0, 0.2]}])
def test_the_rotation_driver_reads_as_101_to_103_are_printed(vectors):
    """But for the sign of the angle, which S 101 loses."""
    element = jn.drivers.RotationDriver(BODIES, [1.0, 0.2, 0.0], "t", **vectors)
    group = build(between_free_bodies(element, "spatial")).system.groups[0]
    assert is_axial(group)
    found = dict(axial_equations(group, 4))
    assert found[r"\Phi"] == r"\theta - f"
    axis = r"\hat{\mathbf{u}}^T"
    along = rf"{axis} \tilde{{\mathbf{{a}}}}_i \mathbf{{a}}_j, \mathbf{{a}}_i^T \mathbf{{a}}_j"
    inside = along if vectors else rf"{axis} \mathbf{{e}}, e_{{0}}"
    assert found[r"\theta"] == rf"{'' if vectors else '2 '}\operatorname{{atan2}}\left( {inside} \right)"
    assert found[r"\Phi_{qj}"] == rf"\left[ \mathbf{{0}}, {axis} \right]"
    assert [found[side] for side in SIDES] == ["f_{t}", "f_{tt}", "f_{ttt}", "f_{tttt}"]


class Steps(jn.joints.AbstractConstraint):
    """Of what is rounded."""

    point_j: jn.joints.Vector

    def residual(self, body_i, body_j, time):
        d = body_j.point(self.point_j) - body_i.position
        step = jnp.round(d[0].coefficients[0]) + jnp.floor(d[1].coefficients[0])
        return d[1] - jn.jet.Jet.constant(step, d.order)


def test_what_is_rounded_is_written():
    found = dict(equations_of(Steps(BODIES, S_J), "planar", order=2))
    assert r"- \operatorname{round}\left( x_j" in found[r"\Phi"]
    assert r"- \operatorname{floor}\left( y_j" in found[r"\Phi"]


class Tilted(jn.joints.AbstractConstraint):
    def residual(self, body_i, body_j, time):
        d = body_j.position - body_i.position
        return jn.jet.atan2(d[1], d[0]) - body_j.angle


def test_an_angle_of_a_line_is_refused_by_name():
    mechanism = between_free_bodies(Tilted(BODIES), "planar")
    with pytest.raises(MechanismError, match=r"^it: cannot be written out: it takes a function of \d+ long terms"):
        jn.equations(mechanism, "it", format="latex")
    assert "Omitted, because it is too long to read" in jn.equations(mechanism, format="latex")


def test_what_nobody_would_read_is_left_out_within_seconds():
    text = jn.equations(jn.load(example("belt_drive")), format="latex")
    assert_well_formed(text)
    assert "Omitted, because it is too long to read: it takes a function of" in text
    with pytest.raises(MechanismError, match=r"^belt\w*: cannot be written out: it takes a function of"):
        jn.equations(jn.load(example("belt_drive")), "belt", format="latex")


def test_documents_of_mechanisms(tmp_path):
    text = jn.equations(jn.load(example("four_bar")), format="latex")
    assert_well_formed(text)
    assert r"\subsection*{double revolute (S equations 26-30)}" in text
    assert text.isascii()
    bodies = {"a_b%": jn.Body([0, 0])}
    pins = {"#1\\": PLANAR.Revolute(("ground", "a_b%"), [0, 0], [0, 0])}
    odd = jn.Mechanism(space="planar", bodies=bodies, joints=pins, title="50 % of {x}_y^2 ~")
    assert_well_formed(jn.equations(odd, format="latex", order=6))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rsur", "camshaft", "gear_pair", "hooke_joint", "rolling_disc", "scotch_yoke"])
def test_documents_of_other_mechanisms(name):
    assert_well_formed(jn.equations(jn.load(example(name)), format="latex"))


def test_too_many_terms_are_refused():
    with pytest.raises(MechanismError, match="order: must be a whole number from 1 to 8"):
        jn.equations(jn.load(example("four_bar")), format="latex", order=9)
