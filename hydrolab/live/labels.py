"""Words in the 3D scene, and how much room they take: what a view must show and must not cover."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import ViserServer

EM = 0.4  # units of the drawing: height of letters; 18 pixels at least on a screen of 768
WIDTH, PAD, LINE = 0.6, 0.3, 1.45  # em: of a letter on average, beside the words, of a line


@dataclass(eq=False)
class Label:
    """A text that faces the camera. em: height of its letters, m; anchor: as viser has it."""

    handle: Any
    text: str
    place: NDArray
    em: float
    anchor: str

    @classmethod
    def add(cls, server: ViserServer, path: str, text: str, place: NDArray, em: float,
            anchor: str = "center-left") -> Label:
        """Write a text into a scene."""
        place = np.asarray(place, float)
        handle = server.scene.add_label(path, text, position=place, anchor=anchor,
                                        font_size_mode="scene", font_scene_height=em)
        return cls(handle, text, place, em, anchor)

    def say(self, text: str, place: NDArray | None = None) -> None:
        """Change the text, and where it is."""
        if text != self.text:
            self.handle.text = self.text = text
        if place is not None and not np.array_equal(place, self.place):
            self.place = np.asarray(place, float)
            self.handle.position = self.place

    def corners(self, right: NDArray, up: NDArray) -> NDArray:
        """Two opposite corners of its box, m, for a camera with these directions, (2, 3)."""
        row, column = self.anchor.split("-")
        wide, high = self.em * (WIDTH * len(self.text) + 2 * PAD), self.em * LINE
        x = {"left": 0.0, "center": -0.5, "right": -1.0}[column]
        y = {"bottom": 0.0, "center": -0.5, "top": -1.0}[row]
        low = self.place + x * wide * right + y * high * up
        return np.stack([low, low + wide * right + high * up])
