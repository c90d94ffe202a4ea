"""Connected components of a pairwise relation."""

import numpy as np
from jaxtyping import Bool


def clusters(joined: Bool[np.ndarray, "member member"]) -> list[list[int]]:
    """Return the connected components of a symmetric relation, in the order of their least members.

    Examples
    --------
    >>> clusters(np.array([[0, 0, 1], [0, 0, 0], [1, 0, 0]], bool))
    [[0, 2], [1]]
    """
    reached = joined | np.eye(len(joined), dtype=bool)
    while ((extended := reached @ reached) != reached).any():
        reached = extended
    return [np.flatnonzero(row).tolist() for k, row in enumerate(reached) if row.argmax() == k]
