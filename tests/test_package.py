"""The package itself: what it offers, and what is imported when."""

import ast
import functools
import pathlib
import subprocess
import sys

import jaxtyping
import pytest

import jounce
from jounce.base import moved_names
from jounce.base.interrupts import is_command

HOME = pathlib.Path(jounce.__file__).parent
HEAVY = ("equinox", "jax", "numpy", "pandas", "pint", "pydantic", "rich.progress", "ruamel", "scipy", "xarray")


def printed(code, *arguments):
    """What a new process prints, whose arguments are those given."""
    return subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True).stdout


def test_all_that_the_stub_lists_is_there_and_comes_from_where_it_says():
    stub = ast.parse((HOME / "__init__.pyi").read_text(encoding="utf-8"))
    every = [line for line in stub.body if isinstance(line, ast.ImportFrom)]
    imports, subpackages = [line for line in every if line.module], [line for line in every if not line.module]
    names = [alias.name for line in imports for alias in line.names]
    assert 40 < len(names) == len(set(names)) < 60
    for line in imports:
        for alias in line.names:
            assert alias.asname == alias.name
            assert f"{line.module}.{alias.name}" in sys.modules or getattr(jounce, alias.name) is getattr(
                sys.modules[line.module], alias.name
            )
    assert [*names, "__version__"] == jounce.__all__
    assert {*names, "__version__"} <= {*dir(jounce)}
    (modules,) = ([alias.name for alias in line.names] for line in subpackages)
    assert not {*modules} & {*jounce.__all__}
    for name in modules:
        assert name in dir(jounce)
        assert getattr(jounce, name) is sys.modules[f"jounce.{name}"]
    with pytest.raises(AttributeError, match="module 'jounce' has no attribute 'sovle'") as caught:
        jounce.sovle  # noqa: B018 - what is looked for is the error
    assert (caught.value.name, caught.value.obj) == ("sovle", jounce)  # from which Python words "Did you mean"


def test_names_of_release_0_4_work_with_a_warning_that_gives_the_new_one():
    old = [*moved_names.RENAMED, *(name for names in moved_names.MOVED.values() for name in names.split())]
    assert len(old) == len(set(old)) > 100
    assert not {*old} & {*jounce.__all__}
    for name in old:
        new = moved_names.new_name(name)
        with pytest.warns(DeprecationWarning, match=rf"^jounce\.{name} is jounce\.{new} from release 0\.5 on$"):
            found = getattr(jounce, name)
        assert found is functools.reduce(getattr, new.split("."), jounce)
    assert moved_names.new_name("solve") is None
    code = """
import warnings
import jounce as jn
warnings.simplefilter("error")
try:
    jn.optimise
except DeprecationWarning as warning:
    print(warning)"""
    assert printed(code) == "jounce.optimise is jounce.optimize from release 0.5 on\n"


def test_the_package_is_imported_when_it_is_used():
    found = printed(
        "import sys, jounce; print('jax' in sys.modules, 'equinox' in sys.modules)\n"
        "print(jounce.solve.__module__, jounce.io.load is jounce.load, 'scipy' in sys.modules, 'xarray' in sys.modules)"
    )
    assert found.split() == "False False jounce.kinematics.position_analysis.solve True False False".split()


def test_each_name_is_imported_for_itself():
    code = """
import sys, jounce
rooms = "trajectory mechanism kinematics dynamics robot integrate planning reporting".split()
for name in "JounceError Jet load load_trajectory".split():
    getattr(jounce, name)
    print([room for room in rooms if f"jounce.{room}" in sys.modules])"""
    found = [ast.literal_eval(line) for line in printed(code).splitlines()]
    assert found == [[], [], ["trajectory", "mechanism"], ["trajectory", "mechanism", "robot"]]


def test_the_search_for_garbage_is_as_it_was_after_an_import():
    code = """
import gc, jounce
gc.disable()
jounce.Jet
print(gc.isenabled())
gc.enable()
jounce.load
print(gc.isenabled(), gc.get_freeze_count())"""
    assert printed(code).split() == ["False", "True", "0"]


def test_rooms_are_there_without_an_import():
    code = "import jounce as jn; print(jn.trajectory.AbstractMotion.__name__, jn.kinematics.__name__, jn.plot.__name__)"
    assert printed(code).split() == "AbstractMotion jounce.kinematics jounce.plot".split()


def test_classes_compute_in_double_precision_whatever_is_imported_first():
    code = """
import sys
import jounce as jn
mechanism = jn.load("examples/four_bar.yaml")
jn.solve(mechanism, [0.0], order=1)
jn.load_trajectory
print([*{name for name in sys.modules if name.startswith(tuple(f"{room}." for room in jn.settings._packages))}
    - jn.settings._modules])"""
    assert printed(code) == "[]\n"


def test_types_of_joints_are_registered_before_a_user_can_take_them():
    code = """
import warnings
import jounce as jn
with warnings.catch_warnings(record=True) as caught:
    class Mine(jn.joints.AbstractConstraint, type="coupled", space="spatial"):
        pass
print(caught[0].message)"""
    assert "no longer jounce.robot.closed_loops.coupling.CoupledJoints" in printed(code)


def test_everything_can_be_imported_by_a_star():
    assert printed("from jounce import *; print(solve.__name__, planar.Revolute.__name__)") == "solve Revolute\n"


def test_several_threads_may_be_the_first_to_use_it():
    code = """
import sys, threading, jounce
sys.setswitchinterval(1e-5)
names = "solve load simulate Robot planar motion_profile Mechanism forces io".split()
start, found = threading.Event(), []
def use(name):
    start.wait()
    offered = getattr(jounce, name)
    if name == "load":
        offered("examples/four_bar.yaml")  # which imports more
    found.append(offered)
threads = [threading.Thread(target=use, args=(name,)) for name in names * 3]
for thread in threads: thread.start()
start.set()
for thread in threads: thread.join()
print(len(found), len(set(map(id, found))))"""
    assert printed(code).split() == ["27", "9"]


@pytest.mark.parametrize(
    "arguments", [["--help"], ["--version"], ["run", "--help"], ["completion", "bash"], ["run"], ["new"], ["nonsense"]]
)
def test_commands_that_compute_nothing_do_not_import_the_libraries(arguments):
    code = f"""
import io, sys
sys.argv[0] = "jounce"
from jounce.cli import main
sys.stdout, output = io.StringIO(), sys.stdout
main()
print([name for name in {HEAVY} if name in sys.modules], file=output)"""
    assert printed(code, *arguments) == "[]\n"


def test_the_command_computes_in_double_precision():
    code = "import sys; sys.argv[0] = 'jounce'; import jounce, jax; print(jax.numpy.ones(1).dtype)"
    assert printed(code) == "float64\n"


def test_rooms_do_not_import_one_another_through_the_package():
    """It would import all rooms in the midst of one, unless the other happens to be there."""
    for file in HOME.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module == "jounce":
                assert {alias.name for alias in node.names} <= {"alterations", "errors", "importing"}, file


def test_annotations_are_checked_while_quick_tests_run():
    if jaxtyping.config.jaxtyping_disable:
        pytest.skip("JAXTYPING_DISABLE is set, as for the slow tests")
    with pytest.raises(TypeError, match="order"):
        jounce.Jet.variable(0.0, order="two")


@pytest.mark.parametrize(
    "program, own",
    [("/usr/bin/jounce", True), ("/lib/jounce/__main__.py", True), ("/lib/other/__main__.py", False), ("a.py", False)],
)
def test_a_process_knows_whether_it_is_the_command(program, own, monkeypatch):
    monkeypatch.setattr(sys, "argv", [program, "run"])
    assert is_command() is own
