"""YAML as data: text, numbers, lists and mappings, with limits that hold before anything is built.

What is refused: more than MOST_NODES values with each alias written out, values nested deeper than MOST_DEPTH, more than
MOST_ALIASES aliases or one within what it stands for, tags that stand for anything but plain data, values that are not
what their tag says, keys that are no text or that stand there twice.
"""

from __future__ import annotations

import re
from typing import Any

import yaml

from bug_gym.limits import MOST_ALIASES, MOST_DEPTH, MOST_NODES
from bug_gym.schema.errors import shortened

YAML_TAG = "tag:yaml.org,2002:"
SCALARS = ("null", "bool", "int", "float", "str")


class YamlLoader(yaml.SafeLoader):
    """Safe YAML of plain data within limits; 1e-3 is a number and 2001-12-14 is text, as in YAML 1.2."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = self._aliases = 0
        self._open: set[str] = set()
        self._extent: dict[int, tuple[int, int]] = {}
        """Values and depth of each node, aliases written out, by its id."""

    # ------------------------------------------------------------------------------------------ from events to nodes

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """A node, where it is within the limits; all that it holds has been looked at before."""
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            return self._compose_alias(event, parent, index)
        if self._depth >= MOST_DEPTH:
            raise _fault(f"nested deeper than {MOST_DEPTH} levels", event.start_mark)
        anchor = getattr(event, "anchor", None)
        self._depth += 1
        if anchor is not None:
            self._open.add(anchor)
        node = super().compose_node(parent, index)
        self._open.discard(anchor)
        self._depth -= 1
        if node is not None:
            self._measure(node)
        return node

    def _compose_alias(self, event: yaml.AliasEvent, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        self._aliases += 1
        if self._aliases > MOST_ALIASES:
            raise _fault(f"more than {MOST_ALIASES} aliases", event.start_mark)
        if event.anchor in self._open:
            raise _fault(f"the alias {event.anchor!r} lies within what it stands for", event.start_mark)
        node = super().compose_node(parent, index)
        if node is not None and self._depth + self._extent[id(node)][1] > MOST_DEPTH:
            raise _fault(f"nested deeper than {MOST_DEPTH} levels", event.start_mark)
        return node

    def _measure(self, node: yaml.Node) -> None:
        """Keep how many values a node stands for, and how deep they are nested."""
        children: list[yaml.Node] = []
        if isinstance(node, yaml.SequenceNode):
            children = node.value
        elif isinstance(node, yaml.MappingNode):
            children = [child for pair in node.value for child in pair]
        extents = [self._extent[id(child)] for child in children]
        size = 1 + sum(values for values, _ in extents)
        if size > MOST_NODES:
            raise _fault(f"more than {MOST_NODES:,} values, aliases written out", node.start_mark)
        self._extent[id(node)] = size, 1 + max((depth for _, depth in extents), default=0)

    # ------------------------------------------------------------------------------------------ from nodes to values

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """The value of a node, where that is plain data of the kind that its tag names."""
        kind = node.tag.removeprefix(YAML_TAG)
        if isinstance(node, yaml.ScalarNode):
            if kind not in SCALARS:
                raise _fault(f"got the tag {node.tag!r}, expected plain data", node.start_mark)
            found = str(self.resolve(yaml.ScalarNode, node.value, (True, False)))  # type: ignore[no-untyped-call]
            found = found.removeprefix(YAML_TAG)
            if kind not in ("str", found) and (kind, found) != ("float", "int"):
                raise _fault(f"got {shortened(node.value)}, expected what the tag !!{kind} says", node.start_mark)
        elif kind != ("seq" if isinstance(node, yaml.SequenceNode) else "map"):
            raise _fault(f"got the tag {node.tag!r}, expected plain data", node.start_mark)
        try:
            return super().construct_object(node, deep=deep)
        except (ValueError, OverflowError):  # 0b_, or more digits than a number may have
            raise _fault(f"got {shortened(node.value)}, expected a number", node.start_mark) from None

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """A mapping whose keys are text, none of which stands there twice."""
        seen: set[str] = set()
        for key, _ in node.value if isinstance(node, yaml.MappingNode) else ():
            if key.tag not in (f"{YAML_TAG}str", f"{YAML_TAG}merge"):
                came = shortened(key.value) if isinstance(key, yaml.ScalarNode) else "that is a list or a mapping"
                raise _fault(f"got the key {came}, expected text", key.start_mark)
            if key.value in seen:
                raise _fault(f"key {key.value!r} twice", key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep=deep)


YamlLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag != f"{YAML_TAG}timestamp"]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
YamlLoader.add_implicit_resolver(
    f"{YAML_TAG}float", re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$", re.ASCII), list("-+.0123456789")
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
