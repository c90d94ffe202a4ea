"""Design: what varies in a mechanism and how, and what follows from it."""

from jounce.design.tolerance import tolerance as tolerance
