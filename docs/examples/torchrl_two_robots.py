"""PPO of TorchRL on two robots whose ways cross: one policy drives both, and a critic judges what both see.

python torchrl_two_robots.py --minutes 1
"""

import argparse
import time

import torch
from tensordict.nn import TensorDictModule
from tensordict.nn.distributions import NormalParamExtractor
from torchrl.envs import PettingZooWrapper, RewardSum, TransformedEnv
from torchrl.modules import MultiAgentMLP, ProbabilisticActor, TanhNormal
from torchrl.objectives import ClipPPOLoss, ValueEstimators

import bug_gym

ROBOTS, STEPS, EPOCHS, BATCH = 2, 2000, 6, 500
SEEN, DONE, RETURN = ("robot", "observation"), ("robot", "done"), ("robot", "episode_reward")


def make_env() -> TransformedEnv:
    """Two robots in one world; an episode goes on until both have ended (the mask tells who has)."""
    robots = bug_gym.parallel_env("crossing_robots", robots=ROBOTS, observation="flat", info="numeric")
    env = PettingZooWrapper(robots, use_mask=True, done_on_any=False, device="cpu")
    return TransformedEnv(env, RewardSum(in_keys=[("robot", "reward")], out_keys=[RETURN]))


def network(inputs: int, outputs: int, *, is_central: bool) -> MultiAgentMLP:
    """One net for both robots; a central one sees what both see."""
    return MultiAgentMLP(
        n_agent_inputs=inputs,
        n_agent_outputs=outputs,
        n_agents=ROBOTS,
        centralised=is_central,
        share_params=True,
        depth=2,
        num_cells=128,
        activation_class=torch.nn.Tanh,
    )


def main() -> None:
    """Train for some minutes, and say how it goes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=1.0, help="how long to train")
    minutes = parser.parse_args().minutes
    torch.manual_seed(0)
    torch.set_num_threads(1)  # nets this small are slower on several
    env = make_env()
    width = env.observation_spec[SEEN].shape[-1]
    actor = ProbabilisticActor(
        TensorDictModule(
            torch.nn.Sequential(network(width, 4, is_central=False), NormalParamExtractor()),
            in_keys=[SEEN],
            out_keys=[("robot", "loc"), ("robot", "scale")],
        ),
        in_keys=[("robot", "loc"), ("robot", "scale")],
        out_keys=[env.action_key],
        distribution_class=TanhNormal,
        return_log_prob=True,
        log_prob_key=("robot", "sample_log_prob"),
    )
    critic = TensorDictModule(network(width, 1, is_central=True), in_keys=[SEEN], out_keys=[("robot", "state_value")])
    loss = ClipPPOLoss(actor, critic, clip_epsilon=0.2, entropy_coeff=1e-3, normalize_advantage=False)
    loss.set_keys(
        reward=("robot", "reward"),
        action=env.action_key,
        value=("robot", "state_value"),
        done=DONE,
        terminated=("robot", "terminated"),
        sample_log_prob=("robot", "sample_log_prob"),
    )
    loss.make_value_estimator(ValueEstimators.GAE, gamma=0.995, lmbda=0.95)
    optimiser = torch.optim.Adam(loss.parameters(), 3e-4)
    begin, steps, at = time.monotonic(), 0, env.reset()
    begun = list(at.keys(include_nested=True, leaves_only=True))  # what a rollout begins with, and nothing else
    while time.monotonic() - begin < 60.0 * minutes:
        with torch.no_grad():
            batch = env.rollout(STEPS, actor, tensordict=at, auto_reset=False, break_when_any_done=False)
            loss.value_estimator(
                batch, params=loss.critic_network_params, target_params=loss.target_critic_network_params
            )
        at = batch[-1]["next"].select(*begun).clone()
        if at["done"].any():
            at = env.reset()
        for _ in range(EPOCHS):
            for chosen in torch.randperm(STEPS).split(BATCH):
                parts = loss(batch[chosen])
                optimiser.zero_grad()
                (parts["loss_objective"] + parts["loss_critic"] + parts["loss_entropy"]).backward()
                torch.nn.utils.clip_grad_norm_(loss.parameters(), 1.0)
                optimiser.step()
        steps += STEPS
        over = batch["next", "done"].squeeze(-1)
        returns = batch["next", *RETURN].squeeze(-1)[over]
        told = f"return {returns.mean():.2f} a robot" if len(returns) else "no episode has ended"
        print(f"{time.monotonic() - begin:4.0f} s, {steps} steps: {told}", flush=True)


if __name__ == "__main__":
    main()
