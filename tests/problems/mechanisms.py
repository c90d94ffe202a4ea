"""The bank of mechanism files and their references in thirty digits."""

import json
from pathlib import Path

import numpy as np

EXAMPLES = Path(__file__).parents[2] / "examples"
REFERENCES = Path(__file__).parent / "references"
MECHANISMS = sorted(path.stem for path in REFERENCES.glob("*.json"))


def example(name):
    """Return the path of a mechanism file."""
    return EXAMPLES / f"{name}.yaml"


def reference(name):
    """Return instants (a float64 array) and, per output, plain derivatives as float64 of shape (order + 1, instants) or
    (order + 1, instants, components), in SI units: every number is the double nearest to the thirty-digit reference.
    """
    stored = json.loads((REFERENCES / f"{name}.json").read_text(encoding="utf-8"))
    outputs = {}
    for output, values in stored["outputs"].items():
        table = np.array(values, dtype=float)  # instant, component, derivative
        table = np.moveaxis(table, -1, 0)
        outputs[output] = table[..., 0] if table.shape[-1] == 1 else table
    return np.array(stored["time"], dtype=float), outputs
