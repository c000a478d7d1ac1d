"""Data checked by a model, with errors in plain words."""

from __future__ import annotations

from typing import TypeVar

from pydantic import ValidationError

from bug_gym.schema.errors import ScenarioError
from bug_gym.schema.faults import explain
from bug_gym.schema.values import Part

P = TypeVar("P", bound=Part)


def checked(model: type[P], data: object, label: str) -> P:
    """The data as a part; errors name what it is of."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise ScenarioError(explain(error, label)) from None
