"""What is written under the fields of a class is found in its source, on one line."""

from __future__ import annotations

from bug_gym.config import Part, Scenario
from bug_gym.field_texts import texts_under_fields


class Base(Part):
    size: float = 1.0
    """Its size, side
    to side [m]."""
    untold: int = 0
    count: int = 0
    """How many."""


class Derived(Base):
    count: int = 3
    """How many of them."""


def test_a_text_stands_on_one_line_and_a_field_without_one_is_missing() -> None:
    assert texts_under_fields([Base]) == {"size": "Its size, side to side [m].", "count": "How many."}


def test_a_derived_class_says_anew_what_it_says_and_inherits_the_rest() -> None:
    assert Derived.meanings() == {"size": "Its size, side to side [m].", "count": "How many of them."}


def test_a_class_without_source_says_nothing() -> None:
    assert texts_under_fields([type("Typed", (), {"__annotations__": {"x": int}})]) == {}


def test_making_the_models_reads_no_source() -> None:
    """Pydantic would, in half of the time that they take."""
    assert not any(field.description for field in Scenario.model_fields.values())
    assert Scenario.meanings().keys() == Scenario.model_fields.keys()
