"""Learns to synchronise, to gather and to cover the floor, by proximal policy optimisation (PPO) in plain PyTorch.

    pip install "epuck-sim[learning,plot,train]"
    python docs/examples/train_policy.py docs/figures/policy

writes docs/examples/learnt_policy.npz, and the course of learning to policy.csv and policy.png. All robots of a batch
share one small network, which is shown what the robot itself senses: its camera's row, infrared, wheels, and ring.
"""

import csv
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from learnt_policy import CONTROL_STEPS, EPISODE_S, LEARNT, TASKS, Task, swarms
from matplotlib.figure import Figure
from torch import nn

SWARMS, ROUNDS = 32, 40  # swarms at a time, and rounds of an episode each and an update

HIDDEN = 64
DISCOUNT, SMOOTHING = 0.97, 0.95  # discount of rewards per decision, and lambda of the generalised advantage estimate

CLIP, ENTROPY, STEP = 0.2, 0.003, 1e-3
"""Bound on the change of probabilities in an update; weight of the entropy; Adam's first step, which falls to 0."""

PASSES, BATCH = 4, 3840
LEARNING = 3  # master seed of learning


class Network(nn.Module):
    """Scores of motions and, by a network of its own, the expected discounted reward."""

    def __init__(self, inputs: int, motions: int) -> None:
        super().__init__()
        self.scores, self.value = (
            nn.Sequential(
                nn.Linear(inputs, HIDDEN), nn.Tanh(), nn.Linear(HIDDEN, HIDDEN), nn.Tanh(), nn.Linear(HIDDEN, outputs)
            )
            for outputs in (motions, 1)
        )
        with torch.no_grad():
            self.scores[-1].weight *= 0.01  # all motions are as likely at first

    def weights(self) -> dict[str, np.ndarray]:
        """Return what `learnt_policy.logits` needs."""
        found = {}
        for name, layer in zip(("first", "second", "last"), self.scores[::2], strict=True):
            found |= {name: layer.weight.detach().numpy().T, f"{name}_bias": layer.bias.detach().numpy()}
        return found


class Episode(NamedTuple):
    """What all agents did in an episode: (decisions, agents, ...) each."""

    observations: torch.Tensor
    motions: torch.Tensor
    log_probabilities: torch.Tensor
    values: torch.Tensor
    rewards: torch.Tensor


def play(env, network: Network, seed: int) -> tuple[Episode, torch.Tensor]:
    """Play an episode in all swarms; return it, and the values of where it ended."""
    observations, _ = env.reset(seed=seed)
    rows = []
    for _ in range(round(EPISODE_S / 0.1 / CONTROL_STEPS)):
        seen = torch.from_numpy(observations)
        chances = torch.distributions.Categorical(logits=network.scores(seen))
        motions = chances.sample()
        observations, rewards, *_ = env.step(motions.numpy())
        gained = torch.from_numpy(np.asarray(rewards, np.float32))
        rows.append((seen, motions, chances.log_prob(motions), network.value(seen)[:, 0], gained))
    end = network.value(torch.from_numpy(observations))[:, 0]  # an episode is cut off, not over
    return Episode(*map(torch.stack, zip(*rows, strict=True))), end


def advantages(episode: Episode, end: torch.Tensor) -> torch.Tensor:
    """Return (decisions, agents) generalised advantage estimates."""
    found, following, ahead = torch.zeros_like(episode.values), end, torch.zeros_like(end)
    for row in reversed(range(len(found))):
        surprise = (1 - DISCOUNT) * episode.rewards[row] + DISCOUNT * following - episode.values[row]
        found[row] = ahead = surprise + DISCOUNT * SMOOTHING * ahead
        following = episode.values[row]
    return found


def update(network: Network, optimiser: torch.optim.Optimizer, episode: Episode, gains: torch.Tensor) -> None:
    """Make motions that gained more than expected likelier, within bounds."""
    targets = (gains + episode.values).flatten()
    gains = ((gains - gains.mean()) / gains.std()).flatten()
    seen, motions, before = (each.flatten(0, 1) for each in episode[:3])
    for _ in range(PASSES):
        for rows in torch.randperm(len(gains)).split(BATCH):
            chances = torch.distributions.Categorical(logits=network.scores(seen[rows]))
            ratio = (chances.log_prob(motions[rows]) - before[rows]).exp()
            bounded = torch.min(ratio * gains[rows], ratio.clamp(1 - CLIP, 1 + CLIP) * gains[rows]).mean()
            missed = (network.value(seen[rows])[:, 0] - targets[rows]).square().mean()
            optimiser.zero_grad()
            (missed - bounded - ENTROPY * chances.entropy().mean()).backward()
            nn.utils.clip_grad_norm_(network.parameters(), 0.5)
            optimiser.step()


def learn(task: Task) -> Iterator[tuple[float, Network]]:
    """Yield the mean reward of each round's episodes, and the network after it."""
    torch.manual_seed(LEARNING)
    env = swarms(task, SWARMS, LEARNING)
    network = Network(env.single_observation_space.shape[0], int(env.single_action_space.n))
    optimiser = torch.optim.Adam(network.parameters(), STEP)
    for number in range(ROUNDS):
        optimiser.param_groups[0]["lr"] = STEP * (1 - number / ROUNDS)
        with torch.no_grad():
            episode, end = play(env, network, LEARNING + SWARMS * number)
            gains = advantages(episode, end)
        update(network, optimiser, episode, gains)
        yield float(episode.rewards.mean()), network


def main(stem: Path) -> None:
    """Learn all tasks, and draw how that went."""
    torch.set_num_threads(1)
    weights, courses = {}, {}
    for name, task in TASKS.items():
        courses[name] = []
        for reward, network in learn(task):
            courses[name].append(reward)
            print(name, len(courses[name]), f"{reward:.3f}", flush=True)
            learnt = network.weights()
        weights |= {f"{name}/{key}": values for key, values in learnt.items()}
    np.savez_compressed(LEARNT, **weights)
    with stem.with_suffix(".csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["round", *courses])
        for number, rewards in enumerate(zip(*courses.values(), strict=True), start=1):
            writer.writerow([number, *(f"{reward:.4f}" for reward in rewards)])
    figure = Figure(figsize=(9, 3), layout="constrained")
    for axes, (name, rewards) in zip(figure.subplots(1, len(courses)), courses.items(), strict=True):
        axes.plot(range(1, ROUNDS + 1), rewards, color="black")
        axes.set(title=name, xlabel=f"rounds of {SWARMS} episodes", ylabel="mean reward")
    figure.savefig(stem.with_suffix(".png"), dpi=110)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
