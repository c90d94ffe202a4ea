"""Operations of JAX that run in single precision although a function of the package asks for them."""

import functools
import pathlib
import sys

import jax

import jounce

HOME = str(pathlib.Path(jounce.__file__).parent)


def watched(bind):
    """Return what runs an operation of JAX, and fails where it would do so in single precision for the package."""

    @functools.wraps(bind)
    def checked(primitive, *arguments, **parameters):
        if not jax.config.jax_enable_x64 and (place := place_in_package()) is not None:
            raise AssertionError(f"{primitive.name} in single precision: {place}")
        return bind(primitive, *arguments, **parameters)

    return checked


def place_in_package():
    """Return the line of the package that is being run, if any is."""
    frame = sys._getframe(1)
    while frame is not None:
        if frame.f_code.co_filename.startswith(HOME):
            return f"{frame.f_code.co_filename}:{frame.f_lineno}, in {frame.f_code.co_name}"
        frame = frame.f_back
    return None
