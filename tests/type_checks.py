"""Where types are checked: in the functions and methods of jounce, but not in those that a function defines within.

Those would be given checks anew at each call of the function around them: half of the time of all tests. Their
values are checked where they are handed on. This is imported before anything of jounce.
"""

import ast

import jaxtyping._import_hook as import_hook


class OutermostFunctions(import_hook.JaxtypingTransformer):
    """The change that the import hook makes to a module, without functions within functions."""

    def generic_visit(self, node):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            super().generic_visit(node)


import_hook.JaxtypingTransformer = OutermostFunctions
