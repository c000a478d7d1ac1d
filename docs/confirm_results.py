"""Compares results that were made again with those that are committed: `confirm_results.py [OPTION] NEW.json ...`.

How long decisions and plans take depends on what else the machine does. Where nothing but that differs, the committed file
keeps its numbers, is said to be confirmed at the commit of the new one, and the pages are to be made again. Else the
differences are told, the exit status is 1, and the new file is the one to commit. `--keep-times` commits it, but with the
times of the old one where both have them, for what was made again on a machine with other work; its page says so.
`--policy=NAME[,NAME...]` does so for the rows of policies, whose files alone have changed, and leaves all others as they are;
with `--new-times` these rows have their new times, as of a policy that takes another time than before.

A file has the name of the one that is committed; where there is none, or it says nothing of a policy, nothing is done and the
exit status is 2.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parent / "results"

TIMES = {
    *("decision_time", "decision_time_mean", "decision_time_p99", "decision_time_total"),
    *("cluster_ms", "mesh_ms", "plan_ms", "ms", "ms_interval"),
}
"""What depends on the machine and on what else it does."""

MADE_BY = {"bug_gym", "commit", "confirmed", "made_again", "new_times", "python", "remark", "times_of"}
"""What tells of the run itself, at the top of a file."""


def differences(old: Any, new: Any, where: str = "") -> Iterator[str]:
    """Where two results differ, but for times, a line each."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted({*old, *new} - TIMES):
            if key in old and key in new:
                yield from differences(old[key], new[key], f"{where}/{key}")
            else:
                yield f"{where}/{key}: only in the {'committed' if key in old else 'new'} one"
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for number, (one, other) in enumerate(zip(old, new, strict=True)):
            yield from differences(one, other, f"{where}/{number}")
    elif old != new:
        yield f"{where}: {old!r} -> {new!r}"


def confirm(new: Path, committed: Path) -> list[str]:
    """Say in a committed file where its numbers were found again; returns the differences, which leave it as it is."""
    found = json.loads(new.read_text(encoding="utf-8"))
    known = json.loads(committed.read_text(encoding="utf-8"))
    told = [{key: value for key, value in one.items() if key not in MADE_BY} for one in (known, found)]
    different = list(differences(*told))
    if not different:
        known["confirmed"] = found["commit"]
        committed.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    return different


def with_times_of(old: Any, new: Any) -> Any:
    """The new result, with the times of the old one where both have them."""
    if isinstance(old, dict) and isinstance(new, dict):
        return {
            key: old[key] if key in TIMES and key in old else with_times_of(old.get(key), value)
            for key, value in new.items()
        }
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        return [with_times_of(one, other) for one, other in zip(old, new, strict=True)]
    return new


def replace_all_but_times(new: Path, committed: Path) -> None:
    """Commit a new result with the times of the old one, and say so in it."""
    found = json.loads(new.read_text(encoding="utf-8"))
    known = json.loads(committed.read_text(encoding="utf-8"))
    merged = with_times_of(known, found)
    merged["times_of"] = known.get("times_of", known["commit"])
    if "new_times" in known:
        merged["new_times"] = known["new_times"]
    committed.write_text(json.dumps(merged, indent=1) + "\n", encoding="utf-8")


def with_rows_of(policy: str, old: Any, new: Any) -> Any:
    """The old result, with what the new one says of a policy: keys that name it, and items of lists that do."""
    if isinstance(old, dict) and isinstance(new, dict):
        merged = {key: with_rows_of(policy, value, new.get(key)) for key, value in old.items()}
        return merged | {key: value for key, value in new.items() if policy in key.split()}
    if isinstance(old, list) and isinstance(new, list):
        others, again = [one for one in old if not is_of(policy, one)], [one for one in new if is_of(policy, one)]
        if again or len(others) < len(old):
            in_turn = iter(again)  # they keep their places
            kept = len(others) + len(again) == len(old)
            return [next(in_turn) if is_of(policy, one) else one for one in old] if kept else others + again
        if len(old) == len(new):
            return [with_rows_of(policy, one, other) for one, other in zip(old, new, strict=True)]
    return old


def is_of(policy: str, item: Any) -> bool:
    """Whether an item of a list speaks of a policy."""
    return policy in (item.values() if isinstance(item, dict) else item if isinstance(item, list) else ())


def speaks_of(policy: str, said: Any) -> bool:
    """Whether a result says anything of a policy."""
    if isinstance(said, dict):
        return any(
            policy in key.split() or speaks_of(policy, value) for key, value in said.items() if key not in MADE_BY
        )
    return isinstance(said, list) and any(is_of(policy, item) or speaks_of(policy, item) for item in said)


def replace_policies(policies: Sequence[str], new: Path, committed: Path, *, new_times: bool = False) -> None:
    """Commit what a new result says of some policies, with the old times where there are some and they are wanted."""
    found = json.loads(new.read_text(encoding="utf-8"))
    rows = known = json.loads(committed.read_text(encoding="utf-8"))
    for policy in policies:
        rows = with_rows_of(policy, rows, found)
    merged = rows if new_times else with_times_of(known, rows)
    if merged != rows:
        merged.setdefault("times_of", known["commit"])
    if known["holds"] is not None:
        merged["holds"] = known["holds"] and found["holds"]
    if new_times:
        merged["new_times"] = sorted({*known.get("new_times", []), *policies})
    merged["made_again"] = known.get("made_again", {}) | dict.fromkeys(policies, found["commit"])
    committed.write_text(json.dumps(merged, indent=1) + "\n", encoding="utf-8")


def fault_of(path: Path) -> str:
    """What is wrong with the name of a new result; "" where nothing is."""
    if not path.is_file():
        return f"no file {path}"
    known = sorted(committed.name for committed in RESULTS.glob("*.json"))
    return "" if path.name in known else f"{path}: got the name {path.name}, expected one of {', '.join(known)}"


def main(arguments: Sequence[str]) -> int:
    """Confirm each; 1 where one differs, 2 where one is none of those that are committed."""
    differ = 0
    options = [one for one in arguments if one.startswith("--")]
    told = [one.removeprefix("--policy=") for one in options if one.startswith("--policy=")]
    policies = [name for one in told for name in one.split(",")]
    paths = [Path(one) for one in arguments if one not in options]
    faults = [fault for path in paths if (fault := fault_of(path))]
    if not faults:
        results = [(path, json.loads(path.read_text(encoding="utf-8"))) for path in paths]
        faults = [f"{path}: it says nothing of {policy}" for path, result in results for policy in policies
                  if not speaks_of(policy, result)]  # fmt: skip
    if faults:
        print("\n".join(faults), file=sys.stderr)
        return 2
    for path in paths:
        if policies:
            replace_policies(policies, path, RESULTS / path.name, new_times="--new-times" in options)
            continue
        different = confirm(path, RESULTS / path.name)
        if different and "--keep-times" in options:
            replace_all_but_times(path, RESULTS / path.name)
        differ |= bool(different)
        print(f"{path.name}: {len(different)} differences" if different else f"{path.name}: confirmed")
        print("".join(f"  {line[:200]}\n" for line in different[:20]), end="")
    return differ


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
