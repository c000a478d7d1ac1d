"""Pages of checks that take too long for each change."""

from __future__ import annotations

from result_pages import Page, Record
from result_pages.words import listed, number, percent, table


def soak(found: Record) -> Page:
    """Work that is killed again and again, and memory over time."""
    tasks = {f"`bug-gym {name}`": found[name] for name in ("evaluate", "train")}
    env, made_on = found["vector_env"], found["machine"]
    kills = sum(sum(task["kills"].values()) for task in tasks.values())
    rows = [
        [
            name, number(task["undisturbed_seconds"], 0), str(task["starts"]),
            listed(f"{count} {signal}" for signal, count in sorted(task["kills"].items())) if task["kills"] else "-",
            str(task["finished"]), f"{task['compared']:,}",
            *(str(task[count]) for count in ("lost", "extra", "forgotten", "left_behind")), str(len(task["failures"])),
        ]
        for name, task in tasks.items()
    ]  # fmt: skip
    rss = env["rss_mib"]
    first, last = found["turn_seconds"]

    def none(count: str) -> bool:
        return not any(task[count] for task in tasks.values())

    failures = [f"{name}: {said}" for name, task in tasks.items() for said in task["failures"]]
    return Page(
        [
            table(
                f"What was killed, in {found['minutes']:g} minutes",
                [
                    "command", "undisturbed [s]", "starts", "kills", "runs finished", "pieces compared", "lost",
                    "twice or different", "done twice", "left behind", "failures",
                ],
                rows,
            ),
            table(
                f"Memory of the native vector env, {env['worlds']} worlds of `BugGym/Dynamic-v0`",
                [
                    "stepping [s]", "steps", "samples", "mean [MiB]", "least [MiB]", "most [MiB]", "slope [KiB/min]",
                    "rise of the line [%]",
                ],
                [
                    [
                        number(env["seconds"], 0), f"{env['steps']:,}", str(env["samples"]),
                        *(number(rss[name]) for name in ("mean", "least", "most")),
                        number(env["slope_kib_per_minute"]), number(100 * env["rise"], 3),
                    ]
                ],
            ),
        ],
        f"{kills} kills, each between {first:g} and {last:g} s after a start, on {made_on['cores']} cores of "
        f"{made_on['cpu']} with numpy {made_on['numpy']} and numba {made_on['numba']}. Pieces are rows without decision "
        "times and shortest paths of an evaluation; the checksums, validations and test of a training. Done twice: a row "
        "that was on the disk at a kill, and was driven again. Left behind: a process that lives on 5 s after its command."
        + "".join(f"\n\nA failure: {said}" for said in failures),
        [
            ("no row, path or model is lost", none("lost")),
            ("none is there twice, or differs from that of an undisturbed run", none("extra")),
            ("no row that was on the disk is driven again", none("forgotten")),
            ("each start goes on with what the one before left", none("failures")),
            ("no process outlives its command by 5 s", none("left_behind")),
            (f"memory of the vector env rises by at most {percent(found['most_rise'])} %", env["rise"] <= found["most_rise"]),
        ],
    )  # fmt: skip


CORES = (1, 16, 256)
"""Sizes of machines and clusters that the costs are told for."""


def cluster(found: Record) -> Page:
    """A cluster beside the processes of one machine, and what many episodes and rows cost."""
    both, rows, made_on = found["side_by_side"], found["rows"], found["machine"]
    seconds = [[f"{one:.1f}" for one in both[f"{name}_seconds"]] for name in ("joblib", "ray")]
    costs = [
        [
            f"`{rate['policy']}`", rate["scenario"], number(rate["episodes_per_second"]),
            *(number(1e6 / rate["episodes_per_second"] / cores / 3600.0) for cores in CORES),
        ]
        for rate in found["rates"]
    ]  # fmt: skip
    slowest = min(rate["episodes_per_second"] for rate in found["rates"])
    fastest = max(rate["episodes_per_second"] for rate in found["rates"])
    limit = found["jobs_per_second"] * JOB / fastest
    return Page(
        [
            table(
                f"{both['episodes']:,} episodes of `bug2` in static worlds, {both['cores']} cores, in turn",
                ["who", *(f"round {one + 1} [s]" for one in range(len(seconds[0])))],
                [["joblib's processes", *seconds[0]], [f"Ray {found['ray']}", *seconds[1]]],
            ),
            table(
                "A million episodes: measured on one core, divided by the cores",
                ["policy", "worlds", "episodes a second and core", *(f"{cores} cores [h]" for cores in CORES)],
                costs,
            ),
            table(
                f"{rows['rows']:,} rows in Parquet, DuckDB {rows['duckdb']}",
                ["written [s]", "summary by policy and scenario [s]", "file [MB]"],
                [[number(rows["write_seconds"]), number(rows["summary_seconds"]), number(rows["megabytes"])]],
            ),
        ],
        f"On {made_on['cores']} cores of {made_on['cpu']}. One process deals {number(found['jobs_per_second'], 0)} jobs a "
        f"second, each a block of {JOB} worlds. The fastest pair of the table ({number(fastest)} episodes a second and core) "
        f"so keeps at most {number(limit, 0)} cores busy; the slowest ({number(slowest)}) "
        f"{number(found['jobs_per_second'] * JOB / slowest, 0)}. Behind that lies the file of rows: one process writes each "
        "line to the disk, and waits for it. Beyond some ten million rows keep several folders, each of its own seeds, and "
        "read them together as Parquet. The hours on more cores than one are divided, not measured.",
        [
            (f"Ray takes at most {percent(MOST - 1.0)} % longer than joblib", both["ratio"] <= MOST),
            (f"the summary of all rows takes at most {SOON:g} s", rows["summary_seconds"] <= SOON),
        ],
    )


JOB = 8
"""Worlds of a job: CHUNK of bug_gym.evaluation.work."""
MOST, SOON = 1.1, 10.0
"""What is claimed: Ray's time over joblib's, and the time of a summary [s]."""


def oracle(found: Record) -> Page:
    """The compiled simulation beside slow plain oracles."""
    kinds, made_on = found["kinds"], found["machine"]
    ends = listed(f"{count:,} {end}" for end, count in sorted(found["outcomes"].items()))
    ways = ("", " of a body that swings", " of a body on an arc")

    def hold(*names: str) -> bool:
        return all(kinds[name]["greatest"] <= kinds[name]["bound"] for name in names)

    return Page(
        [
            table(
                f"{found['worlds']:,} worlds of up to {found['steps']} steps",
                ["kind", "comparisons", "greatest deviation [m]", "bound [m]"],
                [
                    [name, f"{kind['comparisons']:,}", f"{kind['greatest']:.2g}", f"{kind['bound']:.2g}"]
                    for name, kind in kinds.items()
                ],
            )
        ],
        f"Of the {found['worlds']:,} worlds {found['different']:,} are different; the others are of scenarios that are the "
        f"same for each seed, where only the actions differ. They are of {len(found['scenarios'])} kinds, in turn: "
        f"{listed(found['scenarios'])}. Families that read somebody's files are not among them. How it stood with the robots "
        f"after {found['steps']} steps, or where they ended sooner: {ends}. It took {found['seconds'] / 60.0:.0f} minutes of "
        f"one core of {made_on['cpu']}, on which other work ran.\n\n"
        f"A look compares {found['beams']} beams, drawn from all. {found['beams_at_edges']} of them passed an edge within "
        f"{found['edge']:g} rad and saw the other side of it. A clearance is the smallest so far, after each step. A body "
        "goes on a chord in a step, as the movers do for it, or on its arc where that may lie more than 3 mm beside the "
        "chord; on an arc, and where a circle beside the robot's origin swings, it is stopped by up to 2e-5 m too early. "
        "A contact is the distance where and when the robot is stopped by something. Within a thing: how far a robot is "
        "inside what stands as it ends, and how far a mover that minds what stands gets into it on its chord; 0 where it "
        "does not. Free: between two steps nothing is in a mover's way; reflected: something is. A polygon is reflected "
        "as the disc about its place that holds it."
        + "".join(f"\n\nBroken: {told}" for told in found["first_broken"]),
        [
            ("ranges are shapely's and the closed form's", hold("range")),
            (
                "so are clearances on the way from step to step, and where a robot is stopped by something it touches it",
                hold(*(f"{kind}{of}" for kind in ("clearance", "contact") for of in ways)),
            ),
            (
                "no robot ends in what stands; on their way no movers get into it, nor discs of a crowd into one another",
                hold("robot within a thing", "mover within a thing", "crowd within one another"),
            ),
            (
                "movers are where their laws have them",
                hold(
                    "waypoints", "replay", "bounce, free", "bounce, reflected", "random_walk, free", "crowd, evade",
                    "speed of a mover",
                ),
            ),
        ],
    )  # fmt: skip
