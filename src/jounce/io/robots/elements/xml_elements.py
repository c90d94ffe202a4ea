"""XML as plain elements with lines, so that every message about a robot file can name a line."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any
from xml.parsers import expat

from jounce.errors import RobotFileError, did_you_mean
from jounce.io.files.located_data import dotted
from jounce.io.files.reading import LARGEST_NUMBER, fault_of_number, read_file
from jounce.io.robots.elements.faults import NOT_XML, TWICE, UNKNOWN, Faults

MAX_DEPTH = 2000


@dataclass(eq=False)
class Element:
    """One element of an XML file: its tag, attributes, children and text, and the line where it begins."""

    tag: str
    attributes: dict[str, str]
    path: str
    line: int
    children: list[Element] = field(default_factory=list)
    pieces: list[str] = field(default_factory=list)  # text of the element without that of its children
    faults: Faults | None = None  # of the file, which record unknown elements

    @property
    def content(self) -> str:
        """The text of the element without that of its children."""
        return "".join(self.pieces)

    def first(self, tag: str) -> Element | None:
        """Return the first child with a tag; None if there is none."""
        return next((child for child in self.children if child.tag == tag), None)

    def only(self, tag: str, *name: str) -> Element | None:
        """Return the first child with a tag; None if there is none; further ones are recorded.

        Raises
        ------
        RobotFileError
            If there are further ones, and faults are errors.
        """
        elements = self.every(tag)
        if len(elements) > 1:
            label = ".".join(name) or f"<{self.tag}>"
            elements[1].leave_out(TWICE, label, f"<{tag}> is given twice, first in line {elements[0].line}", *name)
        return elements[0] if elements else None

    def every(self, tag: str) -> list[Element]:
        """Return all children with a tag."""
        return [child for child in self.children if child.tag == tag]

    def walk(self) -> Iterator[Element]:
        """Yield the element and all its descendants, in the order of the file."""
        pending: list[Element] = [self]
        while pending:
            element = pending.pop()
            yield element
            pending.extend(reversed(element.children))

    def error(self, message: str, *name: str, **value: Any) -> RobotFileError:
        """Return an error at the line of the element, about an entry whose name is given in steps."""
        return RobotFileError(message, path=self.path, line=self.line, name=dotted(name) or None, **value)

    def text(self, key: str, *name: str) -> str:
        """Return a required attribute, which must not be blank."""
        value = self.attributes.get(key)
        if value is None:
            raise self.error(f"<{self.tag}> has no attribute {key}", *name)
        if not value.strip():
            raise self.error(f"the attribute {key} of <{self.tag}> is empty", *name, value=value)
        return value

    def number(self, key: str, *name: str, default: float | None = None) -> float:
        """Return the finite number of an attribute, which is required unless there is a default."""
        if default is None:
            self.text(key, *name)
        numbers = self.numbers(key, 1, *name)
        return numbers[0] if numbers else float(default or 0.0)

    def numbers(self, key: str, count: int, *name: str, infinite: bool = False) -> list[float] | None:
        """Return the finite numbers of an attribute; None if it is missing."""
        text = self.attributes.get(key)
        if text is None:
            return None
        return self._parsed(text, f"{key} must be", count, name, infinite)

    def content_numbers(self, count: int, *name: str, infinite: bool = False) -> list[float]:
        """Return the finite numbers in the text of the element."""
        return self._parsed(self.content.strip(), f"<{self.tag}> must hold", count, name, infinite)

    def _parsed(self, text: str, phrase: str, count: int, name: tuple[str, ...], infinite: bool) -> list[float]:
        expected = "a finite number" if count == 1 else f"{count} finite numbers"
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        usable = infinite or not any(map(fault_of_number, values))
        if len(values) != count or not usable or any(map(math.isnan, values)) or "_" in text:
            maximum = (
                f" of at most {LARGEST_NUMBER:g}" if values and all(map(math.isfinite, values)) and not usable else ""
            )
            raise self.error(f"{phrase} {expected}{maximum}", *name, value=text)
        return values

    def check_children(self, known: Iterable[str], *name: str) -> None:
        """Record a child whose tag is nearly a known one, since its content is left out.

        Raises
        ------
        RobotFileError
            If faults are errors.
        """
        valid = set(known)
        for child in self.children:
            suggestion = "" if child.tag in valid else did_you_mean(child.tag, valid, limit=0)
            if suggestion and abs(len(child.tag) - len(suggestion.split("'")[1])) <= 1:
                child.leave_out_unknown(f"unknown element; {suggestion}", *name)

    def leave_out_unknown(self, message: str, *name: str) -> None:
        """Record the element as one that its format does not have.

        Raises
        ------
        RobotFileError
            If faults are errors.
        """
        label = f"<{self.tag}> of {name[1]}" if len(name) > 1 else f"<{self.tag}>"
        self.leave_out(UNKNOWN, label, message, *name)

    def leave_out(self, heading: str, label: str, message: str, *name: str) -> None:
        """Record under a heading that the element is left out.

        Raises
        ------
        RobotFileError
            If faults are errors.
        """
        error = self.error(message, *name, value=f"<{self.tag}>")
        if self.faults is None:
            raise error
        self.faults.leave_out(heading, label, error)


def read_markup(path: str, faults: Faults | None = None) -> Element:
    """Read an XML file of at most 10 MB.

    Some faults that the readers of other programs tolerate are read as they do, and recorded: a declaration after blank
    lines or comments, two hyphens within a comment, zero bytes or other text at the end.

    Parameters
    ----------
    path : str
        Path of the file.
    faults : Faults, optional
        Records tolerated faults and unknown elements.

    Returns
    -------
    Element
        The root element.

    Raises
    ------
    RobotFileError
        If the file cannot be read, is empty, or is not well-formed XML: the message has line, column and the words of
        the parser.
    """
    content = read_file(path, error=RobotFileError)
    if not content.strip():
        raise RobotFileError("the file is empty", path=path)
    is_utf16 = content.startswith((b"\xff\xfe", b"\xfe\xff"))
    notes: list[tuple[str, int]] = []
    if not is_utf16 and content.endswith(b"\0"):
        content = content.rstrip(b"\0")
        notes.append(("zero bytes at the end", content.count(b"\n") + 1))
    if b"\0" in content and not is_utf16:
        line = content.count(b"\n", 0, content.index(b"\0")) + 1
        raise RobotFileError(
            "is not a text file: robots are read from URDF, MJCF and SDF, all XML", path=path, line=line
        )
    reader = _Reader(path, faults)
    try:
        root = reader.read(content)
    except RobotFileError as error:
        tolerated, extra_notes = (content, []) if is_utf16 else _tolerated(content)
        if extra_notes:
            root = _Reader(path, faults).read(tolerated)
        elif (element := reader.complete(content)) is not None:
            root, extra_notes = element, [("text after the end of its root element", error.line or element.line)]
        else:
            raise
        notes += extra_notes
    if faults is None:
        return root
    for note, line in notes:
        error = RobotFileError(f"has {note}, which XML does not allow; take them out", path=path, line=line)
        faults.leave_out(NOT_XML, note, error)
    return root


def _tolerated(content: bytes) -> tuple[bytes, list[tuple[str, int]]]:
    """Return XML without the faults that other readers tolerate, with all lines kept, and these faults with lines."""
    notes: list[tuple[str, int]] = []

    def blank(match: re.Match[bytes]) -> bytes:
        return re.sub(rb"[^\n\r]", b" ", match[0])

    def comment(match: re.Match[bytes]) -> bytes:
        if b"--" in match[1] or match[1].endswith(b"-"):
            notes.append(("two hyphens within a comment", content.count(b"\n", 0, match.start()) + 1))
        return blank(match)

    content = re.sub(rb"<!--(.*?)-->", comment, content, flags=re.DOTALL)
    if misplaced := re.match(rb"(?:\xef\xbb\xbf)?(\s+)<\?xml\s[^>]*\?>", content):
        notes.append(("lines before the declaration <?xml", content.count(b"\n", 0, misplaced.end(1)) + 1))
        declaration = content[misplaced.end(1) : misplaced.end()]
        content = declaration.replace(b"\n", b" ") + misplaced[1] + content[misplaced.end() :]
    return content, notes


class _Reader:
    """Builds elements from the events of the parser."""

    def __init__(self, path: str, faults: Faults | None):
        self.path, self.faults = path, faults
        self.open: list[Element] = []
        self.root: Element | None = None
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.characters
        self.parser.buffer_text = True
        self.parser.EntityDeclHandler = self.entity

    def read(self, content: bytes) -> Element:
        try:
            self.parser.Parse(content, True)
        except expat.ExpatError as error:
            reason = expat.ErrorString(error.code)
            message = f"is not well-formed XML: {reason} at column {error.offset + 1}{self.unclosed()}"
            raise RobotFileError(message, path=self.path, line=error.lineno) from None
        except (LookupError, ValueError) as error:
            raise RobotFileError(f"is in no encoding that can be read: {error}", path=self.path) from None
        assert self.root is not None  # the parser refuses a file without elements
        return self.root

    def complete(self, content: bytes) -> Element | None:
        """Return the root if it ended before the parser stopped, and no other element follows."""
        remainder = content[self.parser.ErrorByteIndex :]
        return None if self.open or re.search(rb"<[^/!?]", remainder) else self.root

    def unclosed(self) -> str:
        if not self.open:
            return ""
        element = self.open[-1]
        return f"; <{element.tag[:40]}> of line {element.line} is still open there"

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes, self.path, self.parser.CurrentLineNumber, faults=self.faults)
        if len(self.open) >= MAX_DEPTH:
            raise element.error(f"nested more than {MAX_DEPTH} deep")
        if self.open:
            self.open[-1].children.append(element)
        else:
            self.root = element
        self.open.append(element)

    def end(self, _tag: str) -> None:
        self.open.pop()

    def characters(self, text: str) -> None:
        self.open[-1].pieces.append(text)

    def entity(self, name: str, *_rest: object) -> None:
        message = "declares an XML entity, which is not read; write its text where it is used"
        raise RobotFileError(message, path=self.path, line=self.parser.CurrentLineNumber, value=name)
