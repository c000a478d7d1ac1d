"""What YAML may hold: plain data within limits; anything else is one line with file, line and reason."""

from __future__ import annotations

import importlib.util
import re
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import yaml

from bug_gym.agents.learning.settings import load_settings
from bug_gym.commands.arguments import assignments
from bug_gym.config import ScenarioError, load, read_yaml
from bug_gym.evaluation.suites import load_suite
from bug_gym.limits import MOST_ALIASES, MOST_DEPTH, TEXT
from bug_gym.schema import yaml_text
from bug_gym.schema.yaml_text import parse_yaml
from bug_gym.worlds.ros_files import load_ros_map

LAUGHS = "a: &a [1, 2, 3, 4, 5, 6, 7, 8, 9]\n" + "".join(
    f"{name}: &{name} [{', '.join(9 * [f'*{before}'])}]\n"
    for before, name in zip("abcdefghi", "bcdefghij", strict=True)
)

HOSTILE = {
    "billion laughs": (LAUGHS, "aliases"),
    "merged laughs": (
        "a: &a {k: 1}\n"
        + "".join(
            f"{name}: &{name} {{x: *{before}, y: *{before}, z: *{before}}}\n"
            for before, name in zip("abcdefghijklmnop", "bcdefghijklmnopq", strict=True)
        ),
        "more than 1,000,000 values",
    ),
    "a list in itself": ("name: &a [*a]\n", "the alias 'a' lies within what it stands for"),
    "a mapping in itself": ("&a\nname: {x: *a}\n", "the alias 'a' lies within what it stands for"),
    "a chain of aliases": (
        "l0: &l0 [1]\n" + "".join(f"l{n + 1}: &l{n + 1} [*l{n}]\n" for n in range(60)),
        f"nested deeper than {MOST_DEPTH} levels",
    ),
    "brackets": ("name: " + 2000 * "[" + 2000 * "]", f"nested deeper than {MOST_DEPTH} levels"),
    "open brackets": (100_000 * "[", f"nested deeper than {MOST_DEPTH} levels"),
    "braces": (2000 * "{a: " + "1" + 2000 * "}", f"nested deeper than {MOST_DEPTH} levels"),
    "dashes": ("name:\n" + 200 * "- " + "1", f"nested deeper than {MOST_DEPTH} levels"),
    "a bool that is none": ("name: !!bool foo\n", "got 'foo', expected what the tag !!bool says"),
    "a number without digits": ("name: !!int ''\n", "got '', expected what the tag !!int says"),
    "a float in words": ("name: !!float x\n", "expected what the tag !!float says"),
    "nothing that is something": ("name: !!null x\n", "expected what the tag !!null says"),
    "a timestamp": ("name: !!timestamp x\n", "got the tag 'tag:yaml.org,2002:timestamp'"),
    "a set": ("name: !!set {a, b}\n", "got the tag"),
    "binary": ("name: !!binary x\n", "got the tag"),
    "Python": ("name: !!python/object/apply:os.system [ls]\n", "got the tag"),
    "a tag of one's own": ("name: !mine x\n", "got the tag '!mine'"),
    "a scalar as a mapping": ("name: !!map x\n", "got the tag"),
    "a number in a mapping": ("name: !!int {=: x}\n", "got the tag"),
    "binary digits without any": ("name: 0b_\n", "got '0b_', expected a number"),
    "a very long number": (f"name: {5000 * '9'}\n", "expected a number"),
    "many sixties": (f"name: {':'.join(600 * ['1'])}.5\n", "expected a number"),
    "a key twice": ("name: x\nname: y\n", "key 'name' twice"),
    "a number as a key": ("name: {1: 2}\n", "got the key '1', expected text"),
    "nothing as a key": ("name: {null: 2}\n", "got the key 'null', expected text"),
    "a yes as a key": ("name: {yes: 2}\n", "got the key 'yes', expected text"),
    "a list as a key": ("name: {[1, 2]: 2}\n", "expected text"),
    "a zero byte": ("name: x\nrobot: \0\n", "line 2: not a YAML file: the character '\\x00' is not allowed"),
    "two documents": ("name: x\n---\nname: y\n", "but found another document"),
    "an unknown alias": ("name: *a\n", "undefined alias"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_yaml_is_one_line_with_file_and_line(tmp_path: Path, name: str) -> None:
    text, reason = HOSTILE[name]
    path = tmp_path / "hostile.yaml"
    path.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        load(path)
    told = str(caught.value)
    assert told.startswith(f"{path}: line ")
    assert reason in told
    assert "\n" not in told and len(told) < 400


@pytest.mark.parametrize("name", HOSTILE)
def test_suites_trainings_maps_and_arguments_refuse_the_same(tmp_path: Path, name: str) -> None:
    text, _ = HOSTILE[name]
    path = tmp_path / "hostile.yaml"
    path.write_text(text)
    for read in (load_suite, load_settings, read_yaml):
        with pytest.raises(ScenarioError, match="line "):
            read(path)
    with pytest.raises(ValueError, match="not the YAML file of a map") as caught:
        load_ros_map(str(path))
    assert "\n" not in str(caught.value)
    with pytest.raises(ValueError, match="expected a value as YAML has it"):
        assignments([f"name={text}"])


def test_as_many_aliases_and_levels_as_allowed_are_read() -> None:
    aliases = parse_yaml(f"a: &a 1\nb: [{', '.join(MOST_ALIASES * ['*a'])}]\n")
    assert aliases["b"] == MOST_ALIASES * [1]
    with pytest.raises(yaml.YAMLError, match=f"more than {MOST_ALIASES} aliases"):
        parse_yaml(f"a: &a 1\nb: [{', '.join((MOST_ALIASES + 1) * ['*a'])}]\n")
    deep = parse_yaml((MOST_DEPTH - 1) * "[" + "1" + (MOST_DEPTH - 1) * "]")
    for _ in range(MOST_DEPTH - 1):
        (deep,) = deep
    assert deep == 1
    with pytest.raises(yaml.YAMLError, match="nested deeper"):
        parse_yaml(MOST_DEPTH * "[" + "1" + MOST_DEPTH * "]")


def test_plain_data_is_read_as_ever() -> None:
    text = (
        "a: [1, 1.5, 1e-3, .5, true, no, ~, 0x1F, '5', !!str 5, !!float 1, !!int '7']\nb: {<<: {c: 1}, d: 2001-12-14}\n"
    )
    assert parse_yaml(text) == {
        "a": [1, 1.5, 1e-3, 0.5, True, False, None, 31, "5", "5", 1.0, 7],
        "b": {"c": 1, "d": "2001-12-14"},
    }


def test_a_text_that_is_too_long_is_not_parsed(tmp_path: Path) -> None:
    path = tmp_path / "long.yaml"
    path.write_text("name: x\n" + "#" * TEXT)
    with pytest.raises(ScenarioError, match=r"long\.yaml: got more than 2\.0 MB"):
        load(path)


# -- Mappings and overrides --------------------------------------------------------------------------------------------


def test_mappings_nested_too_deep_or_in_themselves_are_refused() -> None:
    deep: dict[str, object] = {}
    for _ in range(5000):
        deep = {"name": deep}
    ring: dict[str, object] = {}
    ring["name"] = ring
    for source in (deep, ring):
        with pytest.raises(ScenarioError, match=f"scenario: nested deeper than {MOST_DEPTH} levels"):
            load(source)
        with pytest.raises(ScenarioError, match=f"override 'name': nested deeper than {MOST_DEPTH} levels"):
            load("empty", {"name": source})


def test_mappings_that_stand_for_too_many_values_are_refused() -> None:
    wide: object = 1
    for _ in range(30):
        wide = [wide, wide]
    with pytest.raises(ScenarioError, match="scenario: more than 1,000,000 values"):
        load({"name": wide})


@pytest.mark.parametrize(
    ("key", "reason"),
    [
        (".".join(2000 * ["a"]), f"nested deeper than {MOST_DEPTH} levels"),
        ("world.laws." + 5000 * "9", "expected an index below 1"),
        ("world.laws.²", "expected an index below 1"),
        ("", "unknown key"),
        ("..", "unknown key"),
        ("a\nb", "unknown key"),
    ],
)
def test_a_hostile_key_of_an_override_is_told_in_one_line(key: str, reason: str) -> None:
    source = {"world": {"family": "field", "laws": ["bounce"]}}
    with pytest.raises(ScenarioError) as caught:
        load(source, {key: 1})
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


@pytest.mark.parametrize("key", [1, None, (1, 2), 1.5, True])
def test_a_key_that_is_no_text_is_told(key: object) -> None:
    with pytest.raises(ScenarioError, match="unknown key"):
        load({key: 1})  # type: ignore[dict-item]
    with pytest.raises(ScenarioError, match="lidar.*unknown key"):
        load({"lidar": {key: 1}})


@pytest.mark.parametrize("path", ["~nobody-at-all/x.yaml", "a\0b.yaml", "./" + 5000 * "x" + ".yaml"])
def test_a_path_that_no_file_can_have_is_told(path: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load(path)
    assert "\n" not in str(caught.value)
    with pytest.raises(ScenarioError, match="expected a file or folder that exists"):
        load({"world": {"family": "barn", "path": path}})


# -- Both parsers ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def slow() -> Any:
    """The reading of YAML where PyYAML was built without libyaml."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(yaml, "__with_libyaml__", False)
        spec = importlib.util.spec_from_file_location("slow_yaml_text", yaml_text.__file__)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    assert not issubclass(module.YamlLoader, yaml.CSafeLoader)
    return module


MERGES = """
base: &base {a: 1, b: [1, 2]}
more: &more {b: 3, c: &text 4 m}
one: {<<: *base, a: 5}
both: {<<: [*base, *more], d: *text}
*text : ~
"""


def test_what_files_say_is_what_plain_yaml_says(slow: Any) -> None:
    files = sorted(Path(yaml_text.__file__).parents[1].glob("configs/**/*.yaml"))
    assert len(files) > 40
    for text in (MERGES, *(file.read_text(encoding="utf-8") for file in files)):
        told = parse_yaml(text)
        assert slow.parse_yaml(text) == told
        if not re.search(r"\d[eE]-?\d", text):  # 1e-3 is a text to PyYAML
            assert yaml.safe_load(text) == told


@pytest.mark.parametrize("name", HOSTILE)
def test_both_parsers_refuse_the_same_at_the_same_line(slow: Any, name: str) -> None:
    text, _ = HOSTILE[name]
    told = []
    for module in (yaml_text, slow):
        with pytest.raises(yaml.YAMLError) as caught:
            module.parse_yaml(text)
        told.append(module.told_fault(caught.value, text))
    assert told[0] == told[1]


@pytest.mark.parametrize("before", ["", ".", "-", "1.", "1_"])
@pytest.mark.parametrize("after", ["x", "e", ".", "e+", " x", ":"])
def test_what_begins_as_a_long_number_is_read_in_time(before: str, after: str) -> None:
    """A pattern that tries each place for the point anew takes minutes for so many digits; what is read takes 2 s at most."""
    began = time.process_time()
    with suppress(yaml.YAMLError):
        parse_yaml(before + "9" * 200_000 + after)
    assert time.process_time() - began < 2.0


@pytest.mark.parametrize("text", ["1e5", "-1.5E+3", "+.5e1", "1.e2", "12e-3"])
def test_numbers_with_exponents_are_floats(text: str) -> None:
    assert parse_yaml(text) == float(text)
