"""The function by which a program of XLA calls machine code: XLA's foreign function interface, in LLVM's text.

XLA passes the address of a record of arguments and results, whose layout its header `xla/ffi/api/c_api.h` tells, which
jaxlib brings along. Before that it asks for which version of the interface the function was made.
"""

import re
from functools import lru_cache
from pathlib import Path

import jax

TRIED = (0, 3)  # version of the interface: the records of another one may be laid out otherwise
EXTENSION, ARGUMENTS, RESULTS = 8, 72, 112  # places in the record of a call, in bytes
KIND, METADATA = 8, 24  # in an extension, of which the first kind asks for the version
VERSION = 24  # in the metadata
DATA, RANK, SIZES = 24, 32, 40  # in the record of an array


@lru_cache(maxsize=1)
def is_known() -> bool:
    """Tell whether the records of the installed version of XLA's interface are those that are read here."""
    try:
        header = (Path(jax.ffi.include_dir()) / "xla/ffi/api/c_api.h").read_text()
    except (AttributeError, OSError):
        return False
    found = re.findall(r"#define XLA_FFI_API_(?:MAJOR|MINOR) (\d+)", header)
    return tuple(map(int, found)) == TRIED


def handler_text(arguments: int, results: int, first_of_lanes: int) -> str:
    """Return the text of a function `handle`, which calls `run`.

    Parameters
    ----------
    arguments, results : int
        How many arrays there are.
    first_of_lanes : int
        The first argument that has lanes, along its last axis.
    """
    major, minor = TRIED
    lines = [
        "define ptr @handle(ptr %frame) {",
        f"%p0 = getelementptr i8, ptr %frame, i64 {EXTENSION}",
        "%extension = load ptr, ptr %p0",
        "%extended = icmp ne ptr %extension, null",
        "br i1 %extended, label %asked, label %called",
        "asked:",
        f"%p1 = getelementptr i8, ptr %extension, i64 {KIND}",
        "%kind = load i32, ptr %p1",
        "%is_version = icmp eq i32 %kind, 1",
        "br i1 %is_version, label %answer, label %called",
        "answer:",
        f"%p2 = getelementptr i8, ptr %extension, i64 {METADATA}",
        "%metadata = load ptr, ptr %p2",
        f"%p3 = getelementptr i8, ptr %metadata, i64 {VERSION}",
        f"store i32 {major}, ptr %p3",
        f"%p4 = getelementptr i8, ptr %metadata, i64 {VERSION + 4}",
        f"store i32 {minor}, ptr %p4",
        "ret ptr null",
        "called:",
        f"%addresses = alloca ptr, i64 {arguments + results}",
    ]
    for kind, place, count, first in (("a", ARGUMENTS, arguments, 0), ("r", RESULTS, results, arguments)):
        lines += [f"%{kind}p = getelementptr i8, ptr %frame, i64 {place}", f"%{kind} = load ptr, ptr %{kind}p"]
        for k in range(count):
            at = f"%{kind}{k}"
            lines += [
                f"{at}p = getelementptr ptr, ptr %{kind}, i64 {k}",
                f"{at} = load ptr, ptr {at}p",
                f"{at}d = getelementptr i8, ptr {at}, i64 {DATA}",
                f"{at}data = load ptr, ptr {at}d",
                f"{at}to = getelementptr ptr, ptr %addresses, i64 {first + k}",
                f"store ptr {at}data, ptr {at}to",
            ]
    lanes = f"%a{first_of_lanes}"
    lines += [
        f"%rp0 = getelementptr i8, ptr {lanes}, i64 {RANK}",
        "%rank = load i64, ptr %rp0",
        f"%sp0 = getelementptr i8, ptr {lanes}, i64 {SIZES}",
        "%sizes = load ptr, ptr %sp0",
        "%last = sub i64 %rank, 1",
        "%tp0 = getelementptr i64, ptr %sizes, i64 %last",
        "%total = load i64, ptr %tp0",
        "call void @run(ptr %addresses, i64 %total)",
        "ret ptr null",
        "}",
    ]
    return "\n".join(lines)
