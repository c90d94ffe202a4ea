"""The schema of mechanism files as JSON Schema, for completion and checks in editors."""

from __future__ import annotations

import json
from collections.abc import Iterator
from os import PathLike
from typing import Any


def json_schema(*, own_types: bool = True) -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of mechanism files.

    Parameters
    ----------
    own_types : bool, default True
        Whether to include joints and drivers registered outside this package.

    Returns
    -------
    dict
        Plain data, ready for ``json.dumps``. It checks names and shapes; only ``load`` checks units, expressions and
        the names of bodies and parameters.

    Examples
    --------
    >>> from jounce.io import json_schema
    >>> schema = json_schema()
    >>> sorted(schema["discriminator"]["mapping"])
    ['planar', 'spatial']
    """
    from typing import Annotated, Union

    from pydantic import Discriminator, TypeAdapter

    from jounce.io.mechanisms.schema.models import file_model
    from jounce.io.mechanisms.values.expressions import definitions

    models = tuple(file_model(space, own_types=own_types) for space in ("planar", "spatial"))
    union: Any = Annotated[Union[models], Discriminator("space")]  # noqa: UP007
    generated = TypeAdapter(union).json_schema()
    missing = set(_definitions(generated))
    while missing:  # a definition may refer to others
        generated["$defs"] |= {name: definitions[name] for name in sorted(missing)}
        missing = set(_definitions(generated)) - generated["$defs"].keys()
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Mechanism file",
        "description": "A planar or spatial mechanism: bodies, joints, drivers, outputs and parameters.",
    }
    return head | _without_generated_titles(generated)


def _definitions(node: Any) -> Iterator[str]:
    """Yield the names of the definitions to which parts of a schema refer."""
    if isinstance(node, dict) and isinstance(node.get("definition"), str):
        yield node["definition"]
    elif isinstance(node, dict | list):
        for entry in node.values() if isinstance(node, dict) else node:
            yield from _definitions(entry)


def _without_generated_titles(node: Any) -> Any:
    """Return a schema without titles from pydantic and without defaults of None, and with references resolved."""
    if isinstance(node, list):
        return [_without_generated_titles(item) for item in node]
    if not isinstance(node, dict):
        return node
    if isinstance(node.get("definition"), str):  # pydantic adds a title to it
        return {"$ref": f"#/$defs/{node['definition']}"}
    return {
        key: _without_generated_titles(item)
        for key, item in node.items()
        if not (key == "title" and isinstance(item, str)) and not (key == "default" and item is None)
    }


def write_json_schema(path: str | PathLike[str]) -> None:
    """Write the JSON Schema of the types of this package to a file, for the documentation."""
    from jounce.io.files.writing import replacing

    with replacing(path) as scratch:
        scratch.write_text(json.dumps(json_schema(own_types=False), indent=1) + "\n", encoding="utf-8")
