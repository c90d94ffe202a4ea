"""The check of a class of joints or drivers against the contracts of joints."""

import dataclasses
import inspect
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from jounce.constraints import AbstractConstraint
from jounce.constraints.base import SPACES
from jounce.constraints.facts import facts_of
from jounce.errors import ContractError, MechanismError, check_choice, check_name, whole_number
from jounce.testing.forms import back_ends, copies, files
from jounce.testing.positions import facts, rank
from jounce.testing.reactions import equilibrium
from jounce.testing.residuals import derivatives, expressions, frames, instances, jacobian, one_program
from jounce.testing.samples import Samples
from jounce.testing.subject import Broken, SkippedContract, Subject

CONTRACTS: Mapping[str, Callable[[Subject], None]] = MappingProxyType(
    {
        "jacobian": jacobian,
        "derivatives": derivatives,
        "frames": frames,
        "instances": instances,
        "expressions": expressions,
        "one program": one_program,
        "rank": rank,
        "facts": facts,
        "equilibrium": equilibrium,
        "copies": copies,
        "files": files,
        "back ends": back_ends,
    }
)
"""Checks of the contracts that every joint of the library keeps, by name."""


@dataclasses.dataclass(frozen=True)
class JointReport:
    """The result of a check of a class of joints or drivers.

    Parameters
    ----------
    kind : type
        The class.
    held : tuple of str
        Names of the contracts that the class keeps.
    left_out : mapping of str to str
        Reason why a contract does not apply, or not completely, by the name of the contract.

    Examples
    --------
    >>> from jounce import planar
    >>> from jounce.testing import check_joint
    >>> report = check_joint(planar.Revolute, contracts=["expressions", "files"])
    >>> report.held, dict(report.left_out)
    (('expressions', 'files'), {})
    """

    kind: type[Any]
    held: tuple[str, ...]
    left_out: Mapping[str, str]

    def __str__(self) -> str:
        lines = [f"{self.kind.__qualname__} keeps: {', '.join(self.held)}"]
        return "\n".join([*lines, *(f"{name}: {reason}" for name, reason in self.left_out.items())])


def check_joint(
    kind: type[Any],
    *,
    values: Mapping[str, Any] | None = None,
    space: str = "",
    order: int = 6,
    relative: bool = True,
    equations: int | None = None,
    period: str | float | None = None,
    optional: bool = False,
    bodies: int | None = None,
    contracts: Sequence[str] | None = None,
    seed: int = 0,
) -> JointReport:
    """Check a class of joints or drivers against the contracts that joints and drivers of the library keep.

    The checks use joints of the class with random values between bodies in random motions:

    - ``jacobian``: at each order, the residual is affine in the coordinates of that order; the slope is the Jacobian,
      which agrees with differences;
    - ``derivatives``: derivatives along a motion are those of a polynomial through values of the residual;
    - ``frames``: a common motion of all bodies does not change the residual;
    - ``instances``: joints evaluated together have the same residuals as each joint by itself;
    - ``expressions``: values may be expressions of parameters;
    - ``one program``: other values need no further compilation;
    - ``rank``: at a position where the joint holds, it has as many independent equations as rows;
    - ``facts``: `held_parallel`, `squared_distance`, `point_distance`, `pair` and `dimensions` of the class are true;
    - ``equilibrium``: the reactions have no resultant, and their power is that of the multipliers on the residual;
    - ``copies``: copies and pickles are equal, with the same hash;
    - ``files``: writing the joint to a file and reading it again gives the same joint;
    - ``back ends``: machine code, XLA, and evaluation one operation after another agree.

    Parameters
    ----------
    kind : type
        The class, derived from `AbstractConstraint`.
    values : mapping, optional
        Values of fields that must not be random: words, or lengths with which the joint can hold.
    space : str, optional
        ``planar`` or ``spatial``, if the class does not define it.
    order : int
        Highest derivative of the residual to check.
    relative : bool
        Whether the joint depends only on the relative poses of its bodies.
    equations : int, optional
        Number of independent equations of the joint, if it differs from the number of rows.
    period : str or float, optional
        Period of the last row, if the row is known up to whole periods: a number, or the name of its field; 2 pi if the
        class is `periodic`.
    optional : bool
        Whether optional fields have values, too.
    bodies : int, optional
        Number of connected bodies, if the class allows several numbers; the first of these numbers unless given.
    contracts : sequence of str, optional
        Names of the contracts to check; all unless given.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    JointReport
        Contracts that the class keeps, and those that do not apply.

    Raises
    ------
    ContractError
        If the class breaks a contract; the message names the contract and the failure.
    MechanismError
        If the class states an impossible fact, or values do not fit.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.testing import check_joint
    >>> report = check_joint(jn.planar.Rolling, contracts=["jacobian", "frames", "facts"])
    >>> print(report)
    Rolling keeps: jacobian, frames, facts
    """
    if not (isinstance(kind, type) and issubclass(kind, AbstractConstraint)):
        raise MechanismError("must be a class derived from jn.joints.AbstractConstraint", name="kind", value=kind)
    if inspect.isabstract(kind):
        raise MechanismError("defines no method residual(self, body_i, body_j, time)", name="kind", value=kind)
    if not (kind.space or space):
        message = "the class says neither planar nor spatial: state space= here, or as an argument of the class"
        raise MechanismError(message, name="space", value=kind)
    space = space or kind.space
    check_choice("space", space, (kind.space,) if kind.space else SPACES, MechanismError)
    whole_number("order", order, 1, error=MechanismError)
    chosen = tuple(CONTRACTS) if contracts is None else tuple(contracts)
    for name in chosen:
        check_name("contract", name, CONTRACTS, MechanismError, name="contracts")
    for name in values or {}:
        check_name("field", name, facts_of(kind).signs, MechanismError, name="values")
    samples = Samples(kind, space, dict(values or {}), optional, bodies)
    subject = Subject(samples, order, relative, period, equations, seed)
    fulfilled, left_out = [], {}
    for name in chosen:
        try:
            CONTRACTS[name](subject)
        except Broken as wrong:
            raise ContractError(f"{kind.__module__}.{kind.__qualname__}: {name}: {wrong}") from None
        except SkippedContract as reason:
            left_out[name] = str(reason)
        else:
            fulfilled.append(name)
    return JointReport(kind, tuple(fulfilled), MappingProxyType(left_out))
