"""Mass, center of mass and inertia of a rigid body, and their sums. Negrean 2025, equations 72 and 109."""

import dataclasses
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jounce.base.shapes import ArrayLike, Numbers, Real, Refused, by_component, real_numbers
from jounce.errors import JounceError, RobotError, check_choice, did_you_mean
from jounce.rigid.solids import SOLIDS, pseudo_parts, solid_moments

ROUNDING = 1e-5  # fraction of the largest principal moment: error of possible tensors in files with six digits
MOST_SHOWN = 9  # numbers shown in a message
ADVICE = "check the units, the signs of the products of inertia and the axes"
WITHOUT_MASS = "has moments of inertia but no mass"
NEGATIVE = "has a negative principal moment"
TRIANGLE = "breaks the triangle inequality: the largest principal moment exceeds the sum of the others"


class Fault(NamedTuple):
    """A fault of an inertia: its description, and the value that shows it."""

    words: str
    value: Any


@dataclasses.dataclass(frozen=True, eq=False)
class Inertia:
    """Mass distribution of a rigid body, in the frame of that body.

    Parameters
    ----------
    mass : float
        Mass, kg, greater than zero.
    center_of_mass : array_like of shape (3,), default zero
        Center of mass in the frame of the body, m.
    tensor : array_like of shape (3, 3) or (3,), default zero
        Inertia about the center of mass, in axes parallel to those of the body, kg m^2; three numbers are its
        diagonal. Zero is a point mass.
    strict : bool, default True
        Whether to refuse values that no real body has. Otherwise everything is computed with the numbers as they are,
        and `fault` describes what is wrong with them; the mass may then be zero. Deviations up to 1e-5 of the largest
        moment count as rounding.

    Raises
    ------
    RobotError
        If the mass is negative, a value is not finite, or the tensor is not symmetric; with `strict`, also if the mass
        is zero or the tensor has a negative principal moment, or one that exceeds the sum of the other two.

    Examples
    --------
    >>> import jounce as jn
    >>> rod = jn.Inertia(2.0, center_of_mass=[0.5, 0, 0], tensor=[0, 1 / 6, 1 / 6])
    >>> float(rod.about_origin[2, 2])
    0.6666666666666666
    """

    mass: float
    center_of_mass: Any = (0.0, 0.0, 0.0)
    tensor: Any = (0.0, 0.0, 0.0)
    strict: dataclasses.InitVar[bool] = True

    def __post_init__(self, strict: bool) -> None:
        for name, shapes in (("mass", ((),)), ("center_of_mass", ((3,),)), ("tensor", ((3, 3), (3,)))):
            object.__setattr__(self, name, vector_numbers(name, getattr(self, name), *shapes))
        object.__setattr__(self, "mass", float(self.mass))
        if self.tensor.shape == (3,):
            object.__setattr__(self, "tensor", unchanging(np.diag(self.tensor)))
        if self.mass < 0 or (strict and self.mass == 0):
            raise RobotError("must be greater than zero", name="mass", value=self.mass)
        if not np.allclose(self.tensor, self.tensor.T, rtol=0, atol=1e-9 * float(np.abs(self.tensor).max())):
            raise RobotError("must be symmetric", name="inertia", value=self.tensor.tolist())
        if strict and (fault := self.fault):
            message = f"{fault.words}; {ADVICE}, or compute with the numbers as they are, by strict=False"
            raise RobotError(message, name="inertia", value=fault.value)

    @property
    def fault(self) -> "Fault | None":
        """Fault of mass and tensor by which no real body has them; None if there is none."""
        smallest, middle, largest = (float(x) for x in np.linalg.eigvalsh(self.tensor))
        if not self.mass and self.tensor.any():
            return Fault(WITHOUT_MASS, self.tensor.tolist())
        if smallest < -ROUNDING * max(largest, -smallest):
            return Fault(NEGATIVE, smallest)
        if largest - smallest - middle > ROUNDING * largest:
            return Fault(TRIANGLE, [smallest, middle, largest])
        return None

    @property
    def about_origin(self) -> np.ndarray:
        """Inertia tensor about the origin of the frame of the body, (3, 3), kg m^2."""
        return self.tensor + _of_point(self.mass, self.center_of_mass)

    @property
    def second_moments(self) -> np.ndarray:
        """Integral of rho rho^T dm about the center of mass, (3, 3), kg m^2: Negrean 2025, equation 109."""
        return np.trace(self.tensor) / 2 * np.eye(3) - self.tensor

    @property
    def pseudo_inertia(self) -> np.ndarray:
        """Second moments about the origin of the frame, first moments and mass, (4, 4), as `trace(T' J T'^T)` needs."""
        c = np.append(self.center_of_mass, 1.0)
        moments = np.zeros((4, 4))
        moments[:3, :3] = self.second_moments
        return moments + self.mass * np.outer(c, c)

    def moved(self, position: ArrayLike, rotation: ArrayLike) -> "Inertia":
        """Return the inertia of the same body in another frame.

        Parameters
        ----------
        position : array_like of shape (3,)
            Origin of the body's frame in the other frame, m.
        rotation : array_like of shape (3, 3)
            Rotation matrix from the body's frame to the other frame.
        """
        position, rotation = np.asarray(position, float), np.asarray(rotation, float)
        tensor = rotation @ self.tensor @ rotation.T
        return type(self)(self.mass, position + rotation @ self.center_of_mass, (tensor + tensor.T) / 2, strict=False)

    @classmethod
    def solid(
        cls,
        kind: str,
        *,
        mass: Real | None = None,
        density: Real | None = None,
        axis: str = "",
        center_of_mass: ArrayLike = (0.0, 0.0, 0.0),
        **sizes: ArrayLike,
    ) -> "Inertia":
        """Return the inertia of a homogeneous solid.

        Parameters
        ----------
        kind : str
            ``"box"`` (size: three edges along x, y and z), ``"sphere"`` (radius), ``"cylinder"`` (radius, length),
            ``"tube"`` (radius, inner_radius, length), ``"capsule"`` (radius, length between the half spheres),
            ``"cone"`` (radius, length), ``"ellipsoid"`` (size: three diameters), or thin: ``"rod"`` (length),
            ``"disc"`` (radius).
        mass, density : float
            Mass, kg, or density, kg/m^3: exactly one of them; thin solids take a mass.
        axis : str, optional
            ``"x"``, ``"y"`` or ``"z"`` of the body, along which a rod (x by default), cylinder, tube, capsule, cone,
            or the normal of a disc (z by default) stands.
        center_of_mass : array_like of shape (3,), default zero
            Center of mass in the frame of the body, m.
        **sizes
            Sizes, m.

        Raises
        ------
        RobotError
            If the kind, the axis or a size does not exist, a size is missing, or a value is not greater than zero.

        Examples
        --------
        >>> import jounce as jn
        >>> shaft = jn.Inertia.solid("cylinder", radius=0.02, length=0.3, density=7850)
        >>> round(shaft.mass, 6)
        2.95938
        """
        sizes = {name: by_component(name, value, RobotError) for name, value in sizes.items()}
        axis = check_solid(kind, axis, {**sizes, "mass": mass, "density": density})
        volume, moments = solid_moments(kind, axis, sizes)
        mass = float(density * volume if mass is None else mass)
        return cls(mass, center_of_mass, np.array(moments, float) * mass)

    @classmethod
    def from_pseudo(cls, pseudo: ArrayLike, strict: bool = True) -> "Inertia":
        """Return the inertia with a given pseudo-inertia matrix: the inverse of `pseudo_inertia`.

        Parameters
        ----------
        pseudo : array_like of shape (4, 4)
            Second moments about the origin of the frame, kg m^2, first moments, kg m, and mass, kg.
        strict : bool, default True
            Whether to refuse values that no real body has.

        Raises
        ------
        RobotError
            If the matrix is not symmetric, the mass is not greater than zero, or no real body has such moments.

        Examples
        --------
        >>> import jounce as jn
        >>> ball = jn.Inertia(2.0, center_of_mass=[0.5, 0, 0], tensor=[0.1, 0.1, 0.1])
        >>> jn.Inertia.from_pseudo(ball.pseudo_inertia).tensor.diagonal().round(12).tolist()
        [0.1, 0.1, 0.1]
        """
        pseudo = finite_numbers("pseudo", pseudo, (4, 4))
        if not np.allclose(pseudo, pseudo.T, rtol=0, atol=1e-9 * float(np.abs(pseudo).max())):
            raise RobotError("must be symmetric", name="pseudo", value=pseudo.tolist())
        if pseudo[3, 3] <= 0:
            raise RobotError("must be greater than zero", name="mass", value=float(pseudo[3, 3]))
        with np.errstate(all="ignore"):  # overflow is refused below
            mass, center, second = pseudo_parts(pseudo)
            moments = np.array(second)
            tensor = np.trace(moments) * np.eye(3) - (moments / 2 + moments.T / 2)
        return cls(float(mass), center, tensor, strict)

    @classmethod
    def total(cls, parts: Iterable["Inertia"]) -> "Inertia":
        """Return the inertia of several bodies fixed together, all given in one frame.

        Raises
        ------
        RobotError
            If there are none.
        """
        parts = list(parts)
        if not parts:
            raise RobotError("the sum of inertias needs at least one", name="parts", value=parts)
        traced = next((type(part) for part in parts if isinstance(part, TracedInertia)), None)
        mass = sum(part.mass for part in parts)
        center = sum(part.mass * part.center_of_mass for part in parts) / (mass if traced else mass or 1.0)
        tensor = sum(part.tensor + _of_point(part.mass, part.center_of_mass - center) for part in parts)
        return (traced or cls)(mass, center, tensor, strict=False)


def _of_point(mass: Any, position: Float[Numbers, " 3"]) -> Float[Numbers, "3 3"]:
    """Return the inertia tensor of a point mass, as in the parallel-axis theorem (Steiner)."""
    return mass * (position @ position * np.eye(3) - position[:, None] * position[None])


@dataclasses.dataclass(frozen=True, eq=False)
class TracedInertia(Inertia):
    """An inertia with values that JAX traces, for gradients; only its shapes are checked."""

    mass: Any

    def __post_init__(self, strict: bool) -> None:
        for name, shape in (("mass", ()), ("center_of_mass", (3,)), ("tensor", (3, 3))):
            value = jnp.asarray(getattr(self, name), float)
            if name == "tensor" and value.shape == (3,):
                value = jnp.diag(value)
            if value.shape != shape:
                raise RobotError(f"must have the shape {shape}, not {value.shape}", name=name)
            object.__setattr__(self, name, value)

    @property
    def fault(self) -> "Fault | None":
        """None, since traced values cannot be checked."""
        return None


def check_solid(kind: str, axis: str, values: dict[str, Any]) -> str:
    """Return the axis of a solid, by default its own, after checking kind, axis, sizes and mass or density.

    Raises
    ------
    RobotError
        If an entry does not fit.
    """
    check_choice("solid", kind, SOLIDS, RobotError)
    solid = SOLIDS[kind]
    valid = (*solid.sizes, "mass", "density")
    for name in values:
        if name not in valid:
            raise RobotError(f"a {kind} has no such size; {did_you_mean(name, valid)}", name=name)
    for name in solid.sizes:
        if values.get(name) is None:
            raise RobotError("is missing", name=name)
    mass, density = values.get("mass"), values.get("density")
    thin = kind in ("rod", "disc")
    if mass is None and density is None:
        raise RobotError(f"a {kind} needs a mass{'' if thin else ' or a density'}", name="mass")
    if density is not None and thin:
        raise RobotError(f"a {kind} is thin and has no volume; give its mass", name="density", value=density)
    if mass is not None and density is not None:
        raise RobotError(f"a {kind} takes a mass or a density, not both", name="density", value=density)
    if axis and (not solid.axis or axis not in ("x", "y", "z")):
        message = "the axis is x, y or z" if solid.axis else f"a {kind} has no axis"
        raise RobotError(message, name="axis", value=axis)
    _check_sizes({name: value for name, value in values.items() if value is not None})
    return axis or solid.axis


def _check_sizes(values: dict[str, Any]) -> None:
    for name, value in values.items():
        numbers = finite_numbers(name, value, (3,) if name == "size" else ())
        if not (numbers > 0).all() and name != "inner_radius":
            raise RobotError("must be greater than zero", name=name, value=numbers.tolist())
    if "inner_radius" in values and not 0 <= values["inner_radius"] < values["radius"]:
        message = "the inner radius of a tube is at least zero and less than its radius"
        raise RobotError(message, name="inner_radius", value=float(values["inner_radius"]))


def finite_numbers(
    name: str,
    value: ArrayLike | Refused,
    *shapes: tuple[int, ...],
    error: type[JounceError] = RobotError,
    read: Callable[..., np.ndarray] = real_numbers,
) -> np.ndarray:
    """Return a read-only copy of finite numbers that has one of the shapes, or any shape if none is given.

    Raises
    ------
    RobotError
        Or `error`, if the value is not made of real numbers, has another shape, or has a number that is not finite.
    """
    array = np.array(read(name, value, error))
    if shapes and array.shape not in shapes:
        expected = " or ".join(map(str, shapes))
        raise error(f"must have the shape {expected}, not {array.shape}", name=name)
    bad = array[~np.isfinite(array)]
    if bad.size:  # of a large array, the message shows the first bad number
        raise error("must be finite", name=name, value=array.tolist() if array.size <= MOST_SHOWN else bad[0].item())
    return unchanging(array)


def vector_numbers(
    name: str, value: ArrayLike | Refused, *shapes: tuple[int, ...], error: type[JounceError] = RobotError
) -> np.ndarray:
    """Return the components of a vector or tensor as `finite_numbers` does, ordered by labels if it has some."""
    return finite_numbers(name, by_component(name, value, error), *shapes, error=error)


def unchanging(array: np.ndarray) -> np.ndarray:
    """Return an array made read-only, as values computed from it would not follow a change."""
    array.setflags(write=False)
    return array
