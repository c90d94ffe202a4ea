"""Arguments of a wrong kind, as users give them, without the checks of types of the tests: short messages of jounce."""

import json
import os
import pathlib
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[1]
BODIES = "bodies: must be names of bodies in their order, got "
PATH = "path: must be the name of a file, got "
OUTPUT = "output: must be an output, such as jn.outputs.PointOutput, got "
SAID = {
    **{f"jn.{name}(None)": f"{PATH}nothing" for name in ("load", "load_robot", "load_trajectory", "io.load_path")},
    **{f"jn.io.{name}(5)": f"{PATH}5" for name in ("read", "load_cam")},
    "jn.load([1.0])": f"{PATH}[1.0]",
    "jn.load(b'no.yaml')": "no.yaml: file not found",
    "jn.write_mechanism(four_bar, None)": f"{PATH}nothing",
    "jn.write_mechanism(None, 'no.yaml')": "mechanism: must be a jn.Mechanism, got nothing; jn.load",
    "jn.io.write(motion.dataset, 5)": f"{PATH}5",
    "jn.sweep(four_bar, {'BC': (0.14, 0.15, 2)}, None)": f"{PATH}nothing",
    "jn.planar.Revolute(None, [0, 0], [0, 0])": f"{BODIES}nothing",
    "jn.planar.Revolute((1, 2), [0, 0], [0, 0])": f"{BODIES}[1, 2]",
    "jn.planar.Revolute([['a'], 'b'], [0, 0], [0, 0])": f"{BODIES}[['a'], 'b']",
    "jn.planar.Revolute({'ground', 'crank'}, [0, 0], [0, 0])": f"{BODIES}{{",  # a set has no order
    "jn.planar.Revolute('ab', [0, 0], [0, 0])": "bodies: revolute joins 2 bodies, got ['ab']",
    "jn.forces.Spring(5, [0, 0], [0, 0], 1.0, 0.1)": f"{BODIES}5",
    "jn.outputs.PointOutput(None, [0, 0])": f"{BODIES}nothing",
    "motion.angle(5)": f"{BODIES}5",
    "jn.driver_force(motion, ['theta'])": "driver: no driver has this name, got ['theta']; did you mean 'theta'?",
    "jn.dynamics.applied_force(motion, ['spring'])": "force: no force has this name, got ['spring']; none is defined",
    "jn.plot.draw(None)": "motion: must be a jn.Motion, as jn.solve and jn.simulate give it, got nothing",
    "jn.plot.draw(motion, 'pis')": "outputs: no output has this name, got 'pis'; did you mean 'psi'?",
    "motion.evaluate('psi')": f"{OUTPUT}'psi'; motion.outputs['psi']",
    "motion.evaluate(None)": f"{OUTPUT}nothing",
}
SCRIPT = """
import json, sys
import jounce as jn
four_bar = jn.load("examples/four_bar.yaml")
motion = jn.solve(four_bar, [0.0, 0.1], order=2)
said = {}
for call in json.load(sys.stdin):
    try:
        said[call] = repr(eval(call))
    except jn.JounceError as error:
        said[call] = str(error)
    except Exception as error:
        said[call] = f"{type(error).__name__}: {error}"
print(json.dumps(said))
"""


@pytest.mark.slow
def test_arguments_of_a_wrong_kind_are_refused_by_their_name():
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(
        command, cwd=ROOT, env=environment, input=json.dumps([*SAID]), capture_output=True, text=True, check=True
    )
    said = json.loads(done.stdout)
    assert {call: text[: len(SAID[call])] for call, text in said.items()} == SAID
