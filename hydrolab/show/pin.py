"""The presenter's PIN: six digits, a few guesses for each address, then a wait that doubles."""

from __future__ import annotations

import hmac
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field

GUESSES = 5  # wrong ones before an address has to wait
FIRST_WAIT = 60.0  # s; every further wrong guess doubles it
ADDRESSES = 10_000  # remembered at once; the oldest is forgotten


def new_digits() -> str:
    """Six random digits."""
    return f"{secrets.randbelow(10**6):06d}"


@dataclass(eq=False)
class Pin:
    """A PIN and who has guessed at it. Safe to use from several threads."""

    digits: str = field(default_factory=new_digits, repr=False)
    now: Callable[[], float] = field(default=time.monotonic, repr=False)
    _wrong: OrderedDict[str, tuple[int, float]] = field(default_factory=OrderedDict, repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    def check(self, guess: object, address: str) -> str:
        """"" where the guess is right, else a sentence for the one who guessed, from this address.

        While an address has to wait, a right guess does not count either. Comparing takes as long for every guess.
        """
        with self._lock:
            wrong, until = self._wrong.get(address, (0, 0.0))
            left = until - self.now()
            if left > 0:
                return f"Too many wrong PINs from here; try again in {left:.0f} s."
            text = guess.strip() if isinstance(guess, str) else ""
            if hmac.compare_digest(text.encode(), self.digits.encode()):
                self._wrong.pop(address, None)
                return ""
            wrong += 1
            wait = FIRST_WAIT * 2.0 ** min(wrong - GUESSES, 20) if wrong >= GUESSES else 0.0
            self._wrong[address] = (wrong, self.now() + wait)
            self._wrong.move_to_end(address)
            if len(self._wrong) > ADDRESSES:
                self._wrong.popitem(last=False)
            if wait:
                return f"Too many wrong PINs from here; try again in {wait:.0f} s."
            return f"That is not the PIN; {GUESSES - wrong} more guess{'es' if GUESSES - wrong > 1 else ''}."
