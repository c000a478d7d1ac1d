"""Learned policies: their training with stable-baselines3, their files, and how they are played."""
