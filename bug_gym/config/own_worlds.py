"""How a scenario's `world` is read and written where its family comes from outside (bug_gym.worlds.own)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import ValidationError, WrapSerializer, WrapValidator

from bug_gym.schema.errors import ScenarioError, wrong
from bug_gym.schema.faults import fault
from bug_gym.worlds import WorldFamily
from bug_gym.worlds.own import OwnFamily, UnreadFamily, class_of, is_own, needs_trust, own_mapping

TRUST = "trust"
"""In the context of a validation: whether a family that data names may be imported."""


def _read(value: Any, handler: Any, info: Any) -> Any:
    """A world of one of the package's families, or of one from outside."""
    if isinstance(value, (OwnFamily, UnreadFamily)):
        return value
    family = value.get("family") if isinstance(value, Mapping) else None
    if not is_own(family):
        return handler(value)
    data = own_mapping(value)
    if needs_trust(family) and not (info.context or {}).get(TRUST):
        return _validated(
            UnreadFamily, {**data, "bounds": data.get("bounds", UnreadFamily.model_fields["bounds"].default)}
        )
    try:
        own = class_of(family)
    except ScenarioError as error:
        raise wrong(str(error), "family") from None
    return _validated(own, data)


def _validated(family: type[Any], data: Mapping[str, Any]) -> Any:
    """A world of a family; its first fault is told as one of the scenario's."""
    try:
        return family.model_validate(data)
    except ValidationError as error:
        key, reason = fault(error.errors()[0])
        raise wrong(reason, key) from None


def _written(value: Any, handler: Any, info: Any) -> Any:
    """A world as data."""
    if isinstance(value, (OwnFamily, UnreadFamily)):
        told = value.model_dump(mode=info.mode, exclude_defaults=info.exclude_defaults)
        return {"family": told.pop("family"), **told}
    return handler(value)


AnyFamily = Annotated[WorldFamily, WrapValidator(_read), WrapSerializer(_written)]
"""A family of worlds, the package's or from outside."""
