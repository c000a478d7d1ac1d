"""Episodes that are looked at again: a page of HTML that plays them, without a server, a network or anything installed.

A `Recorder` takes down the row of a Simulation frame by frame, with what a policy draws of its mind; `Episode` is what came
of it, a few kilobytes a second; `bug_gym.show(episode, ...)` plays episodes side by side in a notebook, `write_player` in a
file. Only a browser draws: no extra is needed.
"""

from bug_gym.replay.player import Player as Player  # for others
from bug_gym.replay.player import show as show  # for others
from bug_gym.replay.player import write_player as write_player  # for others
from bug_gym.replay.recording import Episode as Episode  # for others
from bug_gym.replay.recording import Recorder as Recorder  # for others
