"""Implicit Q-learning of TorchRL on a Minari dataset of ours: what HD-BUG, a bug and chance did in `dynamic`.

bug-gym collect dynamic --policies hd_bug,bug2,random --episodes 100 --seed 1000000 --observations flat --out datasets
python torchrl_offline.py datasets/bug_gym/dynamic/mixed_flat-v0 --minutes 1
"""

import argparse
import time
from pathlib import Path
from typing import Any

import minari
import numpy as np
import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from tensordict.nn.distributions import NormalParamExtractor
from torchrl.modules import MLP, IndependentNormal, ProbabilisticActor, ValueOperator
from torchrl.objectives import IQLLoss, SoftUpdate

from bug_gym.config import load
from bug_gym.held_out import TEST_SEEDS, play
from bug_gym.view import Sensors

SCENARIO = load("dynamic")
SENSORS = Sensors.of(SCENARIO)
BEAMS, ROBOT = len(SENSORS.angles), SENSORS.radius
BATCH, TOLD, WORLDS = 256, 1000, 100
REWARDS = 0.1
"""Rewards are multiplied by it, so that returns are near 1."""


class Encoded(torch.nn.Module):
    """A network of what is seen, nearness in place of ranges: the last half metre before contact is what matters."""

    def __init__(self, outputs: int, more: int = 0) -> None:
        super().__init__()
        self.net = MLP(BEAMS + 6 + more, outputs, num_cells=[128, 128], activation_class=torch.nn.ReLU)

    def forward(self, seen: torch.Tensor, *more: torch.Tensor) -> torch.Tensor:
        """Outputs (b, n) for flat observations (b, D) and what else there is to know."""
        nearness = 0.5 / ((seen[:, :BEAMS] - ROBOT).clamp(min=0.0) + 0.3)
        goal, velocity = seen[:, BEAMS : BEAMS + 2], seen[:, BEAMS + 5 : BEAMS + 7]
        distance = goal.norm(dim=1, keepdim=True)
        place = [goal / (distance + 1e-6), 0.1 * distance, (0.5 * distance).clamp(max=1.0)]
        return self.net(torch.cat([nearness, *place, velocity, *more], dim=1))


def read_steps(folder: Path) -> TensorDict:
    """All steps of a dataset as TorchRL has them: what was seen, what was done, and what came of it."""
    parts: dict[str, list[Any]] = {name: [] for name in ("observation", "action", "reward", "terminated", "next")}
    for episode in minari.MinariDataset(folder / "data").iterate_episodes():
        parts["observation"].append(episode.observations[:-1])
        parts["next"].append(episode.observations[1:])
        parts["action"].append(episode.actions)
        parts["reward"].append(REWARDS * episode.rewards[:, None])
        parts["terminated"].append(episode.terminations[:, None])
    tensors = {name: torch.from_numpy(np.concatenate(found)) for name, found in parts.items()}
    over = tensors["terminated"]  # an episode that was cut off would have gone on
    following = {"observation": tensors["next"], "reward": tensors["reward"].float(), "terminated": over, "done": over}
    steps = {"observation": tensors["observation"], "action": tensors["action"], "next": following}
    return TensorDict(steps, batch_size=[len(over)])


class Driver:
    """The actor as a policy of ours: the middle of what it would do."""

    def __init__(self, actor: torch.nn.Module) -> None:
        self.actor = actor

    @torch.no_grad()
    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Actions (n, 2) for flat observations (n, D)."""
        found = self.actor.get_dist(TensorDict({"observation": torch.from_numpy(observation)}, [len(observation)]))
        return found.mean.clamp(-1.0, 1.0).numpy(), state


def main() -> None:
    """Train for some minutes, and say how it goes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", type=Path, help="folder of a dataset with flat observations")
    parser.add_argument("--minutes", type=float, default=1.0, help="how long to train")
    options = parser.parse_args()
    torch.manual_seed(0)
    torch.set_num_threads(1)  # nets this small are slower on several
    steps = read_steps(options.dataset)
    print(f"{len(steps):,} steps in {options.dataset.name}", flush=True)
    actor = ProbabilisticActor(
        TensorDictModule(
            torch.nn.Sequential(Encoded(4), NormalParamExtractor()), in_keys=["observation"], out_keys=["loc", "scale"]
        ),
        in_keys=["loc", "scale"],
        distribution_class=IndependentNormal,
    )
    critic = ValueOperator(Encoded(1, more=2), in_keys=["observation", "action"])
    # One action is a tenth of a second: it is worth some hundredths more than another, so they weigh a hundredfold.
    loss = IQLLoss(actor, critic, ValueOperator(Encoded(1)), temperature=100.0, expectile=0.9)
    loss.make_value_estimator(gamma=0.99)
    targets = SoftUpdate(loss, tau=0.005)
    optimiser = torch.optim.Adam(loss.parameters(), 3e-4)
    begin, taken = time.monotonic(), 0
    while time.monotonic() - begin < 60.0 * options.minutes:
        for _ in range(TOLD):
            parts = loss(steps[torch.randint(len(steps), (BATCH,))])
            optimiser.zero_grad()
            (parts["loss_actor"] + parts["loss_qvalue"] + parts["loss_value"]).backward()
            optimiser.step()
            targets.step()
        taken += TOLD
        spent = time.monotonic() - begin
        driven = play(Driver(actor), SCENARIO, range(TEST_SEEDS, TEST_SEEDS + WORLDS)).summary()
        print(f"{spent:4.0f} s, {taken} gradient steps: {100 * driven['success']:.0f} % of {WORLDS} worlds", flush=True)


if __name__ == "__main__":
    main()
