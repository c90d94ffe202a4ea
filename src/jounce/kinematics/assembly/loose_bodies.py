"""Loose bodies: movable bodies held by at most one joint, which suggests a missing joint."""

from collections.abc import Sequence

from jounce.mechanism import Model
from jounce.mechanism.building.builder import named_groups
from jounce.mechanism.mechanism import GROUND

OF_A_HINGE = {2: 2, 3: 5}  # equations of a hinge, by the number of position components
MOST_NAMED = 3


def joints_of(model: Model) -> dict[str, list[str]]:
    """Return the names of the joints of each body, without drivers."""
    names = (GROUND, *model.bodies)
    joints: dict[str, list[str]] = {name: [] for name in names}
    for group, members in named_groups(model):
        for k, row in enumerate(members):
            kind, _, name = row.partition(".")
            if kind == "joints":
                for slot in group.bodies:
                    if name not in joints[names[slot[k]]]:
                        joints[names[slot[k]]].append(name)
    return joints


def missing_joint_words(model: Model, moving: Sequence[str], freedom: int) -> str:
    """Return a hint at a missing joint for bodies with degrees of freedom left, or an empty string.

    Parameters
    ----------
    model : Model
        The assembled model.
    moving : sequence of str
        Names of the bodies that can move.
    freedom : int
        Number of degrees of freedom left.
    """
    joints = joints_of(model)
    loose = [body for body in moving if len(joints[body]) <= 1]
    if not loose or (len(loose) == 1 and freedom == 1 and joints[loose[0]]):
        return ""  # a crank that lacks a driver, not a joint
    supports = [f"by {joints[body][0]} alone" if joints[body] else "by no joint" for body in loose]
    first, *others = zip(loose, supports, strict=True)
    phrases = [f"{first[0]} is held {first[1]}", *map(" ".join, others[: MOST_NAMED - 1])]
    phrase = f"{', '.join(phrases)}{', ...' if len(supports) > MOST_NAMED else ''}"
    if len(loose) != 2:
        return f"{phrase}: is a joint missing?"
    components = model.pose_type.shifts
    kind = "a revolute joint" if freedom in (OF_A_HINGE[components], OF_A_HINGE[components] + 1) else "a joint"
    return f"{phrase}: is {kind} missing between them, bodies: [{loose[0]}, {loose[1]}]?"
