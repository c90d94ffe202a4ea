"""Contracts of joints and drivers: `check_joint` checks a user-defined class against them."""

from jounce.errors import ContractError as ContractError
from jounce.settings import compute_under_own_settings as _compute_under_own_settings
from jounce.testing.check import JointReport as JointReport, check_joint as check_joint

_compute_under_own_settings(__name__)
