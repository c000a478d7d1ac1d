"""Models on the Hugging Face Hub: `hf://user/name` is fetched into a folder of this machine.

Only the files that a model's folder holds are fetched, and read as those of any folder are: no pickle and no code.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from json import JSONDecodeError
from pathlib import Path
from typing import NamedTuple

from bug_gym.checks import needed_from, shortened

HUB = "hf://"
"""What names of models on the hub begin with."""
HUB_CARD = "README.md"
"""The card of a model there."""
NAME = re.compile(rf"{HUB}([\w-][\w.-]*/[\w-][\w.-]*)(?:@([\w./-]+))?", re.ASCII)


class HubModel(NamedTuple):
    """Where a model lies on the hub."""

    repository: str
    """user/name."""
    revision: str | None
    """Branch, tag or commit; None: the newest."""

    @classmethod
    def of(cls, text: str) -> HubModel:
        """What `hf://user/name` or `hf://user/name@revision` names.

        Raises:
            ValueError: it names nothing.
        """
        found = NAME.fullmatch(text)
        if found is None:
            raise ValueError(
                f"got {shortened(text)} as a model on the hub, expected {HUB}user/name or {HUB}user/name@revision"
            )
        return cls(*found.groups())


def fetched(model: str, files: Sequence[str]) -> Path:
    """The folder of a model of the hub on this machine, in Hugging Face's own cache; what is there is not fetched again.

    Args:
        model: `hf://user/name`, or `hf://user/name@revision` for the same model at all times.
        files: names of what a model's folder holds, all of which must be there.

    Raises:
        ImportError: huggingface_hub is not installed; the message names the extra.
        ValueError: no such name, no answer, or no model of ours.
    """
    place = HubModel.of(model)
    with talking(f"{model} cannot be fetched"):
        from huggingface_hub import snapshot_download

        folder = snapshot_download(place.repository, revision=place.revision, allow_patterns=[*files, HUB_CARD])
    if missing := [name for name in files if not Path(folder, name).is_file()]:
        raise ValueError(f"{model} is no model of bug_gym: it has no {', '.join(missing)}")
    return Path(folder)


@contextmanager
def talking(failed: str) -> Iterator[None]:
    """Around what is asked of the hub.

    Args:
        failed: what could not be done then, told where the hub refuses or nobody answers.

    Raises:
        ImportError: huggingface_hub is not installed; the message names the extra.
        ValueError: it could not be done; the message says why.
    """
    with needed_from("hub", "a model on the hub"):
        from huggingface_hub.errors import HfHubHTTPError, LocalEntryNotFoundError, LocalTokenNotFoundError
    # Its bases are the errors of the HTTP library that the hub's client uses, which differs by its version. A ValueError is of
    # an answer that is no JSON, as of a network's own page for logging in, or of a token with signs that no token has.
    refused: tuple[type[BaseException], ...] = (
        *HfHubHTTPError.__bases__,
        LocalEntryNotFoundError,
        LocalTokenNotFoundError,
        ValueError,
    )
    try:
        yield
    except refused as error:
        reason = str(error).strip().partition("\n")[0] or type(error).__name__
        if isinstance(error, UnicodeError):
            reason = f"its token cannot be sent: {reason}"
        elif isinstance(error, JSONDecodeError):
            reason = f"what answers is no hub: {reason}"
        raise ValueError(f"{failed}: {reason}") from None
