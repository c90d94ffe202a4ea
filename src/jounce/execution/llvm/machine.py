"""Compilation of LLVM text to machine code of this computer, loaded in this process or as an object file."""

import ctypes
import os
import re
import subprocess
import sys
import threading
from functools import lru_cache
from pathlib import Path
from typing import Any

HASTE = ("-regalloc=fast", "-enable-misched=false")  # options of LLVM
LONG = 10_000  # lines, from which a separate compiler process is worth its start
LONGEST = 60_000  # lines, beyond which fast compilation is worth slower code
_lock = threading.Lock()  # LLVM's state is global to the process
_published: set[str] = set()


@lru_cache(maxsize=1)
def _binding() -> Any:
    import llvmlite.binding as binding  # a local import, since most commands need no compiler

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding


@lru_cache(maxsize=1)
def processor() -> tuple[str, str, str]:
    """Return the release of the compiler, the processor and its features, on which machine code depends."""
    import llvmlite

    with _lock:
        binding = _binding()
        return llvmlite.__version__, binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()


def vector_width() -> int:
    """Return the number of doubles in a vector of this processor."""
    can = processor()[2].split(",")
    return 8 if "+avx512f" in can else 4 if "+avx" in can else 2


def _allowed_level() -> int:
    """Return the optimization level of LLVM: 0 if the environment sets it for XLA, otherwise 1."""
    levels = re.findall(r"--xla_backend_optimization_level=(\S+)", os.environ.get("XLA_FLAGS", ""))
    return 0 if levels[-1:] == ["0"] else 1


def _target(level: int = 1) -> Any:
    binding = _binding()
    _, name, features = processor()
    return binding.Target.from_default_triple().create_target_machine(cpu=name, features=features, opt=level, jit=True)


def compiled(text: str, *, hasty: bool = False, brief: bool = False) -> bytes:
    """Return the machine code of a module, as an object file.

    Parameters
    ----------
    text : str
        Text of the module.
    hasty : bool, default False
        Whether to compile in a third of the time to code that is half as fast, with the same results. Short modules are
        compiled as usual, since the required compiler process costs more than it saves.
    brief : bool, default False
        Whether to compile without optimization in a seventh of the time, for code that is called seldom.
    """
    if brief:
        return _compiled_here(text, 0)
    lines = text.count("\n")
    hasty = hasty or lines > LONGEST
    elsewhere = lines > LONG and (hasty or core_count() > 1)
    result = _compiled_elsewhere(text, hasty) if elsewhere else None
    return _compiled_here(text) if result is None else result


def core_count() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _compiled_here(text: str, level: int = 1) -> bytes:
    processor()
    with _lock:
        module = _binding().parse_assembly(text)
        return _target(min(level, _allowed_level())).emit_object(module)


def _compiled_elsewhere(text: str, hasty: bool) -> bytes | None:
    """Return the machine code compiled by another process; None if it cannot run.

    This process then need not hold LLVM's lock; and the options of LLVM are global to a process.
    """
    if not Path(sys.executable or "").name.startswith("python"):  # may be an application that embeds Python
        return None
    # run as a file, since the module would import JAX; -P keeps its folder off the import path
    command = [sys.executable, "-P", __file__, *(HASTE if hasty else ())]
    try:
        return subprocess.run(command, input=text.encode(), capture_output=True, check=True).stdout
    except (OSError, subprocess.SubprocessError):
        return None


def is_published(name: str) -> bool:
    """Return whether machine code can call a function of this name."""
    return name in _published


class MachineCode:
    """The functions `run` and `rounds` of an object file, in memory.

    Parameters
    ----------
    binary : bytes
        Object file from `compiled` on a processor like this one.
    """

    def __init__(self, binary: bytes):
        processor()
        with _lock:
            binding = _binding()
            self._engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _target())
            self._engine.add_object_file(binding.object_file.ObjectFileRef.from_data(binary))
            self._engine.finalize_object()
            address, rounds = map(self._engine.get_function_address, ("run", "rounds"))
        self._address = address
        self._run = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64)(address)
        addresses, numbers = [ctypes.c_void_p] * 2, [ctypes.c_int64] * 3
        self.rounds = ctypes.CFUNCTYPE(None, *addresses, *numbers, *addresses, ctypes.c_int64)(rounds)

    def publish(self, name: str) -> None:
        """Let machine code that is loaded later call `run` by a name, as long as this object exists."""
        with _lock:
            _binding().add_symbol(name, self._address)
            _published.add(name)

    def __call__(self, addresses: Any, lanes: int) -> None:
        """Run the code without Python's lock, so that several threads can run it at once."""
        self._run(addresses, lanes)


if __name__ == "__main__":
    for option in sys.argv[1:]:
        _binding().set_option("", option)
    sys.stdout.buffer.write(_compiled_here(sys.stdin.read()))
