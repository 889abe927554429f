"""The machine in 3D: built from its card, moved along its orbit by one loop, changed by settings.

What moves in each frame moves by its pose, within one atomic block; properties change only when a setting does. One
thread owns the solver: `change` only says what is wanted.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from viser import ViserServer

from hydrolab.dynamics.results import Branch
from hydrolab.errors import BadInput
from hydrolab.machine.parts import Machine
from hydrolab.show.live_orbit import FIELDS, UNBALANCES, LiveOrbit, Shown, gap_words
from hydrolab.show.poses import (
    drawn_rotor_radius,
    largest_exaggeration,
    orbit_lines,
    positions,
    quaternions,
    stations,
)
from hydrolab.show.readings import reading
from hydrolab.show.scene_parts import (
    AZIMUTH,
    INSET,
    LEFT,
    Nodes,
    add_bearings,
    add_body,
    add_collars,
    add_inset,
    add_pull,
    add_rotor,
    add_shaft,
    add_stator,
    add_surroundings,
    orbit_colours,
    rotor_solids,
    sizes_of,
)

FAST, SLOW, FEW = 60.0, 30.0, 4  # frames a second, with up to FEW viewers and with more
EASE = 0.035  # s; what is drawn follows a new orbit with this time constant
SHARE = 0.28  # of the stator's radius: the gap as it is first drawn
ARROW = 1.6  # m: the arrow of the largest pull on the orbit


@dataclass(frozen=True)
class SceneSettings:
    """What the 3D machine shows. static_eccentricity: fraction of the gap. leg: of the branch, 0 is the first. field,
    unbalance: factors on the card's. exaggeration: of displacements and gap. slow_motion: how many times slower than the
    machine. view: name of the first view."""

    static_eccentricity: float = 0.0
    leg: int = 0
    field: float = 1.0
    unbalance: float = 1.0
    exaggeration: float = 50.0
    slow_motion: float = 8.0
    playing: bool = True
    names: bool = True
    dark: bool = False
    view: str = "machine"


class MachineScene:
    """The 3D scene of one machine on a viser server.

    branch: steady states over the static eccentricity, followed already; otherwise they are followed here.
    `run` starts the loop; without it, `draw` shows one phase.
    """

    def __init__(self, server: ViserServer, machine: Machine, branch: Branch | None = None, **settings: Any) -> None:
        self.server, self.machine = server, machine
        self.live = LiveOrbit(machine, branch)
        self.sizes = sizes_of(machine)
        self.nodes = Nodes()
        self.phase = 0.0
        self._lock, self._wake, self._thread = threading.Lock(), threading.Event(), None
        self._stopping = False
        gap = machine.air_gap
        steps = SHARE * self.sizes.stator / gap.gap if gap else 200.0
        self.limits: dict[str, tuple[float, float]] = {
            "static_eccentricity": (0.0, math.floor(1e3 * self.live.reach) / 1e3), "field": FIELDS, "unbalance": UNBALANCES,
            "exaggeration": (1.0, float(round(1.6 * steps))), "slow_motion": (1.0, 100.0)}
        self.views = _views(self.sizes.top, self.sizes.bottom, self.sizes.stator or 1.5)
        self.settings = self._checked(SceneSettings(exaggeration=float(round(steps))), settings)
        self.shown: Shown = self._solved(None)
        self.where = stations(machine, self.shown.orbit)
        self.drawn, self.centre = self.where, np.array(self.shown.orbit.centre)  # what the eye sees, on its way there
        self.factor = self._drawn_factor()
        self._applied = self.settings
        self._build()
        self._dress()
        self.draw(0.0)

    # ------------------------------------------------------------------ settings

    def change(self, **settings: Any) -> None:
        """Set what the scene shows; numbers are clamped to their `limits`. The loop does the rest.

        Raises BadInput for a name it does not have or a value of another kind.
        """
        with self._lock:
            self.settings = self._checked(self.settings, settings)
        self._wake.set()
        if self._thread is None:
            self._update(math.inf)
            self.draw(self.phase)

    def step(self, revolutions: float) -> None:
        """Turn the machine on by so many revolutions."""
        self.phase += 2 * math.pi * float(revolutions)
        self._wake.set()
        if self._thread is None:
            self.draw(self.phase)

    def _checked(self, now: SceneSettings, wanted: dict[str, Any]) -> SceneSettings:
        clean: dict[str, Any] = {}
        for name, value in wanted.items():
            own = getattr(now, name, None)
            if own is None:
                raise BadInput(f"{name!r} is no setting of the 3D view; there are {', '.join(vars(now))}.")
            if name == "view" and value not in self.views:
                raise BadInput(f"view is {value!r}; there are {', '.join(self.views)}.")
            if isinstance(own, bool) != isinstance(value, bool) or isinstance(own, str) != isinstance(value, str):
                kind = "true or false" if isinstance(own, bool) else "a number"
                raise BadInput(f"{name} is {value!r}; it must be {kind}.")
            if isinstance(own, float):
                if not isinstance(value, (int, float, np.number)) or not math.isfinite(value):
                    raise BadInput(f"{name} is {value!r}; it must be a finite number.")
                value = float(np.clip(value, *self.limits[name]))
            elif name == "leg":
                if not isinstance(value, (int, float, np.number)) or value != int(value):
                    raise BadInput(f"leg is {value!r}; it must be a whole number.")
                value = int(np.clip(value, 0, len(self.live.legs.all) - 1 if self.live.legs else 0))
            clean[name] = value
        return replace(now, **clean)

    @property
    def smallest_gap(self) -> float:
        """Smallest air gap on the orbit shown, m (inf where there is none)."""
        return self.shown.orbit.smallest_gap

    @property
    def reading(self) -> str:
        """What is shown, in words."""
        return f"{self.shown.words} {reading(self.shown.orbit)} Displacements and gap are drawn " \
               f"{self.factor:.0f} times as large, the shaft slim."

    # ------------------------------------------------------------------ building

    def _build(self) -> None:
        server, machine, sizes = self.server, self.machine, self.sizes
        server.gui.configure_theme(dark_mode=self.settings.dark, show_share_button=False, show_logo=False)
        position, look_at = self.views[self.settings.view]
        server.initial_camera.position, server.initial_camera.look_at = position, look_at
        add_surroundings(server, sizes, self.settings.dark)
        add_shaft(server, self.nodes, self.drawn.depths[:self.drawn.nodes], sizes.shaft)
        add_bearings(server, machine, sizes)
        add_collars(server, self.nodes, machine, sizes)
        if machine.air_gap:
            add_stator(server, self.nodes, sizes)
            add_rotor(server, self.nodes, machine, self._rotor_radius())
            add_pull(server, self.nodes, 0.05)
            add_inset(server, self.nodes, sizes)
        for body in machine.bodies:
            if not (machine.air_gap and body.name == machine.air_gap.body):
                add_body(server, self.nodes, machine, body)
        self._add_names()

    def _add_names(self) -> None:
        def name(text: str, position: Any, scale: float = 1.0, anchor: str = "center-left") -> Any:
            label = self.server.scene.add_label(f"/names/{text}", text, position=tuple(position), anchor=anchor,
                                                font_screen_scale=scale)
            self.nodes.names.append(label)
            return label

        machine, sizes, right = self.machine, self.sizes, -LEFT
        gap = machine.air_gap
        for body in machine.bodies:
            depth = self.drawn.depths[self.drawn.nodes + machine.bodies.index(body)]
            reach = 1.22 * sizes.stator if gap and body.name == gap.body else 1.6
            name(body.name, right * reach + [0, 0, -depth])
        if machine.shaft is not None:
            for bearing in (*machine.bearings, *machine.thrust_bearings):
                name(bearing.name, right * 5.0 * sizes.shaft + [0, 0, -float(machine.shaft.nodes[bearing.node])])
        if gap:
            name("stator, cut away", LEFT * 1.22 * sizes.stator + [0, 0, 0.5], anchor="center-right")
            foot = LEFT * (0.62 * (sizes.top - sizes.bottom) + 0.2) + [0, 0, sizes.bottom + 2.2]
            name(f"orbit in its gap of {1e3 * gap.gap:.3g} mm", foot + [0, 0, -INSET - 0.35], 0.9, "center-center")
            self.big = self.server.scene.add_label("/gap", "", position=tuple(foot + [0, 0, INSET + 0.55]),
                                                   font_screen_scale=1.7, anchor="center-center")
        self.small = self.server.scene.add_label("/scale", "", position=(0.0, 0.0, sizes.bottom - 1.75),
                                                 font_screen_scale=0.9, anchor="center-center")

    def _rotor_radius(self) -> float:
        return drawn_rotor_radius(self.sizes.stator, self.machine.air_gap.gap, self.factor)

    def _drawn_factor(self) -> float:
        """The exaggeration that is drawn: as wanted, less where a tilt would look wrong."""
        return min(self.settings.exaggeration, largest_exaggeration(self.where))

    def _dress(self) -> None:
        """Everything that changes with a setting and not with time."""
        orbit, gap = self.shown.orbit, self.machine.air_gap
        factor = self.factor = self._drawn_factor()
        lines, away = orbit_lines(self.where, factor)
        largest = float(away.max())
        self.server.scene.add_line_segments("/orbits", lines.astype(np.float32), orbit_colours(away, largest), thickness=4.0,
                                            thickness_units="screen")
        self.small.text = f"displacements and gap × {factor:.0f}, {self.settings.slow_motion:.0f} times slower"
        for label in self.nodes.names:
            label.visible = self.settings.names
        if not gap:
            return
        for name, (vertices, _) in rotor_solids(self.machine, self._rotor_radius()).items():
            self.nodes.meshes[name].vertices = vertices.astype(np.float32)
        self.big.text = f"smallest gap {gap_words(orbit)}"
        turn = 2 * np.pi * np.arange(193) / 192
        inside = (orbit.positions(turn) - orbit.centre[:, None]) * INSET / gap.gap
        path = np.column_stack([*inside, np.full(193, 0.01)])
        colour = {"stable": (0.0, 0.62, 0.45), "unstable": (0.835, 0.369, 0.0)}.get(self.shown.verdict, (0.5, 0.5, 0.5))
        self.server.scene.add_line_segments("/inset/orbit", np.stack([path[:-1], path[1:]], 1).astype(np.float32),
                                            tuple(round(255 * c) for c in colour), thickness=4.0, thickness_units="screen")
        self._pull_scale = ARROW / max(float(np.hypot(*self._pull(turn)).max()), 1e-9)

    def _pull(self, phase: Any) -> np.ndarray:
        """Pull on the generator at phases of the orbit, N, (2, …)."""
        orbit = self.shown.orbit
        e = orbit.positions(np.atleast_1d(phase)) - orbit.centre[:, None]
        law = orbit.model.law
        if len(orbit.model.selection) > 2 or law.moving:  # the pull's own share is what the card's gap gives
            law = self.machine.model().law if not self.machine.model().law.moving else law
        return law.force(e)

    # ------------------------------------------------------------------ moving

    def draw(self, phase: float) -> None:
        """Show the machine at a phase Ωt, rad."""
        factor, motion = self.factor, self.drawn.motion(phase)
        places, leaning = positions(self.drawn, motion, factor), quaternions(motion, factor)
        spinning = quaternions(motion, factor, phase)
        moving, machine = self.nodes.moving, self.machine
        with self.server.atomic():
            for bone, place, turn in zip(moving["shaft"].bones, places, leaning, strict=False):
                bone.position, bone.wxyz = place, turn
            for i, body in enumerate(machine.bodies, self.drawn.nodes):
                moving[body.name].position, moving[body.name].wxyz = places[i], spinning[i]
            for bearing in machine.thrust_bearings:
                moving[bearing.name].position, moving[bearing.name].wxyz = places[bearing.node], leaning[bearing.node]
            if machine.air_gap:
                self._draw_gap(phase, factor, places)
        self.server.flush()

    def _draw_gap(self, phase: float, factor: float, places: np.ndarray) -> None:
        moving, machine = self.nodes.moving, self.machine
        names = [body.name for body in machine.bodies]
        at = self.drawn.nodes + names.index(machine.air_gap.body)
        depth = -self.drawn.depths[at]
        moving["stator"].position = (factor * self.centre[0], factor * self.centre[1], depth)
        x, z = self.drawn.motion(phase)[at, :2] - self.centre
        moving["dot"].position = (x * INSET / machine.air_gap.gap, z * INSET / machine.air_gap.gap, 0.02)
        fx, fz = self._pull_scale * self._pull(phase)[:, 0]
        length, angle = math.hypot(fx, fz), math.atan2(fz, fx)
        tail = places[at] + [0, 0, 0.78 * machine.air_gap.length]
        turn = (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))
        for bone, along in zip(moving["pull"].bones, (0.0, length), strict=False):
            bone.position = tail + along * np.array([math.cos(angle), math.sin(angle), 0.0])
            bone.wxyz = turn

    def _solved(self, before: Shown | None) -> Shown:
        s = self.settings
        return self.live.at(s.static_eccentricity, s.leg, s.field, s.unbalance, before)

    def _update(self, passed: float) -> None:
        """Follow the settings: solve where they changed, and bring what is drawn nearer to the orbit, `passed` s later."""
        with self._lock:
            wanted = self.settings
        if wanted != self._applied:
            if _solve_for(wanted) != _solve_for(self._applied):
                self.shown = self._solved(self.shown)
                if self.shown.jumped:  # it stays where it jumped to: lowering the eccentricity again does not bring it back
                    wanted = self._stay(wanted, self.shown.leg)
                self.where = stations(self.machine, self.shown.orbit)
            if wanted.dark != self._applied.dark:
                self.server.gui.configure_theme(dark_mode=wanted.dark, show_share_button=False, show_logo=False)
                add_surroundings(self.server, self.sizes, wanted.dark)
            self._applied = wanted
            self._dress()
        share = 1.0 if self.shown.jumped else 1 - math.exp(-passed / EASE)
        self.drawn = self.drawn.towards(self.where, share)
        self.centre = (1 - share) * self.centre + share * self.shown.orbit.centre

    def _stay(self, wanted: SceneSettings, leg: int) -> SceneSettings:
        """Settings with the leg that the machine jumped to, unless something else was set meanwhile."""
        with self._lock:
            if self.settings == wanted:
                self.settings = replace(wanted, leg=leg)
            return replace(wanted, leg=leg)

    @property
    def legs(self) -> tuple[int, ...]:
        """The legs of the branch that the machine can be on at the present eccentricity."""
        return self.live.legs.stable_at(self.settings.static_eccentricity) if self.live.legs else ()

    def run(self) -> None:
        """Start the loop that moves the machine; it ends with `stop`."""
        if self._thread is None:
            self._stopping = False
            self._thread = threading.Thread(target=self._loop, name="hydrolab scene", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """End the loop and wait for it."""
        thread, self._thread = self._thread, None
        self._stopping = True
        self._wake.set()
        if thread is not None and thread is not threading.current_thread():
            thread.join(5)

    def _loop(self) -> None:
        last = time.perf_counter()
        while not self._stopping:
            frame = 1 / (FAST if len(self.server.get_clients()) <= FEW else SLOW)
            now = time.perf_counter()
            self._update(now - last)
            if self.settings.playing:
                self.phase += self.machine.speed / self.settings.slow_motion * (now - last)
            last = now
            self.draw(self.phase)
            self._wake.clear()
            time.sleep(max(0.0, frame - (time.perf_counter() - now)))

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        """Hold the loop inside a `with`, for a recording."""
        running = self._thread is not None
        self.stop()
        try:
            yield
        finally:
            if running:
                self.run()


def _solve_for(settings: SceneSettings) -> tuple[float, int, float, float]:
    """The settings on which the orbit depends."""
    return settings.static_eccentricity, settings.leg, settings.field, settings.unbalance


def _views(top: float, bottom: float, radius: float) -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
    """Position and look-at of each view: the whole machine, the air gap from above, the lower end."""
    height = top - bottom

    def seen(distance: float, up: float, at: float, aside: float = 0.0) -> tuple[tuple[float, ...], tuple[float, ...]]:
        away = np.array([math.cos(AZIMUTH), math.sin(AZIMUTH), 0.0])
        centre = aside * LEFT + [0, 0, at]
        return tuple(centre + distance * away + [0, 0, up]), tuple(centre)

    return {"machine": seen(0.86 * height + 1.2, 0.88 * height, bottom + 0.47 * height, -0.12 * height),
            "air gap": seen(1.9 * radius, 1.5 * radius, top - 0.2), "lower end": seen(4.6, 1.8, bottom + 0.8)}
