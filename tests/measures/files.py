"""Measures in files, for tests."""

from pathlib import Path

COUNTER = """
class Counter:
    def __init__(self, simulation, *, weight=1.0, offset=0, loud=False, label="all"):
        self.weight, self.offset, self.told = weight, offset, 0

    def cycle(self, event, state):
        self.told += 1

    def value(self):
        return self.offset + self.weight * self.told
"""

TELLTALE = """
class Telltale:
    def __init__(self, simulation):
        self.seen = []

    def step(self, step, state):
        self.seen.append(step.number)

    def event(self, event, state):
        self.seen.append(len(event.fired))

    def value(self):
        return self.seen
"""


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path
