"""What a cluster costs and what it would bring: `python docs/measure_cluster.py --out docs/results/cluster.json`.

Three measurements on this machine. A thousand episodes by joblib's processes and by a Ray cluster of as many cores, in
turn; how many empty jobs a second one process can deal, which is where a large cluster ends; and a summary of ten million
rows, read from Parquet by DuckDB. Rates of episodes are measured with one process, policy by policy.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib.metadata import version
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import bug_gym
from bug_gym.cluster import Cluster, connected
from bug_gym.evaluation import evaluate
from bug_gym.files import machine, replaced_when_done
from bug_gym.workers import each

POLICIES = ("bug2", "tangent_bug", "hd_bug_map", "ppo_dynamic")
SCENARIOS = ("static", "dynamic", "maze", "rush")
MOST = 1.1
"""What Ray may take of joblib's time."""
SOON = 10.0
"""Time of a summary of all rows [s]."""
ROOT = Path(__file__).resolve().parents[1]


def timed(work: Callable[[], Any]) -> float:
    """Seconds that some work takes."""
    begin = perf_counter()
    work()
    return perf_counter() - begin


@contextmanager
def cluster_of(cores: int) -> Iterator[Cluster]:
    """A Ray cluster of one node on this machine."""
    from ray.cluster_utils import Cluster as LocalCluster

    local = LocalCluster(initialize_head=True, head_node_args={"num_cpus": cores, "include_dashboard": False})
    try:
        with connected(local.address) as cluster:
            yield cluster
    finally:
        local.shutdown()  # type: ignore[no-untyped-call]


def joblib_and_ray(cluster: Cluster, episodes: int, rounds: int) -> dict[str, Any]:
    """Seconds of the same evaluation by both, in turn, each warm."""

    def run(workers: Any, count: int) -> float:
        return timed(lambda: evaluate("bug2", "static", episodes=count, workers=workers))

    run(cluster.size, 4 * cluster.size * 8), run(cluster, 4 * cluster.size * 8)
    pairs = [(run(cluster.size, episodes), run(cluster, episodes)) for _ in range(rounds)]
    return {
        "cores": cluster.size,
        "episodes": episodes,
        "joblib_seconds": [round(first, 3) for first, _ in pairs],
        "ray_seconds": [round(second, 3) for _, second in pairs],
        "ratio": round(median(second / first for first, second in pairs), 4),
    }


def nothing(number: int) -> int:
    """A job without work."""
    return number


def dealt(cluster: Cluster, jobs: int) -> float:
    """Jobs without work that are dealt and come back in a second."""
    list(each(nothing, range(100), cluster))
    return round(jobs / timed(lambda: list(each(nothing, range(jobs), cluster))), 1)


def rates(episodes: int) -> list[dict[str, Any]]:
    """Episodes a second of one process, by policy and scenario, shortest paths included."""
    found = []
    for policy in POLICIES:
        for scenario in SCENARIOS:
            evaluate(policy, scenario, episodes=1)
            seconds = timed(partial(evaluate, policy, scenario, episodes=episodes))
            found.append({"policy": policy, "scenario": scenario, "episodes_per_second": round(episodes / seconds, 3)})
    return found


def many_rows(count: int) -> dict[str, Any]:
    """Seconds to write rows as Parquet and to summarise them, and the size of the file [MB]."""
    import duckdb

    with tempfile.TemporaryDirectory() as folder:
        evaluate(["bug2", "tangent_bug"], ["static", "dynamic"], episodes=50, out=f"{folder}/few")
        database = duckdb.connect()
        numbers = ", ".join(  # the text "inf" stands beside them
            f"TRY_CAST({name}->>'$' AS DOUBLE) AS {name}" for name in ("shortest_path_length", "min_clearance")
        )
        rows = f"read_json('{folder}/few/rows.jsonl', format='newline_delimited', sample_size=-1)"
        few = f"SELECT * REPLACE ({numbers}) FROM {rows}"
        kept = database.execute(f"SELECT count(*) FROM ({few})").fetchone()
        assert kept is not None
        many = f"SELECT few.* REPLACE (seed + 1000 * n AS seed) FROM ({few}) few, range({count // kept[0]}) more(n)"
        writing = timed(lambda: database.execute(f"COPY ({many}) TO '{folder}/rows.parquet' (FORMAT parquet)"))
        asked = (
            "SELECT policy, scenario, count(*), avg(success::INT), median(path_length / shortest_path_length), "
            f"quantile_cont(decision_time_p99, 0.99) FROM '{folder}/rows.parquet' GROUP BY ALL ORDER BY ALL"
        )
        reading = timed(lambda: database.execute(asked).fetchall())
        megabytes = Path(folder, "rows.parquet").stat().st_size / 1e6
    return {
        "rows": count // kept[0] * kept[0],
        "write_seconds": round(writing, 2),
        "summary_seconds": round(reading, 2),
        "megabytes": round(megabytes, 1),
        "duckdb": version("duckdb"),
    }


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cores", type=int, default=min(os.cpu_count() or 1, 4), help="of both (default: 4, or all)")
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--rows", type=int, default=10_000_000)
    parser.add_argument("--out", type=Path, required=True, help="JSON to write")
    options = parser.parse_args()
    with cluster_of(options.cores) as cluster:
        both = joblib_and_ray(cluster, options.episodes, options.rounds)
        jobs = dealt(cluster, 5000)
    commit = subprocess.run(["git", "-C", str(ROOT), "rev-parse", "HEAD"], capture_output=True, text=True, check=False)
    found: dict[str, Any] = {
        "name": "cluster",
        "bug_gym": bug_gym.__version__,
        "commit": commit.stdout.strip() or "unknown",
        "python": platform.python_version(),
        "ray": version("ray"),
        "machine": machine(),
        "side_by_side": both,
        "jobs_per_second": jobs,
        "rates": rates(max(options.episodes // 10, 10)),
        "rows": many_rows(options.rows),
    }
    found["holds"] = both["ratio"] <= MOST and found["rows"]["summary_seconds"] <= SOON
    with replaced_when_done(options.out) as file:
        file.write_text(json.dumps(found, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    print(json.dumps({name: found[name] for name in ("side_by_side", "jobs_per_second", "rows")}, indent=1))


if __name__ == "__main__":
    main()
