"""Whole turns of angles, which attitudes leave open, counted from sample to sample along paths.

An angle may change by half a turn at once near an attitude that leaves it undefined: there, more samples are
taken.
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

LARGEST_CHANGE = np.pi / 4  # of an angle from sample to sample: more, and it is looked at between them
HALVINGS = 24  # of the way between two samples: down to what passes 1e-9 beside an attitude that tells no angle


class PathSamples(NamedTuple):
    """Samples along paths, in their order, and angles there.

    Attributes
    ----------
    path : array of int, shape (samples,)
        On which path each sample is.
    share : array of shape (samples,)
        How far along it, in whatever measures the path.
    angle : array of shape (angles, samples)
        rad.
    """

    path: Paths
    share: Shares
    angle: Angles

    def near(self, path: Paths, share: Shares) -> Angles:
        """Return the angles at the samples that are nearest to others on the same paths, with shares from 0 to 1."""
        return self.angle[:, nearest_instants(2.0 * self.path + self.share, 2.0 * path + share)]


def refined_samples(measure: Measure, path: Paths, share: Shares, angle: Angles | None = None) -> PathSamples:
    """Return samples between which no angle makes half a turn: those given, and more of them where an angle is fast.

    Parameters
    ----------
    measure : callable
        Returns angles, up to whole turns, at samples given by path and share.
    path, share : array of shape (samples,)
        Those to begin with, in their order.
    angle : array of shape (angles, samples), optional
        What is measured there, if it is known.
    """
    angle = measure(path, share) if angle is None else angle
    for _ in range(HALVINGS):
        fast = (np.abs(principal(np.diff(angle))) > LARGEST_CHANGE).any(axis=0)
        wide = np.flatnonzero(fast & (path[1:] == path[:-1]))
        if not wide.size:
            break
        middle = 0.5 * (share[wide] + share[wide + 1])
        inserted = measure(path[wide], middle)
        path, share = np.insert(path, wide + 1, path[wide]), np.insert(share, wide + 1, middle)
        angle = np.insert(angle, wide + 1, inserted, axis=1)
    return PathSamples(path, share, angle)


def counted_along(
    measure: Measure, run: Int[np.ndarray, " step"], begun: Float[np.ndarray, "angle step"], samples: int
) -> PathSamples:
    """Count angles along the steps of many runs, each a path with shares from 0 to 1.

    Parameters
    ----------
    measure : callable
        Returns angles, up to whole turns, at shares of steps.
    run : array of int, shape (steps,)
        The run of each step; those of a run follow one another.
    begun : array of shape (angles, steps)
        The angles at the beginning of the first step of the same run, to within half a turn.
    samples : int
        In a step, at least.
    """
    step, share = np.repeat(np.arange(len(run)), samples + 1), np.tile(np.arange(samples + 1) / samples, len(run))
    step, share, angle = refined_samples(measure, step, share)
    begins = np.append(True, np.diff(run[step]) != 0)
    rise = np.where(begins, 0.0, np.nan_to_num(principal(np.diff(angle, axis=1, prepend=angle[:, :1]))))
    first = np.flatnonzero(begins)[np.cumsum(begins) - 1]  # the sample at which the run of each sample begins
    counted, known = np.cumsum(rise, axis=1), begun[:, step]
    return PathSamples(step, share, known + principal(angle[:, first] - known) + counted - counted[:, first])
