"""Truncated Taylor algebra in time: arithmetic, vectors, elementary functions and composition at any order."""

from jounce.jet.algebra import Jet as Jet
from jounce.jet.compose import compose as compose
from jounce.jet.elementary import (
    absolute as abs,  # noqa: A004 - the name that expressions use
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
    exp as exp,
    expm1 as expm1,
    log as log,
    log1p as log1p,
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
    components as components,
    concatenate as concatenate,
    cross as cross,
    dot as dot,
    matmul as matmul,
    matvec as matvec,
    stack as stack,
    transpose as transpose,
)
