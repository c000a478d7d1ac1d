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
