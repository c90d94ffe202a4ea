"""Every file that can run code, start a process or write a temporary file is in the table of the page on trust."""

import ast
import pathlib
import re

SOURCE = pathlib.Path("src/jounce").resolve()
PAGE = pathlib.Path("docs/trust.md").resolve()
MODULES = {
    *("pickle", "cloudpickle", "marshal", "shelve", "subprocess", "multiprocessing", "tempfile", "ctypes", "runpy"),
    *("secrets", "socket", "webbrowser", "pty", "code", "http", "urllib.request"),
}
BUILTINS = {"eval", "exec", "compile", "__import__"}
OF_THE_SYSTEM = {
    *("system", "popen", "fork", "forkpty", "posix_spawn", "execv", "execve", "execl", "execvp", "spawnv", "spawnl"),
    *("startfile", "kill", "killpg", "_exit"),
}
CALLED = {
    *("import_module", "spec_from_file_location", "exec_module", "run_path", "run_module", "mkdtemp", "mkstemp"),
    *("FFMpegWriter", "from_address", "LocalCluster"),
}


def uses(tree):
    """Yield what a file has of these."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names if name.name in MODULES)
        elif isinstance(node, ast.ImportFrom) and node.module in MODULES:
            yield node.module
        elif isinstance(node, ast.Call):
            called = node.func
            if isinstance(called, ast.Name) and called.id in BUILTINS | CALLED:
                yield called.id
            elif isinstance(called, ast.Attribute):
                of_os = isinstance(called.value, ast.Name) and called.value.id == "os"
                if called.attr in CALLED or (of_os and called.attr in OF_THE_SYSTEM):
                    yield called.attr


def test_the_table_is_complete_and_names_nothing_else():
    found = {}
    for path in SOURCE.rglob("*.py"):
        if names := set(uses(ast.parse(path.read_text(encoding="utf-8")))):
            found[path.relative_to(SOURCE).as_posix()] = names
    section = (
        PAGE.read_text(encoding="utf-8").partition("## What runs code or writes elsewhere")[2].partition("\n## ")[0]
    )
    first = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    listed = set(re.findall(r"`([\w/]+\.py)`", " ".join(first)))
    assert {name: found[name] for name in found.keys() - listed} == {}
    assert listed - found.keys() == set()


def test_nothing_is_evaluated_and_no_shell_is_started():
    for path in SOURCE.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        assert not BUILTINS.intersection(uses(tree)), path
        for node in ast.walk(tree):
            shell = isinstance(node, ast.Call) and any(keyword.arg == "shell" for keyword in node.keywords)
            assert not shell or path.name == "shell_completion.py", path
