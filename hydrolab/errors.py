"""Errors worded for the person who has to act on them: what was wrong, the value, what is allowed.
"""


class BadInput(ValueError):
    """An input outside what is allowed; the sentence names it, its value and what to try."""


class NoConvergence(RuntimeError):
    """A solver stopped without a solution; the sentence says where and what to try next."""


class Contact(RuntimeError):
    """The rotor touches the stator; the sentence says when and at which gap angle."""
