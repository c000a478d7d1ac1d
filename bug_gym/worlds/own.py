"""Families of worlds of one's own: classes that a scenario names, or that have a name of their own here.

A scenario says `family: my_module:MyFamily` or `family: my_file.py:MyFamily`, and whoever loads it says whether that may be
imported. A name that a program has registered, or that an installed package offers, needs no more trust: the program and the
package are code already.
"""

from __future__ import annotations

import functools
import importlib.metadata
import inspect
import logging
import re
from collections.abc import Mapping
from typing import Any, ClassVar, cast

from pydantic import ConfigDict, Field, create_model, model_validator

from bug_gym.references import from_anywhere, imported, is_reference, kept_in_process, reference_of
from bug_gym.schema.errors import ScenarioError, shortened, wrong
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.own_layout import checked_layout

logger = logging.getLogger("bug_gym")

GROUP = __name__.rpartition(".")[0]
"""Group of entry points by which an installed package offers families, named as this package: name = "module:Class"."""

FIELDS = tuple(Family.model_fields)
"""What every family has."""

SHIPPED: list[str] = []
"""Names of this package's own families, which `bug_gym.worlds` fills in."""

REGISTERED: dict[str, str] = {}
"""Where the families are that this process has registered, by name."""


class TrustedFamily(str):
    """A reference to a family that somebody has trusted already."""


class OwnFamily(Family):
    """What makes a family from outside one that a scenario can hold: see `family_class`."""

    family: str
    """Its name, or where its class is."""
    reference: ClassVar[str]
    found: ClassVar[type[Family]]
    is_tried: ClassVar[bool] = False
    """Whether a world of it has been drawn here twice, and came out the same."""

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """A world as its class draws it.

        Raises:
            ValueError: what cannot be one; whatever else its class raises.
        """
        with kept_in_process():
            twice = not type(self).is_tried
            made = checked_layout(self, super().layout, f"{self.reference}.layout", crew, rng, twice=twice)
        type(self).is_tried = True
        return made

    @property
    def source(self) -> Any:
        """What makes it again, trusted: its class, or what the scenario says."""
        return self.found if self.family == reference_of(self.found) else TrustedFamily(self.family)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled by name and values, so that a process that has not imported its module does."""
        return remade, (self.reference, self.model_dump())


class UnreadFamily(Family):
    """A family from outside that nobody has trusted: its keys are kept as they are, and no world of it is made."""

    model_config = ConfigDict(extra="allow")

    family: str
    """Where its class is."""

    @model_validator(mode="before")
    @classmethod
    def _keys_are_right(cls, data: object) -> object:
        return data


@functools.cache
def installed() -> dict[str, str]:
    """Where the families of installed packages are, by name; one whose name cannot be is left out with a word."""
    found: dict[str, str] = {}
    for point in importlib.metadata.entry_points(group=GROUP):
        try:
            if not is_reference(point.value):
                raise ValueError(f"{point.value!r} names no module:Class")
            found[checked_name(point.name, dict.fromkeys(SHIPPED, "this package") | found)] = point.value
        except ValueError as reason:
            package = point.dist.name if point.dist else "?"
            logger.warning("worlds %r of package %s are left out: %s", point.name, package, reason)
    return found


def own_families() -> dict[str, str]:
    """Names of families from outside, and where each is."""
    return installed() | REGISTERED


def checked_name(name: object, taken: Mapping[str, Any]) -> str:
    """A name for a family from outside.

    Raises:
        ValueError: it cannot be one, or is taken.
    """
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z_][\w-]*", name):
        raise ValueError(
            f"got {shortened(name)} as the name of a family, expected letters, digits, _ and -, such as 'my_world'"
        )
    if name in taken:
        raise ValueError(f"the name {shortened(name)} is taken, by {taken[name]}: choose another one")
    return name


def required_family(found: Any, told: str) -> type[Family]:
    """What was found, where it is a family of worlds.

    Raises:
        ScenarioError: it is none.
    """
    if not isinstance(found, type) or not issubclass(found, Family):
        came = f"class {found.__name__}" if isinstance(found, type) else f"an object of type {type(found).__name__}"
        expected = "a class derived from bug_gym.worlds.family.Family, or DrawnPlaces beside it"
        raise ScenarioError(f"{told} is no family of worlds: got {came}, expected {expected}")
    if found.layout is Family.layout:
        raise ScenarioError(f"{told} is no whole family of worlds: it lacks layout(crew, rng)")
    try:
        inspect.signature(found.layout).bind("self", "crew", "rng")
    except TypeError as error:
        raise ScenarioError(f"{told}: layout takes (self, crew, rng): {error}") from None
    return found


@functools.cache
def family_class(found: type[Family], reference: str) -> type[Family]:
    """The class of a family from outside as a scenario holds it: its `family` is what the scenario says."""
    said = (str, Field(description="Its name, or where its class is."))  # its own family may have a name already
    bases = (OwnFamily, found)
    # OwnFamily stands before it, and has these, too: with the defaults of Family, not of the class itself.
    own: dict[str, Any] = {name: (found.model_fields[name].annotation, found.model_fields[name]) for name in FIELDS}
    made = cast(Any, create_model(found.__name__, __base__=bases, __module__=found.__module__, family=said, **own))
    made.reference, made.found = reference, found
    return cast("type[Family]", made)


def class_of(family: Any) -> type[Family]:
    """The class behind what a scenario says of a family from outside, imported: a name, a reference, or a class itself.

    Raises:
        ScenarioError: no such module, file or class, or a class that is no family.
        ImportError: the module imports another one that is missing.
    """
    if isinstance(family, type):
        told = reference_of(family)
        return family_class(required_family(family, told), told)
    reference = own_families().get(family) or from_anywhere(str(family))
    try:
        found = imported(reference, "class")
    except ValueError as error:
        raise ScenarioError(str(error)) from None
    except Exception as error:  # of a caller's code: any
        error.add_note(f"family of worlds {family}" + (f" ({reference})" if reference != family else ""))
        raise
    return family_class(required_family(found, reference), reference)


def remade(reference: str, data: dict[str, Any]) -> Family:
    """A family from outside out of what `OwnFamily` pickles."""
    found = required_family(imported(reference, "class"), reference)
    return family_class(found, reference).model_validate(data)


def is_own(family: object) -> bool:
    """Whether what a scenario says under `family` means one from outside."""
    if isinstance(family, type):
        return True
    return isinstance(family, str) and (is_reference(family) or family in own_families())


def needs_trust(family: object) -> bool:
    """Whether it may be imported only where somebody says so: references in data are."""
    return isinstance(family, str) and not isinstance(family, TrustedFamily) and family not in own_families()


def required_trust(world: object) -> None:
    """Refuse a family that nobody has trusted.

    Raises:
        ScenarioError: it is one.
    """
    if isinstance(world, UnreadFamily):
        why = "to import it runs its code: pass trust=True (--trust) if you know where it comes from"
        raise ScenarioError(f"world.family is the code {world.family}; {why}")


def own_mapping(value: Mapping[str, Any]) -> dict[str, Any]:
    """A world from outside as its class takes it: with `family` as text.

    Raises:
        PydanticCustomError: bounds or another key that no family can have.
    """
    family = value["family"]
    if isinstance(family, type):
        return {**value, "family": reference_of(family)}
    if is_reference(str(family)):
        return {**value, "family": from_anywhere(str(family))}
    if not isinstance(family, str):
        raise wrong(f"got {shortened(family)}, expected the name of a family", "family")
    return {**value, "family": str(family)}
