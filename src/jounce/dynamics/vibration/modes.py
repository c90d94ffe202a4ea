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
    """Natural modes of a mechanism about a state, the slowest first: ``y = shape exp(eigenvalue t)``.

    Each mode represents a pair of conjugate eigenvalues, or a real eigenvalue. Without damping, a growing mode also
    represents the mode that decays at the same rate.

    Attributes
    ----------
    eigenvalues : numpy.ndarray of shape (modes,)
        1/s, complex; the real part of a growing mode is positive.
    angular_frequencies, frequencies : numpy.ndarray of shape (modes,)
        Natural frequencies, the magnitudes of the eigenvalues: rad/s, and Hz. Zero for rigid modes.
    damped_frequencies : numpy.ndarray of shape (modes,)
        Frequencies of oscillation, Hz; zero for modes that do not oscillate.
    damping_ratios : numpy.ndarray of shape (modes,)
        Minus the real part over the magnitude of the eigenvalue: 1 for creeping modes, negative for growing ones, 0
        without damping or stiffness.
    shapes : numpy.ndarray of shape (coordinates, modes)
        Mode shapes of unit modal mass in the coordinates of the linearization; complex with damping.
    coordinates, bodies : tuple of str
        Names of the coordinates, and of the moving bodies.
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
        frequencies = ", ".join(f"{f:.4g}" for f in self.frequencies[:6])
        return f"<Modes {frequencies}{', ...' if len(self) > 6 else ''} Hz>"

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
        """Frequencies of oscillation, Hz."""
        return np.imag(self.eigenvalues) / (2 * np.pi)

    @property
    def damping_ratios(self) -> Float[np.ndarray, " mode"]:
        """Minus the real part over the magnitude of the eigenvalues."""
        size = self.angular_frequencies
        return np.where(size > 0, -np.real(self.eigenvalues) / np.where(size > 0, size, 1.0), 0.0) + 0.0

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kind of each mode: ``oscillation``, ``rigid`` (no force resists it), ``creeping``, or ``growing``."""
        return tuple(map(_kind, self.eigenvalues))

    @cached_property
    def body_shapes(self) -> Complex[np.ndarray, "mode body coordinate"]:
        """Displacements of each body in each mode: global shifts of its origin, m, and rotations in body axes, rad.

        Shape (modes, bodies, 3) in the plane: x, y, angle; (modes, bodies, 6) in space.
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
        """Return one swing of a mode about the equilibrium as a motion with closed joints, for an animation.

        Growth and decay are left out. The motion has frames for `jounce.plot.animate`, and no derivatives.

        Parameters
        ----------
        mode : int
            Number of the mode from 1, as in tables.
        amplitude : float, default 0.1
            Amplitude of the body that moves most, rad or sizes of the mechanism.
        duration : float, optional
            Duration of the swing, s; by default the period, or 1 s for a mode that does not oscillate.
        frames : int, default 61
            Number of instants; the last shows the same position as the first.

        Raises
        ------
        MechanismError
            If there is no such mode, a value is not valid, or the modes are about a motion.
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
        """One table row for each mode: kind, frequencies, and the body with the largest kinetic energy."""
        indices = [int(np.argmax(shares)) for shares in self.participation]
        values = zip(self.kinds, self.frequencies, self.damped_frequencies, self.damping_ratios, strict=True)
        return [
            {
                "mode": k + 1,
                "kind": kind,
                "frequency": float(natural),
                "damped_frequency": float(damped),
                "damping_ratio": float(ratio),
                "eigenvalue": complex(self.eigenvalues[k]),
                "moves_most": self.bodies[indices[k]],
                "share": float(self.participation[k, indices[k]]),
            }
            for k, (kind, natural, damped, ratio) in enumerate(values)
        ]


def _kind(eigenvalue: complex) -> str:
    if eigenvalue == 0:
        return "rigid"
    if eigenvalue.real > 1e-9 * abs(eigenvalue):
        return "growing"
    return "oscillation" if eigenvalue.imag else "creeping"
