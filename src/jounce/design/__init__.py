"""Designs: mechanisms whose parameters are chosen such that something is least, and conditions hold."""

from jounce.design.optimise import optimise as optimise
from jounce.design.result import OptimisedDesign as OptimisedDesign
