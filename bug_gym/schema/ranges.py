"""Numbers that are drawn anew for each episode: `{uniform: [0.5, 1.5]}` in the place of a number.

What is not about one episode (spaces, the sensors of a policy, how much room a world leaves) takes such a number as one of
its two ends: as the one for which nothing is promised too much.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from pydantic import PlainSerializer, WrapValidator

from bug_gym.naming import nearest_hint
from bug_gym.schema.errors import shortened, wrong

LAWS = ("uniform", "log_uniform", "choice")
"""How a number may be drawn: evenly between two, evenly by their logarithm, or one of a list as likely as another."""
MOST_CHOICES = 1000
EXPECTED = "a number, or {uniform: [least, most]}, {log_uniform: [least, most]}, {choice: [numbers]}"


class Drawn(float):
    """A number that is drawn; as a float it is the end that stands for it.

    Args:
        law: one of LAWS.
        numbers: least and most, or what there is to choose from.
        stands_for: `max` or `min`, which end it is as a float.
    """

    def __new__(cls, law: str, numbers: tuple[float, ...], stands_for: Callable[..., float] = max) -> Drawn:
        """Made with its value: floats have no other way."""
        drawn = super().__new__(cls, stands_for(numbers))
        drawn.law, drawn.numbers, drawn.stands_for = law, numbers, stands_for
        return drawn

    law: str
    numbers: tuple[float, ...]
    stands_for: Callable[..., float]

    @property
    def least(self) -> float:
        """The smallest number that may come."""
        return min(self.numbers)

    @property
    def most(self) -> float:
        """The largest number that may come."""
        return max(self.numbers)

    def at(self, share: float) -> float:
        """The number below which a share, 0 to 1 (1 left out), of all draws lies."""
        if self.law == "choice":
            return self.numbers[int(share * len(self.numbers))]
        low, high = self.numbers
        if self.law == "log_uniform":
            return min(max(math.exp(math.log(low) + share * (math.log(high) - math.log(low))), low), high)
        return min(low + share * (high - low), high)

    def told(self) -> dict[str, list[float]]:
        """As a scenario says it."""
        return {self.law: list(self.numbers)}

    def __eq__(self, other: object) -> bool:
        """Whether it is drawn alike: a plain number is another one."""
        return isinstance(other, Drawn) and (self.law, self.numbers) == (other.law, other.numbers)

    def __ne__(self, other: object) -> bool:
        """Whether it is drawn otherwise; a float has a way of its own, which would ask its value."""
        return not self == other

    def __hash__(self) -> int:
        """Of the law and its numbers."""
        return hash((self.law, self.numbers))

    def __repr__(self) -> str:
        """As a scenario says it."""
        return f"{{{self.law}: {list(self.numbers)}}}"

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled as what makes it."""
        return Drawn, (self.law, self.numbers, self.stands_for)


def least_of(value: float) -> float:
    """The smallest that a number may be."""
    return value.least if isinstance(value, Drawn) else value


def most_of(value: float) -> float:
    """The largest that a number may be."""
    return value.most if isinstance(value, Drawn) else value


def _reader(stands_for: Callable[..., float]) -> Callable[[Any, Callable[[Any], float]], float]:
    """What checks a number or a drawn one; each number of a law has to be one that may stand there alone."""

    def read(value: Any, check: Callable[[Any], float]) -> float:
        if isinstance(value, Drawn):
            value = value.told()
        if not isinstance(value, Mapping):
            return check(value)
        if len(value) != 1:
            raise wrong(f"got {shortened(dict(value))}, expected {EXPECTED}")
        ((law, numbers),) = value.items()
        if law not in LAWS:
            hint = nearest_hint(law, LAWS) if isinstance(law, str) else ""
            raise wrong(f"got the law {shortened(law)}{hint}, expected {EXPECTED}")
        if not isinstance(numbers, (list, tuple)) or not 1 <= len(numbers) <= MOST_CHOICES:
            raise wrong(f"got {shortened(numbers)}, expected a list of 1 to {MOST_CHOICES} numbers", law)
        return Drawn(law, _ordered(law, tuple(float(check(number)) for number in numbers)), stands_for)

    return read


def _ordered(law: str, numbers: tuple[float, ...]) -> tuple[float, ...]:
    if law == "choice":
        return numbers
    if len(numbers) != 2 or numbers[0] > numbers[1]:
        raise wrong(f"got {list(numbers)}, expected [least, most]", law)
    if law == "log_uniform" and numbers[0] <= 0.0:
        raise wrong(f"got {list(numbers)}, expected numbers above 0: they are drawn by their logarithm", law)
    return numbers


_TOLD = PlainSerializer(lambda value: value.told() if isinstance(value, Drawn) else value)

MAY_BE_DRAWN: tuple[Any, ...] = (WrapValidator(_reader(max)), _TOLD)
"""What makes a kind of number one that may be drawn, and stands for its greatest."""
MAY_BE_DRAWN_LEAST: tuple[Any, ...] = (WrapValidator(_reader(min)), _TOLD)
"""Likewise; it stands for its least."""
