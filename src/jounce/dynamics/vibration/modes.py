"""Natural frequencies, damping ratios and mode shapes of small motions."""

from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Complex, Float

from jounce.base.display import Displayed
from jounce.dynamics.statics.eigenmodes import eigenmodes
from jounce.dynamics.statics.independent_coordinates import COLUMNS, Reduction
from jounce.dynamics.vibration.mode_motion import checked_amplitude, mode_motion
from jounce.errors import MechanismError, whole_number
from jounce.kinematics import Motion


class Modes(Displayed):
    """Natural motions of a mechanism about a state, the slowest first: ``y = shape exp(eigenvalue t)``.

    Each stands for a pair of conjugate eigenvalues, or for one real one. Where nothing is damped, a motion that grows
    stands for the one that dies away as fast too.

    Attributes
    ----------
    eigenvalues : numpy.ndarray of shape (modes,)
        1/s, complex; the real part is positive where the motion grows.
    angular_frequencies, frequencies : numpy.ndarray of shape (modes,)
        Natural ones, the size of the eigenvalue: rad/s, and Hz. Zero for motions that no force resists.
    damped_frequencies : numpy.ndarray of shape (modes,)
        At which the mechanism swings, Hz; zero where it does not.
    damping_ratios : numpy.ndarray of shape (modes,)
        Minus the real part over the size of the eigenvalue: 1 for motions that creep back, negative for those that
        grow, 0 for those without damping or stiffness.
    shapes : numpy.ndarray of shape (coordinates, modes)
        In the coordinates of the linearization, of unit modal mass; complex where there is damping.
    coordinates, bodies : tuple of str
        Names of these coordinates, and of the bodies that move.
    """

    def __init__(self, reduction: Reduction):
        self._reduction = reduction
        mass, damping, stiffness = (reduction.part(level) for level in (2, 1, 0))
        noise = reduction.noise(1), reduction.noise(0)
        self.eigenvalues, self.shapes = eigenmodes(mass, damping, stiffness, noise)
        self.coordinates, self.bodies = reduction.names, reduction.point.model.bodies

    def __len__(self) -> int:
        return len(self.eigenvalues)

    def __repr__(self) -> str:
        shown = ", ".join(f"{f:.4g}" for f in self.frequencies[:6])
        return f"<Modes {shown}{', ...' if len(self) > 6 else ''} Hz>"

    @property
    def angular_frequencies(self) -> Float[np.ndarray, " mode"]:
        """Natural angular frequencies, rad/s."""
        return np.abs(self.eigenvalues)

    @property
    def frequencies(self) -> Float[np.ndarray, " mode"]:
        """Natural frequencies, Hz."""
        return self.angular_frequencies / (2 * np.pi)

    @property
    def damped_frequencies(self) -> Float[np.ndarray, " mode"]:
        """Frequencies at which the mechanism swings, Hz."""
        return np.imag(self.eigenvalues) / (2 * np.pi)

    @property
    def damping_ratios(self) -> Float[np.ndarray, " mode"]:
        """Minus the real part over the size of the eigenvalues."""
        size = self.angular_frequencies
        return np.where(size > 0, -np.real(self.eigenvalues) / np.where(size > 0, size, 1.0), 0.0) + 0.0

    @property
    def kinds(self) -> tuple[str, ...]:
        """What each is: ``oscillation``, ``rigid`` (no force resists it), ``creeping`` back, or ``growing``."""
        return tuple(map(_kind, self.eigenvalues))

    @cached_property
    def body_shapes(self) -> Complex[np.ndarray, "mode body coordinate"]:
        """How each body moves in each mode: shifts of its origin, m, global, and turns about its own axes, rad.

        Of shape (modes, bodies, 3) in the plane: x, y, angle; (modes, bodies, 6) in space.
        """
        columns = (self._reduction.basis @ self.shapes) * self._reduction.point.scale[:, None]
        width = len(COLUMNS[self._reduction.point.mechanism.space])
        return columns.T.reshape(len(self), len(self.bodies), width)

    @cached_property
    def participation(self) -> Float[np.ndarray, "mode body"]:
        """Share of each body in the kinetic energy of each mode."""
        point = self._reduction.point
        columns = (self._reduction.basis @ self.shapes).T.reshape(len(self), len(self.bodies), -1)
        energy = np.einsum("mbi,ijb,mbj->mb", columns.conj(), point.masses, columns).real
        return energy / energy.sum(axis=1, keepdims=True)

    def motion(self, mode: int, amplitude: float = 0.1, *, duration: float | None = None, frames: int = 61) -> Motion:
        """Return a mode as a motion to be looked at: one swing about the equilibrium, its joints closed.

        Growth and decay are left out. It has the frames of an animation (`jounce.plot.animate`), and no derivatives.

        Parameters
        ----------
        mode : int
            Counted from 1, as in tables.
        amplitude : float, default 0.1
            Of the body that moves most, rad or sizes of the mechanism.
        duration : float, optional
            Of the swing, s: its period unless given, and 1 s where the mode does not swing.
        frames : int, default 61
            Number of instants; the last shows the same position as the first.

        Raises
        ------
        MechanismError
            If there is no such mode, a value is not valid, or it is a mode about a motion.
        SolveError
            If joints cannot be closed so far from the equilibrium.
        """
        k = whole_number("mode", mode, 1, len(self), error=MechanismError) - 1
        count = whole_number("frames", frames, 2, 10_000, error=MechanismError)
        point, amplitude = self._reduction.point, checked_amplitude(amplitude)
        if point.clock[1].any():
            raise MechanismError("modes about a motion cannot be shown, only those of an equilibrium", name="mode")
        swings = abs(self.damped_frequencies[k])
        period = 1.0 if not swings else 1.0 / swings
        if duration is not None and not (isinstance(duration, int | float) and 0 < duration < np.inf):
            raise MechanismError("must be greater than zero", name="duration", value=duration)
        instants = np.linspace(0.0, period if duration is None else duration, count)
        return mode_motion(self._reduction, self.shapes[:, k], amplitude, instants, f"mode {mode}")

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One row of a table for each mode: what it is, and what moves most by its kinetic energy."""
        most = [int(np.argmax(shares)) for shares in self.participation]
        values = zip(self.kinds, self.frequencies, self.damped_frequencies, self.damping_ratios, strict=True)
        return [
            {
                "mode": k + 1,
                "kind": kind,
                "frequency": float(natural),
                "damped_frequency": float(damped),
                "damping_ratio": float(ratio),
                "eigenvalue": complex(self.eigenvalues[k]),
                "moves_most": self.bodies[most[k]],
                "share": float(self.participation[k, most[k]]),
            }
            for k, (kind, natural, damped, ratio) in enumerate(values)
        ]


def _kind(eigenvalue: complex) -> str:
    if eigenvalue == 0:
        return "rigid"
    if eigenvalue.real > 1e-9 * abs(eigenvalue):
        return "growing"
    return "oscillation" if eigenvalue.imag else "creeping"
