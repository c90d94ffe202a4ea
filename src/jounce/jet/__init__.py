"""Truncated Taylor algebra in time: arithmetic, vectors, elementary functions and composition at any order."""

from jounce.jet.algebra import Jet as Jet
from jounce.jet.compose import compose as compose
from jounce.jet.elementary import (
    absolute as abs,  # noqa: A004 - the name that expressions use
    acos as acos,
    asin as asin,
    atan as atan,
    atan2 as atan2,
    cos as cos,
    cosh as cosh,
    exp as exp,
    log as log,
    next_sine_cosine as next_sine_cosine,
    power as power,
    sin as sin,
    sine_cosine as sine_cosine,
    sinh as sinh,
    sqrt as sqrt,
    tan as tan,
    tanh as tanh,
    wrap as wrap,
)
from jounce.jet.vectors import (
    cross as cross,
    dot as dot,
    matmul as matmul,
    matvec as matvec,
    stack as stack,
    transpose as transpose,
)
