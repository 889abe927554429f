"""The machine in 3D: built from its card, moved along its orbit by one loop, changed by settings.

What moves in each frame moves by its pose, within one atomic block; properties change only when a
setting does. One thread owns the solver: `change` only says what is wanted.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import ViserServer

from hydrolab.dynamics.branches import Branch
from hydrolab.dynamics.harmonics import PERIOD
from hydrolab.errors import BadInput
from hydrolab.figures.readings import reading
from hydrolab.live.bodies import Parts, orbit_colours, sizes_of
from hydrolab.live.moving_orbit import FIELDS, UNBALANCES, LiveOrbit, Shown
from hydrolab.live.poses import largest_exaggeration, orbit_rings, positions, quaternions, stations
from hydrolab.live.surroundings import (
    LENS,
    add_inset,
    add_lines,
    add_names,
    add_surroundings,
    views_of,
)
from hydrolab.machine.parts import Machine

FAST, SLOW, FEW = 60.0, 36.0, 4  # frames a second, with up to FEW viewers and with more
# s between frames that nobody sees: a cell in a notebook leaves the kernel to the others
IDLE = 0.2
EASE = 0.035  # s; what is drawn follows a new orbit with this time constant
SHARE = 0.28  # of the stator's radius: the gap as it is first drawn
ARROW = 1.6  # units of the drawing: the arrow of the largest pull on the orbit
# of the shaft's radius: the rings are a little wider than what the shaft sweeps, to be seen
RINGS = 1.25


@dataclass(frozen=True)
class SceneSettings:
    """What the 3D machine shows.

    static_eccentricity: fraction of the gap. leg: of the branch, 0 is the first. field, unbalance:
    factors on the card's. exaggeration: of displacements and gap, as drawn: a tilt that would look
    wrong lowers it. slow_motion: how many times slower than the machine. view: the first view.
    """

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

    @property
    def solved_for(self) -> tuple[float, int, float, float]:
        """The settings on which the orbit depends."""
        return self.static_eccentricity, self.leg, self.field, self.unbalance


def changed(settings: SceneSettings, wanted: Mapping[str, Any],
            limits: Mapping[str, tuple[float, float]], views: Collection[str],
            legs: int) -> SceneSettings:
    """Settings with what is wanted, numbers clamped to their limits and the leg to the `legs` there
    are.

    views: their names. Raises BadInput for a name that is no setting or a value of another kind.
    """
    return replace(settings, **{name: _accepted(settings, name, value, limits, views, legs)
                                for name, value in wanted.items()})


def _accepted(settings: SceneSettings, name: str, value: Any,
              limits: Mapping[str, tuple[float, float]], views: Collection[str],
              legs: int) -> Any:
    own = vars(settings).get(name)
    if own is None:
        raise BadInput(f"{name!r} is no setting of the 3D view; there are "
                       f"{', '.join(vars(settings))}.")
    if isinstance(own, str):
        if not isinstance(value, str) or value not in views:
            raise BadInput(f"{name} is {value!r}; there are {', '.join(views)}.")
        return value
    truth = isinstance(value, bool | np.bool_)
    if isinstance(own, bool):
        if not truth:
            raise BadInput(f"{name} is {value!r}; it must be true or false.")
        return bool(value)
    if truth or not isinstance(value, int | float | np.number) or not math.isfinite(value):
        raise BadInput(f"{name} is {value!r}; it must be a finite number.")
    if isinstance(own, int):
        if value != int(value):
            raise BadInput(f"{name} is {value!r}; it must be a whole number.")
        return int(np.clip(value, 0, max(legs, 1) - 1))
    return float(np.clip(value, *limits[name]))


class MachineScene:
    """The 3D scene of one machine on a viser server.

    branch: steady states over the static eccentricity, followed already; otherwise they are
    followed here. `run` starts the loop; without it, `draw` shows one phase.
    """

    def __init__(self, server: ViserServer, machine: Machine, branch: Branch | None = None,
                 **settings: Any) -> None:
        self.server, self.machine = server, machine
        self.live = LiveOrbit(machine, branch)
        self.sizes = sizes_of(machine)
        self.parts = Parts(server, machine, self.sizes)
        self.phase = 0.0
        self._lock, self._wake, self._thread = threading.Lock(), threading.Event(), None
        self._stopping = False
        scale = self._first_exaggeration()
        self.limits: dict[str, tuple[float, float]] = {
            "static_eccentricity": (0.0, math.floor(1e3 * self.live.reach) / 1e3),
            "field": FIELDS, "unbalance": UNBALANCES, "exaggeration": (1.0, 1.6 * scale),
            "slow_motion": (1.0, 100.0)}
        self.views = views_of(self.sizes)
        self.settings = self._checked(SceneSettings(exaggeration=scale), settings)
        self._wish = self.settings.exaggeration
        self.shown: Shown = self._solved(None)
        self.where = stations(machine, self.shown.orbit)
        # what the eye sees, on its way there
        self.drawn, self.centre = self.where, np.array(self.shown.orbit.centre)
        self.settings = self._applied = replace(self.settings, exaggeration=self._factor())
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
            if "exaggeration" in settings:
                self._wish = self.settings.exaggeration
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

    def _checked(self, settings: SceneSettings, wanted: dict[str, Any]) -> SceneSettings:
        return changed(settings, wanted, self.limits, self.views,
                       len(self.live.legs.all) if self.live.legs else 1)

    @property
    def smallest_gap(self) -> float:
        """Smallest air gap on the orbit shown, m (inf where there is none)."""
        return self.shown.orbit.smallest_gap

    @property
    def legs(self) -> tuple[int, ...]:
        """The legs of the branch that the machine can be on at the present eccentricity."""
        legs = self.live.legs
        return legs.stable_at(self.settings.static_eccentricity) if legs else ()

    @property
    def reading(self) -> str:
        """What is shown, in words."""
        return (f"{self.shown.words} {reading(self.shown.orbit)} Displacements"
                f"{' and gap' if self.inset else ''} are drawn {self._applied.exaggeration:.0f} "
                "times as large, the shaft slim.")

    # ------------------------------------------------------------------ building

    def _first_exaggeration(self) -> float:
        """A whole factor that draws the gap, or the largest displacement of a machine without one,
        to be seen well.
        """
        if self.machine.air_gap:
            return float(round(SHARE * self.sizes.stator / self.machine.air_gap.gap))
        motion = stations(self.machine, self.live.at(0.0, 0, 1.0, 1.0).orbit).motion(PERIOD)
        largest = float(np.hypot(motion[:, 0], motion[:, 1]).max())
        return float(max(round(SHARE * self.sizes.unit / largest), 1)) if largest else 1.0

    def _factor(self) -> float:
        """The exaggeration to draw: as wished, less where a tilt would look wrong."""
        return min(self._wish, largest_exaggeration(self.where))

    def _build(self) -> None:
        server, machine, sizes = self.server, self.machine, self.sizes
        camera, gap = server.initial_camera, machine.air_gap
        camera.position, camera.look_at = self.views[self.settings.view]
        camera.fov = LENS
        nodes, rest = np.split(self.drawn.depths, [self.drawn.nodes])
        self.parts.add(nodes, self.settings.exaggeration)
        self.inset = add_inset(server, sizes, gap.gap) if gap else None
        self.names = add_names(server, machine, sizes, rest)
        self._light(self.settings.dark)

    def _light(self, dark: bool) -> None:
        """A bright room or a dark one."""
        self.server.gui.configure_theme(dark_mode=dark, show_share_button=False, show_logo=False)
        add_surroundings(self.server, self.sizes, dark)
        if self.inset:
            self.inset.dress(dark)

    def _dress(self) -> None:
        """Everything that changes with a setting and not with time."""
        shown, settings = self.shown, self._applied
        rings, away = orbit_rings(self.where, settings.exaggeration, RINGS * self.sizes.shaft)
        add_lines(self.server, "/orbits", rings, orbit_colours(away, float(away.max())), 5.0)
        self.names.say(shown.orbit, settings.exaggeration, settings.slow_motion, settings.names)
        if self.inset is None:
            return
        self.parts.dress_gap(settings.exaggeration)
        self.inset.draw(shown.orbit, shown.verdict)
        largest = float(np.hypot(*self._pull(PERIOD)).max())
        self._pull_scale = ARROW * self.sizes.unit / max(largest, 1e-9)

    def _pull(self, phase: NDArray) -> NDArray:
        """Magnetic pull on the generator at phases of the orbit, N, (2, P)."""
        orbit = self.shown.orbit
        u = orbit.model.relative(orbit.coordinates(phase), orbit.centre[:, None])
        return orbit.model.pull(u, phase, orbit.speed)

    # ------------------------------------------------------------------ moving

    def draw(self, phase: float) -> None:
        """Show the machine at a phase Ωt, rad."""
        factor, motion = self._applied.exaggeration, self.drawn.motion(phase)
        places, leaning = positions(self.drawn, motion, factor), quaternions(motion, factor)
        spinning = quaternions(motion, factor, phase)
        moving = self.parts.moving
        with self.server.atomic():
            for bone, place, turn in zip(moving["shaft"].bones, places, leaning, strict=False):
                bone.position, bone.wxyz = place, turn
            for name, station, spins in self.parts.riding:
                moving[name].position = places[station]
                moving[name].wxyz = (spinning if spins else leaning)[station]
            if self.inset:
                self._draw_gap(phase, motion, places)
        self.server.flush()

    def _draw_gap(self, phase: float, motion: NDArray, places: NDArray) -> None:
        """The stator, the dot in the inset, and the arrow of the pull on top of the rotor."""
        moving, gap, factor = self.parts.moving, self.machine.air_gap, self._applied.exaggeration
        at = next(station for name, station, _ in self.parts.riding if name == gap.body)
        moving["stator"].position = (*(factor * self.centre), -self.drawn.depths[at])
        self.inset.dot.position = self.inset.place(motion[at, :2] - self.centre)
        fx, fz = self._pull_scale * self._pull(np.array([phase]))[:, 0]
        length, angle = math.hypot(fx, fz), math.atan2(fz, fx)
        tail = places[at] + [0, 0, 0.78 * gap.length]
        turn = (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))
        for bone, along in zip(moving["pull"].bones, (0.0, length), strict=False):
            bone.position = tail + along * np.array([math.cos(angle), math.sin(angle), 0.0])
            bone.wxyz = turn

    def _solved(self, before: Shown | None) -> Shown:
        return self.live.at(*self.settings.solved_for, before)

    def _update(self, passed: float) -> None:
        """Follow the settings: solve where they changed, and bring what is drawn nearer to the
        orbit, `passed` s later.
        """
        with self._lock:
            wanted = self.settings
        if wanted != self._applied:
            if wanted.solved_for != self._applied.solved_for:
                self.shown = self._solved(self.shown)
                self.where = stations(self.machine, self.shown.orbit)
            if wanted.dark != self._applied.dark:
                self._light(wanted.dark)
            self._applied = self._settled(wanted)
            self._dress()
        share = 1.0 if self.shown.jumped else 1 - math.exp(-passed / EASE)
        self.drawn = self.drawn.towards(self.where, share)
        self.centre = (1 - share) * self.centre + share * self.shown.orbit.centre

    def _settled(self, wanted: SceneSettings) -> SceneSettings:
        """The settings as they can be drawn, which are then the scene's, unless something else was
        set meanwhile.
        """
        # it stays where it jumped to: lowering the eccentricity again does not bring it back
        leg = self.shown.leg if self.shown.jumped else wanted.leg
        drawn = replace(wanted, leg=leg, exaggeration=self._factor())
        with self._lock:
            if self.settings == wanted:
                self.settings = drawn
        return drawn

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
        last = due = time.perf_counter()
        while not self._stopping:
            viewers, now = len(self.server.get_clients()), time.perf_counter()
            self._wake.clear()
            self._update(now - last)
            if self.settings.playing:
                self.phase += self.machine.speed / self.settings.slow_motion * (now - last)
            last = now
            self.draw(self.phase)
            if viewers:
                # The time by which a sleep overshoots is made up for; a frame that was late is not.
                due = max(due + 1 / (FAST if viewers <= FEW else SLOW), now)
                time.sleep(max(0.0, due - time.perf_counter()))
            else:
                self._wake.wait(IDLE)

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
