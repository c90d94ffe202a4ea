"""Reference positions from which angles about axes are counted, and the whole turns of these angles."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jounce.base.modules import unchecked, with_fields
from jounce.base.shapes import Numbers
from jounce.constraints.angles import Datum, angle_of
from jounce.jet.turns import counted_on, principal, whole_periods
from jounce.mechanism.system import Group, with_field
from jounce.mechanism.time import nearest_instants
from jounce.mechanism.transmissions.turn_counting import refined_samples

Coordinates = Mapping[str, Any]  # of all bodies, the ground first, by name: (..., bodies, batch)
Quaternions = Float[np.ndarray, "4 *#rest"]
Vectors = Float[np.ndarray, "3 *#rest"]
Angles = Float[np.ndarray, "instance batch"]
PARALLEL = 1e-9  # largest sine of the angle between coincident axes


class PrescribedAngle(NamedTuple):
    """An angle that a driver prescribes.

    Attributes
    ----------
    bodies : tuple of int
        Indices of the bodies i and j.
    axis : array of shape (3,)
        Unit axis in the global frame.
    angle : float
        Prescribed angle with its whole turns, rad.
    """

    bodies: tuple[int, int]
    axis: Float[np.ndarray, " 3"]
    angle: float


class AttitudeHistory(NamedTuple):
    """A sequence of attitudes of all bodies, so dense that no body makes half a turn between samples.

    Attributes
    ----------
    quaternion : array of shape (4, bodies, samples)
        Euler parameters of all bodies, the ground first.
    time : array of shape (samples,)
        Instants, s; zeros for a path that is no motion.
    period, repeated : int
        Number of the last samples that make up one turn, and number of repetitions of that turn that follow.
    between : callable, optional
        Returns the attitudes at any instants, (4, bodies, instants).
    """

    quaternion: Float[np.ndarray, "4 bodies sample"]
    time: Float[np.ndarray, " sample"]
    period: int = 1
    repeated: int = 0
    between: Callable[[Float[np.ndarray, " time"]], Float[np.ndarray, "4 bodies time"]] | None = None

    def sampled(
        self, measure: Callable[[Float[np.ndarray, "4 bodies sample"]], Float[np.ndarray, "angle sample"]]
    ) -> tuple[Float[np.ndarray, " sample"], Float[np.ndarray, "angle sample"]]:
        """Return instants and angles, known up to whole turns, so dense that no turn is missed between samples.

        Parameters
        ----------
        measure : callable
            Returns the angles, rad, of attitudes of all bodies, (4, bodies, samples).
        """
        between, angles = self.between, measure(self.quaternion)
        if between is None:
            return self.time, angles
        path = np.zeros(len(self.time), int)  # a single path, with time as its parameter
        samples = refined_samples(lambda _, instants: measure(between(instants)), path, self.time, angles)
        return samples.share, samples.angle

    def angles(self, group: Group) -> tuple[Float[np.ndarray, " sample"], Float[np.ndarray, "instance sample"]]:
        """Return instants, and the angles of a group about axes at these instants, counted from its datum."""
        time, raw = self.sampled(lambda quaternion: raw_angles([group], {"quaternion": quaternion})[0])
        initial = np.asarray(group.element.datum.near)[..., 0]
        return time, counted_on(np.column_stack([initial, raw]))[:, 1:]

    def last_angles(self, groups: Sequence[Group]) -> list[np.ndarray]:
        """Return the angles at the end, (instances, 1) each, including the repeated turns."""
        angles = [self.angles(group)[1] for group in groups if measures_angle(group)]
        if not self.repeated:
            return [angle[:, -1:] for angle in angles]
        ends = [(angle[:, -1:], angle[:, -1 - self.period, None]) for angle in angles]
        return [last + self.repeated * whole_periods(last - before) for last, before in ends]

    def counting(self, groups: Sequence[Group], instants: Float[np.ndarray, " time"]) -> tuple[Group, ...]:
        """Return groups with the turns at each instant, taken from the sample nearest in time."""
        turns = []
        for time, angles in (self.angles(group) for group in groups if measures_angle(group)):
            backward = time[-1] < time[0]
            sample_times, angles = (time[::-1], angles[:, ::-1]) if backward else (time, angles)
            turns.append(angles[:, nearest_instants(sample_times, instants)])
        return with_turns(groups, turns)


def measures_angle(group: Group) -> bool:
    """Return whether the elements of a group measure an angle about an axis."""
    return hasattr(group.element, "datum")


def with_datums(
    groups: Sequence[Group],
    coordinates: Coordinates,
    prescribed: Sequence[PrescribedAngle] = (),
    *,
    keep: bool = False,
) -> tuple[Group, ...]:
    """Return groups with the angles about axes counted from a position.

    Parameters
    ----------
    groups : sequence of Group
        Groups; those that measure no such angle are returned unchanged.
    coordinates : dict of str to array
        Coordinates of all bodies, the ground first, shape (..., bodies, 1).
    prescribed : sequence of PrescribedAngle, optional
        Angles with known turns; angles about the same axis between the same bodies get the same turns.
    keep : bool, default False
        Whether angles continue from the present datum, instead of following from the body frames.
    """
    return tuple(
        _with_datum(group, coordinates, prescribed, keep=keep) if measures_angle(group) else group for group in groups
    )


def raw_angles(groups: Sequence[Group], coordinates: Coordinates) -> list[np.ndarray]:
    """Return the angles of groups about axes, up to whole turns, (instances, batch) each.

    Parameters
    ----------
    groups : sequence of Group
        Groups; those that measure no such angle have no entry in the result.
    coordinates : dict of str to array
        Coordinates of all bodies, the ground first, shape (..., bodies, batch).
    """
    return [_raw_angle(group, relative_attitude(group, coordinates)) for group in filter(measures_angle, groups)]


def _raw_angle(group: Group, attitude: Quaternions) -> Angles:
    """Return the angles of a group for attitudes of its second bodies relative to the first."""
    element, axis = group.element, axis_of(group)
    if element.vector_i is None:
        return since(element.datum, attitude, axis)
    second = element.vector_j if element.datum.across is None else element.datum.across
    return _between(attitude, axis, np.asarray(element.vector_i), np.asarray(second))


def with_angles(groups: Sequence[Group], angles: Sequence[np.ndarray]) -> tuple[Group, ...]:
    """Return groups whose data have other angles; `angles` holds one array for each group that measures angles."""
    return _with_data(groups, angles, lambda datum, angle: with_fields(datum, angle=angle, near=angle))


def with_turns(groups: Sequence[Group], near: Sequence[Any]) -> tuple[Group, ...]:
    """Return groups whose data have other turns, from angles of shape (instances, batch), which may be traced."""
    return _with_data(groups, near, lambda datum, turns: with_fields(datum, near=turns))


def _with_data(
    groups: Sequence[Group], values: Sequence[Any], update: Callable[[Datum, Any], Datum]
) -> tuple[Group, ...]:
    """Return groups with changed data; `values` holds one value for each group that measures angles."""
    remaining = iter(values)
    return tuple(
        with_field(g, "datum", update(g.element.datum, next(remaining))) if measures_angle(g) else g for g in groups
    )


def angles_of(groups: Sequence[Group]) -> tuple[Any, ...]:
    """Return the angles of groups about axes, with their turns."""
    return tuple(group.element.datum.near for group in groups if measures_angle(group))


def of_one_lane(groups: Sequence[Group], lane: int = 0) -> tuple[Group, ...]:
    """Return groups with the turns of one lane of a batch."""
    return with_turns(groups, [angle[..., lane : lane + 1] for angle in angles_of(groups)])


def _with_datum(group: Group, coordinates: Coordinates, prescribed: Sequence[PrescribedAngle], *, keep: bool) -> Group:
    element, attitude = group.element, relative_attitude(group, coordinates)
    axis, datum = axis_of(group), element.datum
    before = np.zeros(attitude.shape[1:]) if datum is None else since(datum, attitude, axis)
    if element.vector_i is not None:
        angle = _between(attitude, axis, np.asarray(element.vector_i), np.asarray(element.vector_j))
    elif keep:
        angle = before
    else:
        angle, is_defined = angle_of(attitude, axis)
        angle = np.where(is_defined, angle, before)
    angle = before + principal(angle - before) if datum is not None else principal(angle)
    for k, bodies in enumerate(zip(*group.bodies, strict=True)):
        for given in prescribed:
            sign = _relative_sign(bodies, turned(coordinates["quaternion"][:, bodies[0], 0], axis[:, k, 0]), given)
            if sign:
                expected = sign * given.angle
                angle[k] = expected + principal(angle[k] - expected)
    # a driver or a force acts about the axis, whatever the component of its vector on body j along the axis
    acts = element.vector_i is not None and hasattr(element, "role")
    across = _across(np.asarray(element.vector_j), attitude, axis) if acts else None
    values = {"attitude": attitude, "angle": angle, "near": angle, "across": across}
    return with_field(group, "datum", unchecked(Datum, values))


def with_datum_of(group: Group, reference: Group) -> Group:
    """Return a group whose angles are counted from the datum of another group; its vectors may be traced by JAX."""
    datum = reference.element.datum
    if datum.across is not None:
        across = _across(group.element.vector_j, np.asarray(datum.attitude), axis_of(reference))
        datum = with_fields(datum, across=across)
    return with_field(group, "datum", datum)


def departure(before: Sequence[Group], after: Sequence[Group]) -> float:
    """Return the largest difference of driver angles, and of their axis directions, between two data, rad."""
    largest = 0.0
    for old, new in zip(before, after, strict=True):
        if measures_angle(new):
            axis, attitude = axis_of(new), new.element.datum.attitude
            angle = principal(_raw_angle(old, attitude) - new.element.datum.angle)
            turn = quaternion_product(attitude, conjugate(old.element.datum.attitude))[1:]
            tilt = turn - (turn * axis).sum(axis=0) * axis
            largest = max(largest, np.max(np.abs(angle)), np.max(np.abs(tilt)))
    return float(largest)


def prescribed_angles(
    groups: Sequence[Group], coordinates: Coordinates, laws: Sequence[np.ndarray]
) -> list[PrescribedAngle]:
    """Return the angles that spatial drivers prescribe at a position; `laws` holds the law values of each group."""
    prescribed = []
    for group, values in zip((g for g in groups if measures_angle(g)), laws, strict=True):
        for k, bodies in enumerate(zip(*group.bodies, strict=True)):
            axis = turned(coordinates["quaternion"][:, bodies[0], 0], axis_of(group)[:, k, 0])
            prescribed.append(PrescribedAngle(bodies, axis, float(np.broadcast_to(values, (group.instances, 1))[k, 0])))
    return [given for given in prescribed if np.isfinite(given.angle)]


def lost_count(groups: Sequence[Group], history: AttitudeHistory) -> tuple[int, int, float] | None:
    """Return the first loss of turns of spatial gears: group, instance and instant, s; None if no turn is lost.

    The residual of a gear knows angles up to whole turns only. Along a dense history, turns can be counted.
    """
    for index, group in enumerate(groups):
        whole = getattr(group.element, "whole", None)
        if whole is None:
            continue
        time, raw = history.sampled(lambda quaternion, g=group: _shaft_angles(g, quaternion))
        first, second = np.split(counted_on(raw), 2)
        excess = second - np.asarray(group.element.ratio) * first
        is_lost = np.abs(excess - excess[:, :1]) > np.pi / 2 / np.asarray(whole)
        if is_lost.any():
            instance = int(np.argmax(is_lost.any(axis=1)))
            return index, instance, float(time[np.argmax(is_lost[instance])])
    return None


def _shaft_angles(group: Group, quaternion: Float[np.ndarray, "4 bodies sample"]) -> Float[np.ndarray, "angle sample"]:
    """Return the angles of the shafts of a group in their frames, up to whole turns, the first shafts first."""
    element, frame, angles = group.element, quaternion[:, list(group.bodies[2])], []
    for bodies, axis, held in zip(
        group.bodies[:2], (element.axis_i, element.axis_j), (element.held_i, element.held_j), strict=True
    ):
        axis = np.asarray(axis) / np.linalg.norm(axis, axis=0)
        angles.append(-since(held, quaternion_product(conjugate(quaternion[:, list(bodies)]), frame), axis))
    return np.concatenate(angles)


def axis_of(group: Group) -> Float[np.ndarray, "3 instance 1"]:
    """Return the unit axes, on body i, of the elements of a group, (3, instances, 1)."""
    element = group.element
    axis = np.asarray(element.axis if hasattr(element, "axis") else element.axis_i)
    return unit(axis)


def unit(vectors: Float[np.ndarray, "component *batch"]) -> Float[np.ndarray, "component *batch"]:
    """Return unit vectors, in half the time of `numpy.linalg.norm`."""
    return vectors / np.sqrt(np.add.reduce(vectors * vectors, axis=0))


def relative_attitude(group: Group, coordinates: Coordinates) -> Quaternions:
    """Return the Euler parameters of the second bodies of a group relative to the first, (4, instances, 1)."""
    first, second = (np.asarray(coordinates["quaternion"])[:, list(bodies)] for bodies in group.bodies)
    return quaternion_product(conjugate(first), second)


def attitudes_of(
    bodies: Sequence[int], quaternion: Float[np.ndarray, "4 bodies sample"]
) -> Float[np.ndarray, "4 sample"]:
    """Return the Euler parameters, (4, samples), of a body, or of a second body relative to a first.

    Parameters
    ----------
    bodies : sequence of int
        One or two indices of bodies.
    quaternion : array of shape (4, bodies, samples)
        Euler parameters of all bodies, the ground first.
    """
    *base, body = (quaternion[:, k] for k in bodies)
    return quaternion_product(conjugate(base[0]), body) if base else body


def since(datum: Datum, attitude: Quaternions, axis: Vectors) -> Angles:
    """Return the angle of an attitude, within half a turn of the angle of a datum."""
    return (
        np.asarray(datum.angle) + angle_of(quaternion_product(attitude, conjugate(np.asarray(datum.attitude))), axis)[0]
    )


def _between(attitude: Quaternions, axis: Vectors, first: Vectors, second: Vectors) -> Angles:
    """Return the signed angle about an axis from a vector of body i to one of body j."""
    b = turned(attitude, second)
    across = b - (b * axis).sum(axis=0) * axis
    return np.arctan2((_cross(axis, first) * across).sum(axis=0), (first * across).sum(axis=0))


def _across(second: Numbers, attitude: Quaternions, axis: Vectors) -> Numbers:
    """Return the components of vectors of bodies j perpendicular to axes of bodies i."""
    along = turned(conjugate(attitude), axis)
    return second - (second * along).sum(axis=0) * along


def _relative_sign(bodies: tuple[int, ...], axis: Float[np.ndarray, " 3"], given: PrescribedAngle) -> int:
    """Return 1 if an angle equals that of a driver, -1 if it is its negative, 0 if they are unrelated."""
    if sorted(bodies) != sorted(given.bodies) or np.linalg.norm(_cross(axis, given.axis)) > PARALLEL:
        return 0
    return int(np.sign(axis @ given.axis)) * (1 if bodies == given.bodies else -1)


def conjugate(p: Quaternions) -> Quaternions:
    """Return the Euler parameters of the inverse rotations."""
    return np.concatenate([p[:1], -p[1:]])


def quaternion_product(p: Quaternions, q: Quaternions) -> Quaternions:
    """Return the Euler parameters of rotations p after rotations q."""
    return _bilinear(_HAMILTON, p, q)


def turned(p: Quaternions, vector: Vectors) -> Vectors:
    """Return vectors in global axes, given in the axes of bodies with Euler parameters p."""
    twice = 2 * _cross(p[1:], vector)
    return vector + p[:1] * twice + _cross(p[1:], twice)


def _cross(a: Vectors, b: Vectors) -> Any:
    """Return the cross products along the first axis."""
    return _bilinear(_LEVI_CIVITA, a, b)


def _bilinear(signs: np.ndarray, a: Numbers, b: Numbers) -> Any:
    """Return bilinear sums of components along the first axis, by few calls of NumPy.

    Parameters
    ----------
    signs : array of shape (components, components squared)
        Coefficient of the product of component i of `a` and component j of `b` in column i times components plus j.
    """
    products = np.asarray(a)[:, None] * np.asarray(b)[None]
    return (signs @ products.reshape(signs.shape[1], -1)).reshape(len(signs), *products.shape[2:])


def _levi_civita() -> np.ndarray:
    signs = np.zeros((3, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        signs[i, j, k], signs[i, k, j] = 1.0, -1.0
    return signs


def _hamilton() -> np.ndarray:
    """Return the signs of the products of quaternions (e0, e): ``p0 q0 - p.q`` and ``p0 q + q0 p + p x q``."""
    signs = np.zeros((4, 4, 4))
    signs[0, 0, 0] = 1.0
    for k in (1, 2, 3):
        signs[0, k, k], signs[k, 0, k], signs[k, k, 0] = -1.0, 1.0, 1.0
    signs[1:, 1:, 1:] = _levi_civita()
    return signs


_LEVI_CIVITA, _HAMILTON = _levi_civita().reshape(3, 9), _hamilton().reshape(4, 16)
