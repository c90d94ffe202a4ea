"""Report names in the package that are one of the words of names.txt and nothing else: they do not say what they hold.

``python .ci/check_names.py`` exits with 1 if there is one. Names of fields, as of records in files, are not looked at.
"""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]


def read_words(path: Path) -> dict[str, str]:
    """Return what better names say, by word, from lines ``word->better`` as those of a dictionary of codespell."""
    lines = path.read_text(encoding="utf-8").split("\n")
    return dict(line.split("->", 1) for line in lines if line)


def names_in(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield the names that a module binds, with their lines."""
    fields = {line for node in ast.walk(tree) if isinstance(node, ast.ClassDef) for line in node.body}
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef() | ast.ClassDef():
                yield node.lineno, node.name
            case ast.arg():
                yield node.lineno, node.arg
            case ast.AnnAssign() if node in fields:
                pass
            case ast.Assign() | ast.AnnAssign() | ast.For() | ast.NamedExpr() | ast.comprehension() | ast.With():
                for part in ast.walk(node):
                    if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
                        yield part.lineno, part.id


def reports(root: Path) -> Iterator[str]:
    """Yield a line for each name that does not stand alone."""
    words = read_words(root / ".ci" / "names.txt")
    for path in sorted((root / "src" / "jounce").rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        lines = text.split("\n")
        for line, name in sorted(set(names_in(ast.parse(text)))):
            better = words.get(name.strip("_").lower())
            if better is not None and "# a public name" not in lines[line - 1]:
                yield f"{path.relative_to(root)}:{line}: the name {name} says little: {better}"


if __name__ == "__main__":
    lines = list(reports(ROOT))
    print("\n".join(lines))
    sys.exit(1 if lines else 0)
