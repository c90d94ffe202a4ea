"""The regime of all tests: float64, strict promotion of types and ranks; warnings are errors by pyproject.toml."""

import contextlib
import ctypes
import gc
import os
import pathlib
import shutil
import signal
import threading

import hypothesis
import jax
import pytest
from jax._src import core  # what is private to JAX has no public name

from tests import type_checks  # isort: skip - before jounce
import jounce.forces  # noqa: F401 - or its types would be taken back with those of the test that needs them first
from jounce.base.private_folder import PrivateFolder
from jounce.cli import main
from jounce.cli.compiled_programs import keep_programs
from jounce.constraints import base
from jounce.errors import OutputError
from jounce.execution.background import NAME
from jounce.execution.store.folder import ProgramFolder
from jounce.execution.store.programs import use_store
from tests.precision import watched
from tests.shares_of_tests import pytest_addoption, pytest_collection_modifyitems  # noqa: F401 - found here by pytest

# Most of the time of the tests goes into compiling. It is halved without XLA's last optimizations, without its passes
# over loops and reshapes, which go round some thirty times, and in one thread, of which the other worker has the next.
# Its newer emitters, which the solver's programs leave out too, take twice as long for an operation alone; JAX 0.11 has
# no others. jounce's own machine code leaves out optimizations, too, where XLA does. The same is asked of the results;
# the examples, the study of branches and the benchmarks run as users do, and so do tests with JOUNCE_TESTS_AS_USERS=1:
# all optimizations, all threads, programs kept as for users.
_QUICK_TO_COMPILE = (
    "--xla_backend_optimization_level=0",
    *(["--xla_cpu_use_fusion_emitters=false"] if jax.__version_info__ < (0, 11) else []),
    "--xla_cpu_parallel_codegen_split_count=1",
    "--xla_disable_hlo_passes=simplify-while-loops,while-loop-invariant-code-motion,while-loop-constant-sinking"
    ",reshape-mover",
)
_as_users = os.environ.get("JOUNCE_TESTS_AS_USERS") == "1"
if not _as_users:
    os.environ.setdefault("XLA_FLAGS", " ".join(_QUICK_TO_COMPILE))
# There is a worker for each core: threads beside it take a sixth more time of the processor, as two work on the same
# memory and ask for the same lock. Tests of threads ask for two; the examples run with all cores.
if not _as_users:
    os.environ.setdefault("JOUNCE_THREADS", "1")
os.environ["JOUNCE_CACHE_DIR"] = ""  # tests leave the folder of the user alone
# The lines of Python from which each operation comes, which only dumps of programs show, take a twelfth of the time.
jax.config.update("jax_include_full_tracebacks_in_locations", False)
jax.config.update("jax_traceback_in_locations_limit", 0)
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
hypothesis.settings.register_profile("jounce", deadline=None, max_examples=15, derandomize=True)
hypothesis.settings.load_profile("jounce")
for _name in ("SIGINT", "SIGHUP"):  # ignored in what runs in the background; the children of tests would inherit that
    _number = getattr(signal, _name, None)
    if _number is not None and signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, signal.default_int_handler if _name == "SIGINT" else signal.SIG_DFL)
LARGEST_STORE = 2**30  # bytes of compiled programs that are kept between runs
_physical = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 0
LARGEST_MEMORY = max(2**30, _physical // 8)  # bytes of a worker, after which compiled programs are forgotten
MEMORY_MAPS = 65530  # of a process, unless the system is set up otherwise


def pytest_configure(config):
    """Keep compiled programs for the other worker and the next run, in files that cannot be read half written."""
    if getattr(config, "cache", None) is None or "JAX_COMPILATION_CACHE_DIR" in os.environ:
        return
    folder = pathlib.Path(config.cache.mkdir("programs"))
    if not hasattr(config, "workerinput") and sum(file.stat().st_size for file in folder.iterdir()) > LARGEST_STORE:
        shutil.rmtree(folder)
        folder.mkdir()
    with contextlib.suppress(OutputError):  # a checkout that others may write
        if _as_users:  # as a process of Python keeps them
            use_store(ProgramFolder(PrivateFolder(folder)))
        else:
            keep_programs(PrivateFolder(folder))


def pytest_collection_finish():
    """Leave thousands of collected tests out of the search for garbage, and search less often: tracing makes little."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)


@pytest.fixture(autouse=True, scope="session")
def _types_are_checked():
    """Run no test without the checks of types unless that was asked for."""
    assert type_checks.installed == type_checks.wanted, "how pytest was called hid that this process runs tests itself"


@pytest.fixture(autouse=True, scope="module")
def _few_programs():
    """Forget compiled programs in time: they take memory, and memory maps, without which XLA dies.

    Those that are needed again are read from their files.
    """
    yield
    _forget_programs(LARGEST_MEMORY)


@pytest.fixture(autouse=True)
def _fewer_programs():
    """Forget them before the end of a file that compiles very many."""
    yield
    if _memory() > 1.25 * LARGEST_MEMORY:
        _forget_programs(LARGEST_MEMORY)


def _forget_programs(memory):
    if _memory() > memory or _memory_maps() > 0.5 * MEMORY_MAPS:
        jax.clear_caches()
        gc.collect()
        getattr(ctypes.CDLL(None), "malloc_trim", lambda _: None)(0)  # glibc keeps what was freed


def _memory():
    """Return how many bytes this process holds, where Linux tells."""
    file = pathlib.Path("/proc/self/statm")
    return int(file.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") if file.exists() else 0


def _memory_maps():
    file = pathlib.Path("/proc/self/maps")
    return file.read_text().count("\n") if file.exists() else 0


@pytest.fixture
def single_precision():
    """Set JAX up as a program finds it that has not switched on double precision; what is shown must run there."""
    jax.config.update("jax_enable_x64", False)
    yield
    jax.config.update("jax_enable_x64", True)


@pytest.fixture(autouse=True)
def _examples_of_docstrings(request):
    """Run the examples of docstrings, which go through all that is public, in single precision."""
    if isinstance(request.node, pytest.DoctestItem):
        request.getfixturevalue("single_precision")
        request.getfixturevalue("doors_kept")


@pytest.fixture
def doors_kept(monkeypatch):
    """Fail where an operation of JAX is run in single precision for a function of the package."""
    monkeypatch.setattr(core.Primitive, "bind", watched(core.Primitive.bind))


@pytest.fixture(autouse=True)
def _own_catalogue():
    """Forget the joints that a test defines, or the next test finds them in the catalogue."""
    before = {key: dict(types) for key, types in base._REGISTRY.items()}
    yield
    base._REGISTRY.clear()
    base._REGISTRY.update(before)


@pytest.fixture
def run(capsys, monkeypatch):
    """Run a command in this process: exit status, standard output, standard error."""
    monkeypatch.setenv("JOUNCE_CACHE_DIR", "")  # leaves the settings of JAX in this process alone
    for name in ("JOUNCE_DEBUG", "NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE"):
        monkeypatch.delenv(name, raising=False)

    def call(*arguments):
        status = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        assert "Traceback" not in captured.out + captured.err
        return status, captured.out, captured.err

    return call


def pytest_runtest_teardown():
    """Wait for what a refused motion has left compiling.

    Types are checked there with random numbers, which Hypothesis takes to be drawn by the test that it runs beside.
    """
    for thread in threading.enumerate():
        if thread.name == NAME:
            thread.join()
