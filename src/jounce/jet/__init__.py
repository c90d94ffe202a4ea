"""Truncated Taylor algebra in time: arithmetic, vectors, elementary functions and composition at any order."""

from jounce.jet.algebra import (
    Jet as Jet,
    components as components,
    concatenate as concatenate,
    cross as cross,
    dot as dot,
    exp as exp,
    log as log,
    power as power,
    sqrt as sqrt,
    stacked as stacked,
)
from jounce.jet.elementary import (
    absolute as _absolute,
    acos as acos,
    acosh as acosh,
    asin as asin,
    asinh as asinh,
    atan as atan,
    atan2 as atan2,
    atanh as atanh,
    cbrt as cbrt,
    cos as cos,
    cosh as cosh,
    erf as erf,
    expm1 as expm1,
    log1p as log1p,
    next_sine_cosine as next_sine_cosine,
    sign as sign,
    sin as sin,
    sine_cosine as sine_cosine,
    sinh as sinh,
    tan as tan,
    tanh as tanh,
)
from jounce.jet.programs.composition import compose as compose
from jounce.jet.turns import wrap as wrap
from jounce.jet.vectors import (
    matmul as matmul,
    matvec as matvec,
    stack as stack,
    transpose as transpose,
)
from jounce.settings import compute_under_own_settings as _compute_under_own_settings

abs = _absolute  # noqa: A001 - the name that expressions use
_compute_under_own_settings(__name__)
