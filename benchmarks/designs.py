"""Optimized designs: what each problem of the literature or of the shop comes down to, from a poor start.

``python benchmarks/designs.py [--figure FILE] [NAME ...]`` prints objective, conditions and parameters before and
after, of all of them unless some are named. The figure shows the swing, the dwell, the press and the path of 18 points.

Points, angles and bounds of the two problems of Cabrera, Simon and Prado are those that later work repeats, as cases 2
and 12 of github.com/jmejia8/eca-four-bar-mechanisms.
"""

import argparse
import dataclasses
import time

import numpy as np

import jounce as jn

TURN = np.linspace(0.0, 1.0, 121)
FIVE = np.array([(3, 3), (2.759, 3.363), (2.372, 3.663), (1.890, 3.862), (1.355, 3.943)])
EIGHTEEN = np.array(
    [
        *((0.5, 1.1), (0.4, 1.1), (0.3, 1.1), (0.2, 1.0), (0.1, 0.9), (0.05, 0.75), (0.02, 0.6), (0, 0.5), (0, 0.4)),
        *((0.03, 0.3), (0.1, 0.25), (0.15, 0.2), (0.2, 0.3), (0.3, 0.4), (0.4, 0.5), (0.5, 0.7), (0.6, 0.9), (0.6, 1)),
    ]
)


def four_bar(parameters, guess, law="2*pi*t", crank_pivot=(0, 0), rocker_pivot=("AD", 0), instants=TURN):
    """Return a four-bar with a point P of its coupler, whose crank turns once in a second unless a law is given."""
    pin = jn.planar.Revolute
    crank, coupler, rocker = guess
    return jn.Mechanism(
        space="planar",
        parameters=parameters,
        bodies={
            "crank": jn.Body(crank[:2], crank[2]),
            "coupler": jn.Body(coupler[:2], coupler[2]),
            "rocker": jn.Body(rocker[:2], rocker[2]),
        },
        joints={
            "A": pin(("ground", "crank"), list(crank_pivot), [0, 0]),
            "B": pin(("crank", "coupler"), ["AB", 0], [0, 0]),
            "C": pin(("coupler", "rocker"), ["BC", 0], ["CD", 0]),
            "D": pin(("ground", "rocker"), list(rocker_pivot), [0, 0]),
        },
        drivers={"theta": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion=law)},
        outputs={"psi": jn.outputs.AngleOutput("rocker"), "P": jn.outputs.PointOutput("coupler", ["px", "py"])},
        time=instants,
    )


def swing():
    """Least peak jounce of a rocker that swings through 60 degrees."""
    lengths = {"AD": 1.0, "AB": 0.3, "BC": 0.9, "CD": 0.6, "px": 0.4, "py": 0.2}
    mechanism = four_bar(lengths, [(0, 0, 0), (0.3, 0, 0.6), (1, 0, 2.2)])
    bounds = {"AB": (0.1, 0.6), "BC": (0.4, 1.6), "CD": (0.3, 1.6)}
    return jn.optimize(mechanism, "peak(psi, 4)", bounds, ["span(psi) == 60 deg"], starts=1)


def hoekens():
    """Straightest line of at least four cranks' length over half a turn, without the proportions of Hoekens."""
    lengths = {"AD": 2.0, "AB": 1.0, "BC": 2.2, "CD": 2.8, "px": 4.4, "py": 0.3}
    mechanism = four_bar(lengths, [(0, 0, 0), (1, 0, 1.2), (2, 0, 1.4)])
    bounds = {"BC": (1.8, 3.5), "CD": (1.8, 3.5), "px": (3.5, 6.0), "py": (-1.0, 1.0)}
    conditions = ["span(P_x, 0, 0.25, 0.75) >= 4"]
    return jn.optimize(mechanism, "span(P_y, 0, 0.25, 0.75)", bounds, conditions, starts=1)


def evans():
    """Straightest line of half a crank's length of a rocking four-bar, as that of Evans; the start locks."""
    lengths = {"AB": 1.0, "BC": 0.7, "CD": 0.9, "px": 1.1, "py": 0.1, "dx": 1.2, "dy": 0.1}
    law = "90*deg + 25*deg*sin(2*pi*t)"
    guess = [(0, 0, 1.57), (0, 1, 0.1), (1.2, 0.1, 2.2)]
    mechanism = four_bar(lengths, guess, law, rocker_pivot=("dx", "dy"))
    bounds = {"BC": (0.4, 1.5), "CD": (0.4, 1.5), "px": (-2.0, 2.5), "py": (-0.6, 0.6), "dx": (0.5, 1.8)}
    return jn.optimize(mechanism, "span(P_x)", bounds | {"dy": (-0.5, 0.5)}, ["span(P_y) >= 0.5"], starts=1)


def dwell():
    """Dwell of a six-bar while its crank turns by 120 degrees, with an output of 25 degrees at least."""
    mechanism = jn.load("examples/six_bar_stephenson.yaml")
    r = mechanism.parameter_values["r"]
    poor = mechanism.with_parameters(PF=3.3 * r, xG=2.3 * r, yG=2.9 * r)
    bounds = {"PF": (2.8 * r, 3.5 * r), "FG": (1.8 * r, 3 * r), "xG": (2 * r, 3 * r), "yG": (2 * r, 3.5 * r)}
    conditions = ["span(output_angle) >= 25 deg"]
    return jn.optimize(poor, "span(output_angle, 0, 1/3, 1)", bounds | {"gamma": (1.1, 1.4)}, conditions, starts=1)


def press():
    """Least peak yank of the motor of a knuckle press that has the same stroke, and the same lowest position."""
    mechanism = jn.load("examples/press.yaml")
    ram = jn.solve(mechanism, order=1).outputs["ram"][:, 0, 1]
    bounds = {"rod": ("470 mm", "510 mm"), "upper": ("380 mm", "420 mm"), "lower": ("430 mm", "470 mm")}
    conditions = [
        f"span(ram_y) == {float(ram.max() - ram.min())!r}",
        f"minimum(ram_y) == {float(ram.min())!r}",  # without it, none is as gentle as a press that does not press
    ]
    bounds |= {"throw": ("95 mm", "105 mm")}
    return jn.optimize(mechanism, "peak(torque, 1)", bounds, conditions, starts=1)


def law():
    """Motion law from rest to rest, without acceleration at its ends, of least peak torque rate, against 3-4-5."""
    free = {f"a{k}": 0.0 for k in (6, 7, 8, 9)}
    lengths = {"AD": 0.4, "AB": 0.12, "BC": 0.35, "CD": 0.25, "px": 0.1, "py": 0.0}
    bump = "t**3*(1-t)**3*(a6 + a7*(t-0.5) + a8*(t-0.5)**2 + a9*(t-0.5)**3)"
    motion = f"60*deg + 120*deg*(10*t**3 - 15*t**4 + 6*t**5 + {bump})"
    bare = four_bar(lengths | free, [(0, 0, 1), (0.06, 0.1, 0.6), (0.4, 0, 2.0)], motion)
    masses = {"mass": 2.0, "inertia": 0.02, "center_of_mass": [0.1, 0]}
    bodies = {name: dataclasses.replace(body, **masses) for name, body in bare.bodies.items()}
    mechanism = dataclasses.replace(bare, bodies=bodies)
    return jn.optimize(mechanism, "peak(torque(theta), 1)", dict.fromkeys(free, (-60.0, 60.0)), starts=1)


def five_points():
    """Path through five points at given angles of the crank: Cabrera, Simon and Prado (2002)."""
    lengths = {"AD": 4.0, "AB": 2.0, "BC": 4.0, "CD": 3.0, "px": 2.0, "py": 2.0}
    mechanism = four_bar(lengths, [(0, 0, 0.5), (1.7, 1, 0.5), (4, 0, 1.7)], instants=np.linspace(0, 1, 61))
    bounds = dict.fromkeys(("AD", "AB", "BC", "CD"), (0.5, 50.0)) | dict.fromkeys(("px", "py"), (-50.0, 50.0))
    curves = {"target": (np.arange(2, 7) / 24, FIVE)}  # pi/6 to pi/2
    return jn.optimize(mechanism, "path_error(P, target)", bounds, curves=curves, starts=3)


def eighteen_points():
    """Closed path through 18 points, 20 degrees of the crank apart: Cabrera, Simon and Prado (2002)."""
    lengths = {"AD": 0.5, "AB": 0.3, "BC": 0.6, "CD": 0.6, "px": 0.3, "py": 0.3}
    places = {"x0": 0.0, "y0": 0.3, "dx": 0.5, "dy": 0.3, "theta0": 0.6}
    guess = [("x0", "y0", "theta0"), (0.2, 0.5, 0.5), ("dx", "dy", 1.2)]
    law = "theta0 + 2*pi*t"
    mechanism = four_bar(lengths | places, guess, law, ("x0", "y0"), ("dx", "dy"), np.linspace(0, 1, 73))
    bounds = dict.fromkeys(("AB", "BC", "CD"), (0.05, 5.0)) | {"theta0": (-6.3, 6.3)}
    bounds |= dict.fromkeys(("px", "py", "x0", "y0", "dx", "dy"), (-5.0, 5.0))
    curves = {"target": (np.arange(18) / 18, EIGHTEEN)}
    return jn.optimize(mechanism, "path_error(P, target)", bounds, curves=curves, starts=6)


def drawn(found, path):
    """Draw some designs before and after."""
    import matplotlib.pyplot as plt

    def curve(axes, case, of, **options):
        for label, start in (("before", True), ("after", False)):
            design = found[case]
            first = {row.name: row.before for row in design.comparisons if row.kind == "parameter"}
            mechanism = design.mechanism.with_parameters(**first) if start else design.mechanism
            axes.plot(*of(jn.solve(mechanism, order=4)), "C0--" if start else "C1", lw=1.2, label=label, **options)
        axes.legend()

    figure, grid = plt.subplots(2, 2, figsize=(9, 7), layout="constrained")
    curve(grid[0, 0], "swing", lambda m: (m.time, m.outputs["psi"][:, 4]))
    grid[0, 0].set(title="Four-bar, swing of 60 degrees", xlabel="time, s", ylabel="jounce of the rocker, rad/s$^4$")
    curve(grid[0, 1], "dwell", lambda m: (m.time, np.degrees(m.outputs["output_angle"][:, 0])))
    grid[0, 1].set(title="Six-bar, dwell from 1/3 s to 1 s", xlabel="time, s", ylabel="output angle, deg")
    curve(grid[1, 0], "press", lambda m: (m.time, m.outputs["torque"][:, 1] / 1e3))
    grid[1, 0].set(title="Knuckle press", xlabel="time, s", ylabel="torque rate of the motor, kN m/s")
    curve(grid[1, 1], "eighteen_points", lambda m: m.outputs["P"][:, 0].T)
    grid[1, 1].plot(*EIGHTEEN.T, "ko", ms=4)
    grid[1, 1].set(title="Path through 18 points", xlabel="x", ylabel="y", aspect="equal")
    figure.savefig(path, dpi=110)


CASES = (swing, hoekens, evans, dwell, press, law, five_points, eighteen_points)


def main(names, figure=None):
    """Run cases, print what they come down to, and draw some of them."""
    found = {}
    for case in CASES:
        if names and case.__name__ not in names:
            continue
        start = time.process_time()
        design = found[case.__name__] = case()
        print(f"{case.__name__}: {case.__doc__}\n  {design.status}: {design.message}")
        for row in design.comparisons:
            print(f"  {row.name:40} {row.before:14.8g} {row.after:14.8g} {row.multiplier:12.5g}")
        print(f"  residual {design.residual:.1e}, grid {design.grid_error:.1e}, {design.evaluations} designs")
        print(f"  {time.process_time() - start:.0f} s of processor time", flush=True)
    if figure:
        drawn(found, figure)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--figure", metavar="FILE")
    given = parser.parse_args()
    main(given.names or ("swing dwell press eighteen_points".split() if given.figure else ()), given.figure)
