"""Arrays with the instants along the first axis, the layout of users' arrays.

A vector holds one number of several instants. As many rows as a vector has lanes are read, in pieces as wide as a
vector, and transposed in registers. A transpose by NumPy would take a third of the time of the torque of an arm.
"""

from collections.abc import Sequence

from jounce.execution.llvm.text.code import Code
from jounce.execution.llvm.text.values import DTYPES, IN_MEMORY, Value


def read(code: Code, pointer: str, size: int, kind: str) -> list[Value]:
    """Return the `size` numbers of each of the instants from `%lane` on."""
    if size == 0:
        return []
    rows, vector, hint = _rows(code, pointer, size, kind), f"<{code.width} x {IN_MEMORY[kind]}>", "!invariant.load !0"
    result: list[str | None] = [None] * size
    if size < code.width:
        for k in range(size):
            result[k] = "poison"
            for lane, row in enumerate(rows):
                item, extended = code.fresh(), code.fresh()
                index = _address(code, row, k, kind)
                code.lines.append(
                    f"{item} = load {IN_MEMORY[kind]}, ptr {index}, align {DTYPES[kind].itemsize}, {hint}"
                )
                code.lines.append(
                    f"{extended} = insertelement {vector} {result[k]}, {IN_MEMORY[kind]} {item}, i64 {lane}"
                )
                result[k] = extended
    for start in _starts(size, code.width):
        block = []
        for row in rows:
            block.append(code.fresh())
            index = _address(code, row, start, kind)
            code.lines.append(f"{block[-1]} = load {vector}, ptr {index}, align {DTYPES[kind].itemsize}, {hint}")
        result[start : start + code.width] = _transposed(code, block, kind)
    names = [code.truths(str(name), vector, lanes=True) if kind == "b" else str(name) for name in result]
    return [Value(name, kind, lanes=True) for name in names]


def write(code: Code, pointer: str, values: Sequence[Value]) -> None:
    """Emit stores of the numbers of the instants from `%lane` on, those of each instant contiguous."""
    size, kind = len(values), values[0].kind
    rows, vector = _rows(code, pointer, size, kind), f"<{code.width} x {IN_MEMORY[kind]}>"
    names = [code.stored_operand(value, vector, lanes=True) for value in values]
    if size < code.width:
        for k, name in enumerate(names):
            for lane, row in enumerate(rows):
                element, index = code.fresh(), _address(code, row, k, kind)
                code.lines.append(f"{element} = extractelement {vector} {name}, i64 {lane}")
                code.lines.append(f"store {IN_MEMORY[kind]} {element}, ptr {index}, align {DTYPES[kind].itemsize}")
    for start in _starts(size, code.width):
        block = _transposed(code, names[start : start + code.width], kind)
        for row, name in zip(rows, block, strict=True):
            index = _address(code, row, start, kind)
            code.lines.append(f"store {vector} {name}, ptr {index}, align {DTYPES[kind].itemsize}")


def _starts(size: int, width: int) -> list[int]:
    """Return the starts of blocks of columns; the last two may overlap."""
    return [] if size < width else [*range(0, size - width, width), size - width]


def _rows(code: Code, pointer: str, size: int, kind: str) -> list[str]:
    """Return the address of the first number of each instant."""
    first = code.fresh()
    code.lines.append(f"{first} = mul i64 %lane, {size}")
    start = _address(code, pointer, first, kind)
    return [_address(code, start, lane * size, kind) for lane in range(code.width)]


def _address(code: Code, pointer: str, index: int | str, kind: str) -> str:
    name = code.fresh("p")
    code.lines.append(f"{name} = getelementptr {IN_MEMORY[kind]}, ptr {pointer}, i64 {index}")
    return name


def _transposed(code: Code, block: Sequence[str], kind: str) -> list[str]:
    """Return the columns of a square of numbers from its rows, transposed bit by bit of the indices."""
    width, result = code.width, list(block)
    text, bit = f"<{width} x {IN_MEMORY[kind]}>", 1
    while bit < width:
        low = [k if not k & bit else width + k - bit for k in range(width)]
        high = [k + bit if not k & bit else width + k for k in range(width)]
        for i in range(width):
            if i & bit:
                continue
            pair = result[i], result[i + bit]
            for index, selection in ((i, low), (i + bit, high)):
                name, mask = code.fresh(), ", ".join(f"i32 {k}" for k in selection)
                code.lines.append(
                    f"{name} = shufflevector {text} {pair[0]}, {text} {pair[1]}, <{width} x i32> <{mask}>"
                )
                result[index] = name
        bit *= 2
    return result
