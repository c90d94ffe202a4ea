"""The mechanism as the user states it: named bodies, joints, drivers, outputs and parameters; frozen."""

import dataclasses
import re
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from jounce.base.display import Displayed
from jounce.base.modules import read_only
from jounce.constraints import AbstractConstraint
from jounce.errors import ExpressionError, JounceError, MechanismError, check_choice, check_name
from jounce.forces import AbstractForce
from jounce.mechanism.carriages import with_carriages
from jounce.mechanism.outputs.base import AbstractQuantity
from jounce.mechanism.outputs.derivative_outputs import bound
from jounce.mechanism.redundant_reactions import RedundantReactions, check_redundant_reactions
from jounce.mechanism.resolve import parameter_value
from jounce.mechanism.stated_units import check_stated_units
from jounce.rigid.inertia import Inertia
from jounce.trajectory import Expression
from jounce.units.dimensions import Dimension, check_one_of
from jounce.units.expression import check_parameter_name
from jounce.units.shown_units import ShownUnits
from jounce.units.values import Value, parse_value, stated_dimensions

GROUND = "ground"
CLASSES = {"outputs": AbstractQuantity, "forces": AbstractForce}  # other kinds contain constraints
RESERVED_OUTPUTS = tuple("time derivative component euler_parameter euler_angle row_axis column_axis parameter".split())
"""Axes of a result."""
NEAREST = "nearest"
SIDES = {"above": (-1, 1), "below": (-1, -1), "right": (0, 1), "left": (0, -1)}
"""Sides on which a body may be requested to lie: a component of the global frame, and its sign."""
MAPPINGS = ("bodies", "joints", "drivers", "forces", "initial", "outputs", "parameters", "units", "dimensions")
RATE_COLUMN = re.compile(r".*_d[0-9]+", re.DOTALL)


@dataclasses.dataclass(frozen=True)
class Body:
    """A rigid body: the starting guess of its pose, and its mass properties if forces are requested.

    Parameters
    ----------
    position : sequence
        Starting guess of the origin of the body frame in the global frame, (2,) or (3,), m.
    angle : number or expression, default 0
        Starting guess of the angle of a planar body, rad.
    orientation : sequence of 4 numbers, or dict, optional
        Starting guess of the Euler parameters [e0, e1, e2, e3] of a spatial body, normalized when used; or
        ``{"axis": [x, y, z], "angle": ...}``, or ``{"euler": "zxz", "angles": [...]}`` (lower-case letters for fixed
        axes, upper-case ones for those of the body), rad. Numbers may be expressions of the parameters.
    mass : number or expression, optional
        Mass, kg; kinematics does not use it.
    inertia : number, sequence, expression or Inertia, optional
        Moment of inertia about the center of mass, kg m^2: one number in the plane; in space three principal moments
        along the axes of the body, or a symmetric matrix in these axes. An `Inertia` gives the mass and the center of
        mass too.
    center_of_mass : sequence, optional
        Center of mass in the frame of the body, m; the origin of the frame by default.

    Raises
    ------
    MechanismError
        If a mass or a center of mass is given beside an `Inertia`.

    Examples
    --------
    >>> import jounce as jn
    >>> jn.Body([0, 0], inertia=jn.Inertia.solid("rod", length=0.6, mass=2.0)).inertia  # about z in the plane
    0.06
    """

    position: Any
    angle: Any = 0.0
    orientation: Any = None
    mass: Any = None
    inertia: Any = None
    center_of_mass: Any = None

    def __post_init__(self):
        if isinstance(self.inertia, Inertia):
            if self.mass is not None or self.center_of_mass is not None:
                message = "an Inertia contains the mass and the center of mass; do not give them besides"
                raise MechanismError(message, name="inertia")
            inertia, planar = self.inertia, len(self.position) == 2
            tensor = float(inertia.tensor[2, 2]) if planar else inertia.tensor
            derived = {"mass": inertia.mass, "center_of_mass": inertia.center_of_mass[: 2 if planar else 3]}
            for name, value in {**derived, "inertia": tensor}.items():
                object.__setattr__(self, name, value)


class Carriage(Body):
    """A massless body for the hidden coordinates of a joint, such as the parameter of a curve: see `carriages`."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Mechanism(Displayed):
    """Bodies, the joints and drivers between them, and outputs of their motion.

    Parameters
    ----------
    space : str
        ``"planar"`` or ``"spatial"``.
    bodies : dict of str to Body
        The moving bodies; the body ``"ground"`` always exists beside them.
    joints, drivers : dict of str to AbstractConstraint
        Constraints by name. Their values may be numbers (SI), or expressions of the parameters, which alone state
        units.
    forces : dict of str to AbstractForce, optional
        Applied forces and torques, by name; they do not affect prescribed motion.
    initial : dict of str to AbstractConstraint, optional
        Drivers at the start of a simulation only: their laws give the initial position and velocity.
    outputs : dict of str to AbstractQuantity, optional
        Requested quantities, by name.
    parameters : dict of str to number or str, optional
        Named values: numbers (SI), or text as in a file: a number with a unit, or an expression of the others. A unit
        must suit the use of the parameter.
    gravity : sequence, optional
        Acceleration of free fall in the global frame, (2,) or (3,), m/s^2; zero unless given.
    time : array_like, optional
        The instants at which `jounce.solve` solves by default, s.
    redundant_reactions : str or dict of str to dict, default "unique"
        Choice of reactions where constraints are redundant: ``"unique"`` gives the unique reactions, and NaN for the
        others; ``"least_norm"`` gives those with the least sum of squares of the forces of all constraint rows, and of
        their couples over the size of the mechanism; stiffnesses give those of elastic joints: by the name of a joint,
        ``force``, N/m, and ``torque``, N m/rad; a joint or a direction without stiffness is rigid.
    title : str, optional
        One line for tables and figures.
    units : dict of str to str, optional
        Units of shown and written results, by ``angle``, ``length``, ``force``, ``torque``, ``energy``, ``power``, or
        the name of an output. Values inside, and those of `Motion`, are in SI.
    assembly : int, str or dict, optional
        Choice among several assemblies, if the one to which the iteration from the starting guess converges will not
        do: its number as `jounce.assemblies` counts, ``"nearest"`` for the nearest to the guess, or for some bodies
        ``"above"``, ``"below"``, ``"left"`` or ``"right"``: the middle of the joints of the body lies farthest that
        way.
    dimensions : dict of str to tuple of Dimension, optional
        Dimensions that parameters may have, if known: for a mechanism from a file, by their units and use.
    stated : frozenset of str, optional
        Names of the parameters that were given with a unit, and are written with one.

    Raises
    ------
    MechanismError
        If a name is missing, used twice or reserved, or a joint does not fit the space.

    Examples
    --------
    >>> import jounce as jn
    >>> crank = jn.Mechanism(
    ...     space="planar",
    ...     parameters={"speed": 2.0},
    ...     bodies={"crank": jn.Body(position=[0.0, 0.0])},
    ...     joints={"O": jn.planar.Revolute(("ground", "crank"), point_i=[0, 0], point_j=[0, 0])},
    ...     drivers={"theta": jn.drivers.CoordinateDriver(("ground", "crank"), "angle", motion="speed*t")},
    ...     outputs={"tip": jn.outputs.PointOutput("crank", point=[0.1, 0.0])},
    ... )
    >>> motion = jn.solve(crank, [0.0, 0.1], order=1)
    >>> float(motion.dataset["tip"].sel(component="y", derivative=1)[0])
    0.2
    """

    space: str
    bodies: Mapping[str, Body]
    joints: Mapping[str, AbstractConstraint]
    drivers: Mapping[str, AbstractConstraint] = dataclasses.field(default_factory=dict)
    forces: Mapping[str, AbstractForce] = dataclasses.field(default_factory=dict)
    initial: Mapping[str, AbstractConstraint] = dataclasses.field(default_factory=dict)
    outputs: Mapping[str, AbstractQuantity] = dataclasses.field(default_factory=dict)
    parameters: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    gravity: Any = None
    time: Any = None
    redundant_reactions: RedundantReactions = "unique"
    title: str = ""
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    assembly: Any = None
    dimensions: Mapping[str, tuple[Dimension, ...]] = dataclasses.field(default_factory=dict, compare=False, repr=False)
    stated: frozenset[str] = dataclasses.field(default=frozenset(), compare=False, repr=False)

    def __post_init__(self):
        check_choice("space", self.space, ("planar", "spatial"), MechanismError)
        if not isinstance(self.title, str):
            raise MechanismError("must be text", name="title", value=self.title)
        for name in MAPPINGS:
            if not isinstance(value := getattr(self, name), Mapping):
                raise MechanismError("must be a dictionary, with a name for each entry", name=name, value=value)
        object.__setattr__(self, "bodies", with_carriages(self.bodies, self.joints, Carriage))
        if not self.bodies:
            raise MechanismError("a mechanism needs at least one moving body", name="bodies", value=dict(self.bodies))
        self._check_names()
        texts = {name: value for name, value in self.parameters.items() if isinstance(value, str)}
        before = {name: allowed[0] for name, allowed in self.dimensions.items() if len(allowed) == 1}
        known_dimensions = stated_dimensions(texts, before) if texts else before
        if texts:
            read = {name: self._read(name, text, known_dimensions) for name, text in texts.items()}
            object.__setattr__(self, "parameters", {**self.parameters, **{n: x.value for n, x in read.items()}})
            object.__setattr__(self, "stated", self.stated | {n for n, x in read.items() if x.dimension is not None})
        object.__setattr__(self, "outputs", bound(self.outputs, self))
        check_redundant_reactions(self.redundant_reactions, (*self.joints, *self.drivers))
        self._check_assembly()
        for kind, elements in self.elements.items():
            for name, element in elements.items():
                self._check_element(kind, name, element)
        self._check_columns()
        if new := {name: (x,) for name, x in known_dimensions.items() if name not in self.dimensions}:
            check_stated_units(self, known_dimensions)
            object.__setattr__(self, "dimensions", {**self.dimensions, **new})
        _ = self.shown_units
        for name in MAPPINGS:
            way = "with_parameters" if name == "parameters" else "dataclasses.replace"
            object.__setattr__(self, name, read_only(getattr(self, name), f"{way} gives another mechanism"))

    def __repr__(self) -> str:
        kinds = {"bodies": self.rigid_bodies, **self.elements}
        counts = ", ".join(f"{kind} {len(members)}" for kind, members in kinds.items() if members)
        return f"<Mechanism {self.title}{': ' if self.title else ''}{self.space}; {counts}>"

    @property
    def rigid_bodies(self) -> dict[str, Body]:
        """The moving bodies except for carriages, which carry the hidden coordinates of joints."""
        return {name: body for name, body in self.bodies.items() if not isinstance(body, Carriage)}

    @property
    def shown_units(self) -> ShownUnits:
        """The units in which results are shown and written."""
        return ShownUnits(self.units, {name: output.unit for name, output in self.outputs.items()})

    def _check_names(self) -> None:
        for name, body in self.bodies.items():
            check_body_name(name, MechanismError, name=f"bodies.{name}")
            if not isinstance(body, Body):
                raise MechanismError("must be a Body", name=f"bodies.{name}", value=body)
        for name in self.parameters:
            check_parameter_name(name, MechanismError, name=f"parameters.{name}")
        for name in self.outputs:
            check_output_name(name, MechanismError, name=f"outputs.{name}")
        for name in self.joints.keys() & self.drivers.keys():
            raise MechanismError("a joint and a driver have the same name", name=f"drivers.{name}")
        for kind in ("joints", "drivers"):
            for name in self.initial.keys() & getattr(self, kind).keys():
                raise MechanismError(
                    f"a {kind[:-1]} and an initial condition have the same name", name=f"initial.{name}"
                )

    def _check_assembly(self) -> None:
        assembly = self.assembly
        if isinstance(assembly, Mapping) and assembly:
            for body, side in assembly.items():
                check_name("body", body, tuple(self.bodies), MechanismError, name=f"assembly.{body}")
                check_choice(f"assembly.{body}", side, tuple(SIDES), MechanismError)
            return
        named = isinstance(assembly, str) and assembly == NEAREST
        if not (named or assembly is None or (type(assembly) is int and assembly > 0)):
            message = f"must be a number from 1, {NEAREST}, or for bodies one of {', '.join(SIDES)}"
            raise MechanismError(message, name="assembly", value=assembly)

    def _check_element(self, kind: str, name: str, element: Any) -> None:
        location = f"{kind}.{name}"
        expected = CLASSES.get(kind, AbstractConstraint)
        if not isinstance(element, expected):
            classes = "drivers" if kind == "initial" else kind
            raise MechanismError(f"must be one of the classes of {classes}", name=location, value=element)
        if kind == "initial" and element.role != "driver":
            message = "an initial condition is given by a driver"
            raise MechanismError(message, name=location, value=element.type_name or type(element).__name__)
        if kind == "forces" and not set(element.bodies) - {GROUND}:
            raise MechanismError("acts on the ground alone, which never moves", name=f"{location}.bodies")
        self.check_fit(element, location)
        if kind == "outputs":
            try:
                element.check(self)
            except MechanismError as error:
                error.name = f"{location}.{error.name}"  # the output names its field only
                raise

    def _check_columns(self) -> None:
        """Raise MechanismError if columns of outputs in a table have the same name: a point C and an angle C_x."""
        for name in self.outputs:
            stem, _, label = name.rpartition("_")
            if stem in self.outputs and label in self.outputs[stem].component_labels(self):
                message = f"this name is taken by a component of the output '{stem}'; give another one"
                raise MechanismError(message, name=f"outputs.{name}")

    def check_fit(self, element: AbstractConstraint | AbstractForce | AbstractQuantity, location: str) -> None:
        """Raise MechanismError unless an element suits the space of the mechanism and names existing bodies."""
        if element.space and element.space != self.space:
            raise MechanismError(f"is {element.space}, in a {self.space} mechanism", name=location)
        for body in getattr(element, "bodies", ()):
            if body not in self.bodies:
                check_name("body", body, (GROUND, *self.bodies), MechanismError, name=f"{location}.bodies")

    @property
    def elements(self) -> dict[str, Mapping[str, Any]]:
        """Joints, drivers, forces, initial conditions and outputs, by kind."""
        return {kind: getattr(self, kind) for kind in MAPPINGS[1:6]}

    @cached_property
    def parameter_values(self) -> dict[str, Any]:
        """Values of all parameters, including those given by expressions of others.

        Raises
        ------
        MechanismError
            If a value is not one finite number, or expressions form a circle.
        """
        values = {k: parameter_value(k, v) for k, v in self.parameters.items() if not isinstance(v, Expression)}
        pending = {k: v for k, v in self.parameters.items() if isinstance(v, Expression)}
        while pending:
            ready = [k for k, v in pending.items() if v.names <= values.keys()]
            for name in ready:
                try:
                    values[name] = pending.pop(name).evaluate(values)
                except ExpressionError as error:
                    raise error.located(name=f"parameters.{name}") from None
            if not ready:
                name, expression = next(iter(pending.items()))
                try:
                    expression.check(self.parameters)
                except ExpressionError as error:
                    raise error.located(name=f"parameters.{name}") from None
                message = f"parameters depend on each other in a circle: {', '.join(pending)}"
                raise MechanismError(message, name=f"parameters.{name}")
        return values

    @cached_property
    def checked_intervals(self) -> set[tuple[float, float]]:
        """First and last instants, s, of the intervals in which the laws were checked for likely degrees."""
        return set()

    def with_parameters(self, **values: Any) -> "Mechanism":
        """Return the mechanism with other values of some parameters.

        Solving it does not compile anything again.

        Parameters
        ----------
        **values
            By name of the parameter: a number (SI), or text as in a file: a number with a unit, or an expression of
            the other parameters.

        Raises
        ------
        MechanismError
            If a parameter does not exist.
        UnitError, ExpressionError
            If a text is no value, or a value of another dimension than the parameter has in the file.

        Examples
        --------
        >>> import jounce as jn
        >>> mechanism = jn.load("examples/four_bar.yaml")
        >>> mechanism.with_parameters(BC="11 cm").parameters["BC"]
        0.11
        """
        for name in values:
            check_name("parameter", name, self.parameters, MechanismError, name="parameters")
        return dataclasses.replace(self, parameters={**self.parameters, **values})

    def _read(self, name: str, text: str, dimensions: Mapping[str, Dimension]) -> Value:
        """Read a parameter given as text, and check it against the dimensions that it may have."""
        other_names = [other for other in self.parameters if other != name]
        allowed = self.dimensions.get(name, ())
        try:
            given = parse_value(text, "any", other_names, dimensions)
            if allowed and given.dimension is not None:
                check_one_of(given.dimension, allowed, exactly=not isinstance(given.value, Expression))
        except JounceError as error:
            raise error.located(name=f"parameters.{name}", value=text) from None
        return given


def names_column(name: str) -> bool:
    """Return whether a name is reserved for an axis of results or for a rate in tables, and no output may have it."""
    return name in RESERVED_OUTPUTS or RATE_COLUMN.fullmatch(name) is not None


def check_body_name(given: object, error: type[JounceError], **location: Any) -> None:
    """Raise an error unless a moving body may have a name; `location` says where the name is given."""
    if given == GROUND:
        raise error("the body 'ground' always exists and never moves; give another name", **location)


def check_output_name(given: object, error: type[JounceError], **location: Any) -> None:
    """Raise an error unless an output may have a name; `location` says where the name is given.

    Spaces, brackets and quotes are allowed, as in tables. Mechanism files allow less.
    """
    if not isinstance(given, str) or not given:
        raise error("the name of an output is text that is not empty", value=given, **location)
    if names_column(given):
        rate = RATE_COLUMN.fullmatch(given) is not None
        reason = f", where '_d' and a number mean a derivative of '{given.rpartition('_d')[0]}'" if rate else ""
        raise error(f"the name '{given}' is reserved for columns of the results{reason}; give another one", **location)


def check_mechanism(given: object) -> None:
    """Raise MechanismError unless the argument is a mechanism, not, for example, a file name."""
    if not isinstance(given, Mechanism):
        raise MechanismError("must be a jn.Mechanism; jn.load reads one from a file", name="mechanism", value=given)
