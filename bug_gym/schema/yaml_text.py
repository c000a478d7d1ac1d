"""YAML as data: text, numbers, lists and mappings, with limits that hold before anything is built.

What is refused: more than MOST_NODES values with each alias written out, values nested deeper than MOST_DEPTH, more than
MOST_ALIASES aliases or one within what it stands for, tags that stand for anything but plain data, values that are not
what their tag says, keys that are no text or that stand there twice.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, NamedTuple

import yaml

from bug_gym.limits import MOST_ALIASES, MOST_DEPTH, MOST_NODES
from bug_gym.schema.errors import shortened

YAML_TAG = "tag:yaml.org,2002:"
SCALARS = ("null", "bool", "int", "float", "str")

if not TYPE_CHECKING and yaml.__with_libyaml__:
    from yaml import CSafeLoader as Parser  # ten times faster, where PyYAML was built with it
else:
    from yaml import SafeLoader as Parser


class Extent(NamedTuple):
    """How much a value is, aliases written out."""

    values: int
    depth: int


ONE = Extent(1, 1)


class YamlLoader(Parser):
    """Safe YAML of plain data within limits; 1e-3 is a number and 2001-12-14 is text, as in YAML 1.2.

    Values are made from the parser's events as they come, without nodes between: a file of megabytes takes a second.
    """

    def __init__(self, text: str) -> None:
        unreadable = yaml.reader.Reader.NON_PRINTABLE.search(text)
        if unreadable:
            raise yaml.reader.ReaderError("text", unreadable.start(), ord(unreadable[0]), "unicode", "not allowed")
        super().__init__(text)
        self._aliases = 0
        self._open: set[str] = set()
        self._anchored: dict[str, tuple[Any, Extent]] = {}

    def get_single_data(self) -> Any:
        """The value of the one document that the text holds; None of a text without any."""
        self._next()  # the stream begins
        if isinstance(self._next(), yaml.StreamEndEvent):
            return None
        value, _ = self._value(self._next(), 0)
        self._next()  # the document ends
        after = self._next()
        if not isinstance(after, yaml.StreamEndEvent):
            raise _fault("but found another document", after.start_mark)
        return value

    def _next(self) -> Any:
        return self.get_event()  # type: ignore[no-untyped-call]

    def _value(self, event: Any, depth: int) -> tuple[Any, Extent]:
        """What begins with an event, `depth` levels deep, and how much it is."""
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event, depth)
        if depth >= MOST_DEPTH:
            raise _fault(f"nested deeper than {MOST_DEPTH} levels", event.start_mark)
        anchor = event.anchor
        if anchor is not None:
            if anchor in self._anchored or anchor in self._open:
                raise _fault(f"the anchor {shortened(anchor)} twice", event.start_mark)
            self._open.add(anchor)
        if isinstance(event, yaml.ScalarEvent):
            value, extent = self._scalar(event), ONE
        elif isinstance(event, yaml.SequenceStartEvent):
            value, extent = self._sequence(event, depth)
        else:
            value, extent = self._mapping(event, depth)
        if anchor is not None:
            self._open.discard(anchor)
            self._anchored[anchor] = value, extent
        return value, extent

    def _alias(self, event: yaml.AliasEvent, depth: int) -> tuple[Any, Extent]:
        self._aliases += 1
        if self._aliases > MOST_ALIASES:
            raise _fault(f"more than {MOST_ALIASES} aliases", event.start_mark)
        if event.anchor in self._open:
            raise _fault(f"the alias {shortened(event.anchor)} lies within what it stands for", event.start_mark)
        if event.anchor not in self._anchored:
            raise _fault(f"found undefined alias {shortened(event.anchor)}", event.start_mark)
        value, extent = self._anchored[event.anchor]
        if depth + extent.depth > MOST_DEPTH:
            raise _fault(f"nested deeper than {MOST_DEPTH} levels", event.start_mark)
        return value, extent

    def _scalar(self, event: Any) -> Any:
        """The value of a scalar, where it is of the kind that its tag names."""
        text = event.value
        given = event.tag not in (None, "!")
        tag = str(event.tag) if given else self._kind(text, event.implicit)
        kind = tag.removeprefix(YAML_TAG)
        if kind not in SCALARS:
            raise _fault(f"got the tag {shortened(tag)}, expected plain data", event.start_mark)
        if kind == "str":
            return text
        if given:
            found = self._kind(text, (True, False)).removeprefix(YAML_TAG)
            if kind != found and (kind, found) != ("float", "int"):
                raise _fault(f"got {shortened(text)}, expected what the tag !!{kind} says", event.start_mark)
        try:
            return self.yaml_constructors[tag](self, yaml.ScalarNode(tag, text, event.start_mark, event.end_mark))
        except (ValueError, OverflowError):  # 0b_, or more digits than a number may have
            raise _fault(f"got {shortened(text)}, expected a number", event.start_mark) from None

    def _kind(self, text: str, implicit: tuple[bool, bool]) -> str:
        """The tag of a scalar that has none."""
        return str(self.resolve(yaml.ScalarNode, text, implicit))  # type: ignore[no-untyped-call]

    def _sequence(self, event: yaml.SequenceStartEvent, depth: int) -> tuple[list[Any], Extent]:
        self._check_tag(event, "seq")
        found: list[Any] = []
        values, deepest = 1, 0
        while not isinstance(item := self._next(), yaml.SequenceEndEvent):
            value, extent = self._value(item, depth + 1)
            found.append(value)
            values, deepest = values + extent.values, max(deepest, extent.depth)
            _check_size(values, event)
        return found, Extent(values, 1 + deepest)

    def _mapping(self, event: yaml.MappingStartEvent, depth: int) -> tuple[dict[str, Any], Extent]:
        self._check_tag(event, "map")
        found: dict[str, Any] = {}
        merged: dict[str, Any] = {}
        seen: set[str] = set()
        values, deepest = 1, 0
        while not isinstance(item := self._next(), yaml.MappingEndEvent):
            key, is_merge = self._key(item, seen)
            begin = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            value, extent = self._value(self._next(), depth + 1)
            values, deepest = values + extent.values + 1, max(deepest, extent.depth)
            _check_size(values, event)
            if is_merge:
                merged = _merged(value, begin)
            else:
                found[key] = value
        return merged | found, Extent(values, 1 + deepest)

    def _key(self, event: Any, seen: set[str]) -> tuple[str, bool]:
        """A key, which is text and stands there once; and whether it merges another mapping."""
        value: Any
        if isinstance(event, yaml.AliasEvent):
            value, _ = self._alias(event, 0)
            tag = f"{YAML_TAG}str" if isinstance(value, str) else ""
        elif isinstance(event, yaml.ScalarEvent):
            value = event.value
            tag = str(event.tag) if event.tag not in (None, "!") else self._kind(event.value, event.implicit)
            if event.anchor is not None:
                self._anchored[event.anchor] = value, ONE
        else:
            raise _fault("got the key that is a list or a mapping, expected text", event.start_mark)
        if tag not in (f"{YAML_TAG}str", f"{YAML_TAG}merge"):
            raise _fault(f"got the key {shortened(value)}, expected text", event.start_mark)
        if value in seen:
            raise _fault(f"key {shortened(value)} twice", event.start_mark)
        seen.add(value)
        return value, tag == f"{YAML_TAG}merge"

    def _check_tag(self, event: Any, kind: str) -> None:
        if event.tag not in (None, "!", f"{YAML_TAG}{kind}"):
            raise _fault(f"got the tag {shortened(event.tag)}, expected plain data", event.start_mark)


def _check_size(values: int, event: Any) -> None:
    if values > MOST_NODES:
        raise _fault(f"more than {MOST_NODES:,} values, aliases written out", event.start_mark)


def _merged(value: Any, mark: Any) -> dict[str, Any]:
    """What the key << takes over: a mapping, or several of which the first ones hold."""
    several = value if isinstance(value, list) else [value]
    found: dict[str, Any] = {}
    for mapping in reversed(several):
        if not isinstance(mapping, dict):
            raise _fault("expected a mapping or list of mappings for merging", mark)
        found |= mapping
    return found


YamlLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag != f"{YAML_TAG}timestamp"]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
YamlLoader.add_implicit_resolver(
    f"{YAML_TAG}float", re.compile(r"[-+]?(\d++\.?\d*+|\.\d++)[eE][-+]?\d+$", re.ASCII), list("-+.0123456789")
)


def _fault(problem: str, mark: Any) -> yaml.MarkedYAMLError:
    return yaml.constructor.ConstructorError(problem=problem, problem_mark=mark)


def parse_yaml(text: str) -> Any:
    """The value that a text of YAML says.

    Raises:
        yaml.YAMLError: no YAML, or beyond the limits; `told_fault` says where and why.
    """
    return yaml.load(text, Loader=YamlLoader)


def told_fault(error: yaml.YAMLError, text: str) -> str:
    """Place and reason of a fault in one line."""
    if isinstance(error, yaml.MarkedYAMLError):
        mark = error.problem_mark
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        return place + " ".join(str(error.problem).split())
    if isinstance(error, yaml.reader.ReaderError):
        line = text.count("\n", 0, error.position) + 1
        return f"line {line}: not a YAML file: the character {chr(int(error.character))!r} is not allowed"
    return f"not a YAML file: {' '.join(str(error).split())}"
