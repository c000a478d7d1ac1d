"""Does the installed package work with one of its extras and no other: python try_wheel.py [EXTRA], away from a checkout."""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import gymnasium as gym

import bug_gym
from bug_gym.checks import missing_of


def command(*arguments: str) -> str:
    """What a command of the package prints."""
    done = subprocess.run([sys.executable, "-m", "bug_gym", *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def alone(folder: Path) -> None:
    """What needs no extra: an episode through Gymnasium, the smallest suite and its report."""
    env = gym.make("BugGym/Static-v0")
    env.reset(seed=0)
    while not any(env.step(env.action_space.sample())[2:4]):
        pass
    assert command("--version") == f"bug-gym {bug_gym.__version__}\n"
    command("evaluate", "--suite", "smoke", "--out", str(folder / "results"))
    assert (folder / "results" / "report.html").stat().st_size > 0


def render(folder: Path) -> None:
    """Films."""
    for path in (folder / "bug2.gif", folder / "bug2.mp4"):
        command("render", "bug2", "static", "--every", "20", "--out", str(path))
        assert path.stat().st_size > 0


def play(folder: Path) -> None:
    """A shipped network."""
    command("evaluate", "--scenario", "static", "--episodes", "1", "--policies", "ppo_static")


def train(folder: Path) -> None:
    """A library of learning in the worlds."""
    from stable_baselines3 import PPO

    from bug_gym.agents.sb3 import make_vec_env  # needs the extra

    PPO("MlpPolicy", make_vec_env("static", 4), n_steps=8, batch_size=8).learn(32)


def data(folder: Path) -> None:
    """A dataset."""
    command("collect", "static", "--policies", "bug2", "--episodes", "2", "--expert", "bug2", "--out", str(folder))


EXTRAS: dict[str, Callable[[Path], None]] = {
    "": alone,
    "render": render,
    "report": alone,
    "play": play,
    "train": train,
    "maps": alone,
    "data": data,
    "cluster": alone,
    "hub": alone,
    "sweep": alone,
    "compare": alone,
}
"""What is tried of each; "" is the package without any."""


def main() -> None:
    """Try one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("extra", nargs="?", default="", choices=EXTRAS)
    extra = parser.parse_args().extra
    assert not (missing := missing_of(extra)), f"{missing} of [{extra}] not installed"
    with tempfile.TemporaryDirectory() as folder:
        EXTRAS[extra](Path(folder))
    print(f"bug-gym {bug_gym.__version__} [{extra}] works")


if __name__ == "__main__":
    main()
