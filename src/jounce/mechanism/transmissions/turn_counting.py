"""Whole turns of angles, which attitudes leave open, counted from sample to sample along paths.

Near an attitude at which an angle is undefined, the angle may change by half a turn at once: more samples are taken
there.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jounce.jet.turns import principal
from jounce.mechanism.time import nearest_instants

Paths = Int[np.ndarray, " sample"]
Shares = Float[np.ndarray, " sample"]
Angles = Float[np.ndarray, "angle sample"]
Measure = Callable[[Paths, Shares], Angles]

LARGEST_CHANGE = np.pi / 4  # of an angle between samples, beyond which the interval is halved
HALVINGS = 24  # of the interval between two samples: enough to pass an undefined angle at a distance of 1e-9


class PathSamples(NamedTuple):
    """Samples along paths, in order, and the angles at the samples.

    Attributes
    ----------
    path : array of int, shape (samples,)
        Path of each sample.
    share : array of shape (samples,)
        Position of each sample along its path, in the parameter of the path.
    angle : array of shape (angles, samples)
        Angles, rad.
    """

    path: Paths
    share: Shares
    angle: Angles

    def near(self, path: Paths, share: Shares) -> Angles:
        """Return the angles at the samples nearest to given positions on the same paths, with shares from 0 to 1."""
        return self.angle[:, nearest_instants(2.0 * self.path + self.share, 2.0 * path + share)]


def refined_samples(measure: Measure, path: Paths, share: Shares, angle: Angles | None = None) -> PathSamples:
    """Return samples between which no angle makes half a turn, by bisection of the given ones where an angle is fast.

    Parameters
    ----------
    measure : callable
        Returns angles, up to whole turns, at samples given by path and share.
    path, share : array of shape (samples,)
        Initial samples, in order.
    angle : array of shape (angles, samples), optional
        Measured angles at the initial samples, if known.
    """
    angle = measure(path, share) if angle is None else angle
    for _ in range(HALVINGS):
        fast = (np.abs(principal(np.diff(angle))) > LARGEST_CHANGE).any(axis=0)
        intervals = np.flatnonzero(fast & (path[1:] == path[:-1]))
        if not intervals.size:
            break
        middle = 0.5 * (share[intervals] + share[intervals + 1])
        inserted = measure(path[intervals], middle)
        path, share = np.insert(path, intervals + 1, path[intervals]), np.insert(share, intervals + 1, middle)
        angle = np.insert(angle, intervals + 1, inserted, axis=1)
    return PathSamples(path, share, angle)


def counted_along(
    measure: Measure, run: Int[np.ndarray, " step"], initial: Float[np.ndarray, "angle step"], samples: int
) -> PathSamples:
    """Count angles along the steps of many runs; each step is a path with shares from 0 to 1.

    Parameters
    ----------
    measure : callable
        Returns angles, up to whole turns, at shares of steps.
    run : array of int, shape (steps,)
        Run of each step; the steps of a run are consecutive.
    initial : array of shape (angles, steps)
        Angles at the beginning of the run of each step, to within half a turn.
    samples : int
        Least number of samples in a step.
    """
    step, share = np.repeat(np.arange(len(run)), samples + 1), np.tile(np.arange(samples + 1) / samples, len(run))
    step, share, angle = refined_samples(measure, step, share)
    is_start = np.append(True, np.diff(run[step]) != 0)
    rise = np.where(is_start, 0.0, np.nan_to_num(principal(np.diff(angle, axis=1, prepend=angle[:, :1]))))
    first = np.flatnonzero(is_start)[np.cumsum(is_start) - 1]  # first sample of the run of each sample
    total, initial_angles = np.cumsum(rise, axis=1), initial[:, step]
    return PathSamples(
        step, share, initial_angles + principal(angle[:, first] - initial_angles) + total - total[:, first]
    )
