"""Writes what `random` and `hd_bug_map` get in a hundred worlds of some scenarios: `python docs/make_reference_returns.py`.

It takes some four minutes. `bug-gym collect` takes the reference scores of datasets from there, where it has them: after a
change of worlds, rewards or these policies it is to be run again. `--check` writes nothing and says what differs;
`--only NAME` (may come several times) leaves the other scenarios as they are.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

from bug_gym.config import load
from bug_gym.evaluation.entries import ScenarioEntry
from bug_gym.evaluation.reference_returns import EXPERT, FLOOR, PATH, WORLDS, driven_returns
from bug_gym.files import replaced_when_done

SCENARIOS = ("static", "dynamic", "moving_target", "rush", "crowd", "rooms", "maze", "urban", "terrain", "forest")


def driven(name: str, policy: str) -> tuple[str, dict[str, Any]]:
    """The digest of a scenario, and what stands in the file about a policy in it."""
    scenario = ScenarioEntry(name, load(name), range(WORLDS))
    return scenario.scenario.digest, {"scenario": name, "returns": driven_returns(policy, scenario, scenario.seeds)}


def without(lines: dict[str, Any], names: list[str]) -> dict[str, Any]:
    """What a policy has got in other scenarios than these."""
    return {digest: told for digest, told in lines.items() if told["scenario"] not in names}


def main(arguments: list[str] | None = None) -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--only", action="append", choices=SCENARIOS)
    options = parser.parse_args(arguments)
    names = options.only or list(SCENARIOS)
    there = json.loads(PATH.read_text(encoding="utf-8")) if PATH.exists() else {}
    table = {policy: without(there.get(policy, {}), names) for policy in (FLOOR, EXPERT)}
    for name in names:
        for policy, lines in table.items():
            digest, told = driven(name, policy)
            lines[digest] = told
            print(f"{name} {policy}: {sum(told['returns']) / WORLDS:.3f}", flush=True)
    if options.check:
        differing = [f"{policy} in {name}" for policy in table for name in names if differs(policy, name, table, there)]
        print("\n".join(differing) or "all as it was")
        return 1 if differing else 0
    with replaced_when_done(PATH) as partial:
        partial.write_text(text(table), encoding="utf-8")
    return 0


def differs(policy: str, name: str, table: dict[str, Any], there: dict[str, Any]) -> bool:
    """Whether a file tells something else of a policy in a scenario."""
    one, other = (
        {d: told for d, told in lines.get(policy, {}).items() if told["scenario"] == name} for lines in (table, there)
    )
    return one != other


def text(table: dict[str, Any]) -> str:
    """The file, a line a policy and scenario."""
    parts = []
    for policy, lines in table.items():
        ordered = sorted(lines.items(), key=lambda item: SCENARIOS.index(item[1]["scenario"]))
        inner = ",\n".join(f"  {json.dumps(digest)}: {json.dumps(told)}" for digest, told in ordered)
        parts.append(f" {json.dumps(policy)}: {{\n{inner}\n }}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


if __name__ == "__main__":
    sys.exit(main())
