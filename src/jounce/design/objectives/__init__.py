"""Objectives and constraints of a design: expressions of outputs, measures, dimensions."""
