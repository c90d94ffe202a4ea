"""Derivatives of motions with respect to parameters, and series of Jacobians."""
