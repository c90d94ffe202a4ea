"""Integration of the equations of motion: Taylor series of any order, Obreshkov, step control, events, dense output."""

from jounce.integrate.marching.joint_events import JointEvent as JointEvent
from jounce.integrate.mechanisms.batch import simulate_batch as simulate_batch
from jounce.integrate.mechanisms.diffrax_term import OrdinaryEquation as OrdinaryEquation, ode_term as ode_term
from jounce.integrate.mechanisms.simulate import simulate as simulate
from jounce.integrate.results.batch import Batch as Batch
from jounce.integrate.results.robot_simulation import RobotSimulation as RobotSimulation
from jounce.integrate.results.simulation import Simulation as Simulation
from jounce.integrate.steps.events import Event as Event
from jounce.integrate.steps.methods import AbstractMethod as AbstractMethod, Taylor as Taylor
from jounce.integrate.steps.obreshkov import Obreshkov as Obreshkov
from jounce.integrate.steps.registry import method_named as method_named, register_method as register_method
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
