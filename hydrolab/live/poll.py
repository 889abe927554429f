"""A question to the room: one vote a connection, not faster than people tap, and nothing else."""

from __future__ import annotations

import time
from collections import Counter, OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field

from hydrolab.live.run_sheet import CHOICES

RATE = 10.0  # votes a second from one address, where a whole room may sit behind one
ADDRESSES = 10_000  # remembered at once; the oldest is forgotten


@dataclass(eq=False)
class Poll:
    """The votes on the question that is open, by connection; a vote goes with its connection, so
    that coming back adds none. Only the event loop touches it.
    """

    now: Callable[[], float] = field(default=time.monotonic, repr=False)
    votes: dict[int, str] = field(default_factory=dict)
    _last: OrderedDict[str, float] = field(default_factory=OrderedDict, repr=False)

    def open(self) -> None:
        """Begin with a new question."""
        self.votes.clear()

    def take(self, connection: int, choice: object, address: str) -> bool:
        """Count a vote, or not: a second one, one too soon after another from the address, or one
        that is no choice.
        """
        soon = self.now() - self._last.get(address, -1e9) < 1 / RATE
        if choice not in tuple(CHOICES) or connection in self.votes or soon:
            return False
        self._last[address] = self.now()
        self._last.move_to_end(address)
        if len(self._last) > ADDRESSES:
            self._last.popitem(last=False)
        self.votes[connection] = str(choice)
        return True

    def forget(self, connection: int) -> None:
        """A connection has gone, and its vote with it."""
        self.votes.pop(connection, None)

    def counts(self) -> list[int]:
        """Votes for each of the choices."""
        found = Counter(self.votes.values())
        return [found[letter] for letter in CHOICES]
