"""The robot arm of Negrean, Crisan and Vlase 2025 (section 4): acceleration energies, torque and its rates.

I. Negrean, A. V. Crisan, S. Vlase, Acceleration Energies and Higher-Order Dynamic Equations in Analytical Mechanics,
Mathematics 13 (2025) 1644.
"""

from jounce.papers.negrean_2025.case import (
    CASES as CASES,
    Case as Case,
    arm as arm,
    high_speed as high_speed,
    sudden_stop as sudden_stop,
)
from jounce.papers.negrean_2025.closed_forms import energies as energies, torques as torques
from jounce.papers.negrean_2025.motion_history import History as History, history as history
from jounce.papers.negrean_2025.reproduction import reproduce as reproduce
from jounce.papers.negrean_2025.segment import POLYNOMIALS as POLYNOMIALS, Check as Check, check as check
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

_compute_under_own_settings(__name__)
