"""PPO with an LSTM, sb3-contrib's RecurrentPPO, on the task of `ppo_rush`: does it need the history of the shipped model?

Settings of `ppo_rush` where both have them; judged as it is, in the held-out worlds. Prints the rate and the success.

    python docs/recurrent_ppo.py --steps 4000000
"""

import argparse
import time

import torch
from sb3_contrib import RecurrentPPO

from bug_gym.agents.learning.networks import RobotEncoding
from bug_gym.agents.learning.settings import load_settings
from bug_gym.agents.learning.training import make_training_env, robot_of
from bug_gym.held_out import TEST_SEEDS, TRAINING_SEEDS, play

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--steps", type=int, default=4_000_000, help="environment steps")
parser.add_argument("--worlds", type=int, default=256, help="worlds side by side")
parser.add_argument("--n-steps", type=int, default=128, help="steps of each from one update to the next")
parser.add_argument("--seed", type=int, default=0)
arguments = parser.parse_args()
torch.set_num_threads(1)

settings = load_settings("ppo_rush", {"history": [], "n_envs": arguments.worlds})
scenario = settings.loaded[0]
env = make_training_env(settings, arguments.seed)
model = RecurrentPPO(
    "MlpLstmPolicy",
    env,
    learning_rate=settings.rate,
    n_steps=arguments.n_steps,
    batch_size=settings.batch_size,
    n_epochs=4,
    gamma=settings.gamma,
    seed=arguments.seed,
    device="cpu",
    policy_kwargs={
        "features_extractor_class": RobotEncoding,
        "features_extractor_kwargs": {"robot": robot_of([scenario]).as_dict(), "lags": (), "linear": False},
        "lstm_hidden_size": 128,
        "shared_lstm": True,
        "enable_critic_lstm": False,
        "net_arch": [128],
        "log_std_init": settings.policy_kwargs.log_std_init,
    },
)
env.seed(TRAINING_SEEDS)  # SB3 has just seeded it as it seeds itself
begin = time.process_time()
model.learn(arguments.steps)
minutes = (time.process_time() - begin) / 60.0
result = play(model, scenario, range(TEST_SEEDS, TEST_SEEDS + settings.test_episodes)).summary()
print(
    f"{model.num_timesteps:,} steps in {minutes:.1f} CPU minutes: success {100.0 * result['success']:.1f} % "
    f"({100.0 * result['low']:.1f} - {100.0 * result['high']:.1f}) in {result['n']} held-out worlds"
)
