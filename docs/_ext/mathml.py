"""Render formulas as MathML when the pages are built: no script, no fonts, no network (decision 0005)."""

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.errors import ExtensionError


def _render(node, as_block):
    source = node.astext()
    try:
        return tex2mathml(source, as_block=as_block)
    except (MathError, SyntaxError) as error:
        raise ExtensionError(f"formula cannot be rendered: {source!r}: {error}") from error


def visit_math(writer, node):
    """Write a formula in the text."""
    writer.body.append(_render(node, as_block=False))
    raise nodes.SkipNode


def visit_math_block(writer, node):
    """Write a displayed formula, with its number where it has one."""
    number = f'<span class="eqno">({node["number"]})</span>' if node.get("number") else ""
    for name in node["ids"]:  # where references to the number lead
        writer.body.append(f'<span id="{name}"></span>')
    writer.body.append(f'<div class="formula">{_render(node, as_block=True)}{number}</div>\n')
    raise nodes.SkipNode


def setup(app):
    """Register the renderer with Sphinx."""
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
