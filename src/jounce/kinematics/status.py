"""Outcomes of a solve, one for each instant, and what to do about them."""

import enum


class Status(enum.IntEnum):
    """Outcome at one instant of a motion; at all but OK, its results are NaN.

    Examples
    --------
    >>> import jounce as jn
    >>> motion = jn.solve(jn.load("examples/four_bar.yaml"), [0.0, 0.1], order=1)
    >>> [jn.Status(code).name for code in motion.status]
    ['OK', 'OK']
    >>> jn.Status.NOT_ASSEMBLED.advice
    "the bodies cannot be assembled; check lengths and the driver's range"
    """

    OK = 0
    NOT_ASSEMBLED = 1
    SINGULAR = 2
    BRANCH_JUMP = 3
    NOT_CONVERGED = 4
    NOT_REACHED = 5
    INADMISSIBLE = 6
    COLLAPSED = 7
    UNDEFINED = 8
    INCONSISTENT = 9
    UNBALANCED = 10
    END_OF_CURVE = 11
    LOCKED = 12

    @property
    def advice(self) -> str:
        """What the outcome means and what to do."""
        return _ADVICE[self]


_ADVICE = {
    Status.OK: "solved",
    Status.NOT_ASSEMBLED: "the bodies cannot be assembled; check lengths and the driver's range",
    Status.SINGULAR: "the mechanism is at a singular position (a dead point), where its motion is not determined; "
    "drive another body, or keep the driver's range away from it",
    Status.BRANCH_JUMP: "the solution left its predicted path for another assembly branch, or a motion law jumps; "
    "check that the motion laws are continuous and that the mechanism does not pass a dead point",
    Status.NOT_CONVERGED: "Newton-Raphson did not reach the tolerance; the bodies may not reach each other here, or "
    "the tolerance is too small",
    Status.INADMISSIBLE: "the motion law or the force has no permitted value here: it must be finite, and the distance "
    "of a distance driver above zero",
    Status.COLLAPSED: "the steps became too small to move on: the motion runs into a singular position, a motion law "
    "or a force grows beyond all bounds or jumps, or the motion takes more than a million steps; check the mechanism, "
    "its laws and its forces here, or ask for a shorter motion",
    Status.UNDEFINED: "a quantity or a derivative of it is not a finite number here: a distance that is zero has no "
    "rate, a motion law such as t**2.5 no third derivative at t = 0, and Euler angles are undefined where their first "
    "and last axes are parallel; ask for a lower order, for another sequence, or leave it out",
    Status.INCONSISTENT: "redundant constraints contradict each other here: they agree at the start, and not all along "
    "the motion; correct lengths, axes and laws of those named, or free a direction there",
    Status.UNBALANCED: "the energy of the motion would change here, though nothing adds or removes any: a joint has a "
    "kink or a jump, at which velocities would have to jump, too, or a feature too narrow for the steps, or the motion "
    "runs into a singular position; make the residual smooth, ask for a `longest_step` as short as the feature, or "
    "keep the motion away from that position",
    Status.END_OF_CURVE: "a point has come to an end of the curve that it is held on, and there is no curve beyond; "
    "ask for a shorter motion, or give a longer curve, or a closed one",
    Status.LOCKED: "no force or acceleration fulfills the law of friction, which grows as fast as the normal force on "
    "the joint; give a smaller coefficient or radius, gears a larger efficiency, drivers more mechanical advantage, or "
    "a simulation a start that is slower, as friction is less below its speed",
    Status.NOT_REACHED: "not computed, because the motion could not be followed up to here",
}
