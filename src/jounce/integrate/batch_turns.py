"""Whole turns of angles about axes, counted along the steps of many runs at once."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jounce.integrate.turns import PLACES
from jounce.jet.turns import principal
from jounce.mechanism.axis_angles import HALVINGS, LARGEST_CHANGE
from jounce.mechanism.time import nearest_instants

Steps = Int[np.ndarray, " place"]
Shares = Float[np.ndarray, " place"]
Angles = Float[np.ndarray, "instance place"]


class CountedAngles(NamedTuple):
    """Angles at places along steps, with the turns made, the places in the order of the steps.

    Attributes
    ----------
    step : array of int, shape (places,)
        The step of each place.
    share : array of shape (places,)
        Where in the step it is, from 0 to 1.
    angle : array of shape (instances, places)
        rad.
    """

    step: Steps
    share: Shares
    angle: Angles

    def near(self, step: Steps, share: Shares) -> Angles:
        """Return the angles at the places of the same steps that are nearest to others."""
        return self.angle[:, nearest_instants(2.0 * self.step + self.share, 2.0 * step + share)]


def counted_angles(measure: Callable[[Steps, Shares], Angles], run: Steps, begun: Angles) -> CountedAngles:
    """Count angles along the steps of many runs.

    An angle may turn by half a turn at once, where bodies pass near an attitude that tells none: there, more places are
    looked at.

    Parameters
    ----------
    measure : callable
        Returns angles, up to whole turns, at shares of steps.
    run : array of int, shape (steps,)
        The run of each step; those of a run follow one another.
    begun : array of shape (instances, steps)
        The angles at the beginning of the first step of the same run, to within half a turn.
    """
    step = np.repeat(np.arange(len(run)), PLACES + 1)
    share = np.tile(np.arange(PLACES + 1) / PLACES, len(run))
    angle = measure(step, share)
    for _ in range(HALVINGS):
        fast = (np.abs(principal(np.diff(angle))) > LARGEST_CHANGE).any(axis=0)
        wide = np.flatnonzero(fast & (step[1:] == step[:-1]))
        if not wide.size:
            break
        middle = 0.5 * (share[wide] + share[wide + 1])
        found = measure(step[wide], middle)
        step, share = np.insert(step, wide + 1, step[wide]), np.insert(share, wide + 1, middle)
        angle = np.insert(angle, wide + 1, found, axis=1)
    begins = np.append(True, np.diff(run[step]) != 0)
    rise = np.where(begins, 0.0, np.nan_to_num(principal(np.diff(angle, axis=1, prepend=angle[:, :1]))))
    first = np.flatnonzero(begins)[np.cumsum(begins) - 1]  # the place at which the run of each place begins
    counted, known = np.cumsum(rise, axis=1), begun[:, step]
    return CountedAngles(step, share, known + principal(angle[:, first] - known) + counted - counted[:, first])
