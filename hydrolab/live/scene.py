"""The machine in 3D: built from its card, moved along its orbit by one loop, changed by settings.

What moves in each frame moves by its pose, within one atomic block; properties change only when a
setting does. One thread owns the solver: `change` only says what is wanted.

words: what each text may be. first: 1X in x, m 0-to-peak.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections import deque
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import ViserServer

from hydrolab.dynamics.branches import Branch
from hydrolab.dynamics.escape import Flight, Jump
from hydrolab.dynamics.harmonics import PERIOD, synthesise
from hydrolab.errors import BadInput
from hydrolab.figures.readings import reading
from hydrolab.live.board import phases_of_tail
from hydrolab.live.bodies import Parts, orbit_colours, sizes_of
from hydrolab.live.moving_orbit import (
    ENDINGS,
    FIELDS,
    SLOWED,
    UNBALANCES,
    LiveOrbit,
    Shown,
)
from hydrolab.live.poses import (
    Magnified,
    at_stations,
    largest_bow,
    largest_exaggeration,
    magnified,
    orbit_rings,
    positions,
    quaternions,
    stations,
)
from hydrolab.live.surroundings import (
    ASPECT,
    LENS,
    add_board,
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
BOW = 4.0  # the bow of the shaft is drawn so many times larger than displacements, at first
# of the shaft's radius: the ghost is a little wider than what the shaft sweeps, to be seen
GHOST = 1.12
SETTLED = 20.0  # times EASE, after which nothing is left of what was drawn before
WORK = 0.012  # s of each frame in which a motion over the edge is integrated
KEPT = 900  # places of the rotor that the strip remembers
MOVING = ("static_eccentricity", "field", "unbalance")  # settings that can be brought slowly


@dataclass(frozen=True)
class SceneSettings:
    """What the 3D machine shows.

    static_eccentricity: fraction of the gap. leg: of the branch, 0 is the first. field, unbalance:
    factors on the card's. exaggeration: of displacements and gap, bow: of the bow of the shaft, as
    drawn: a tilt that would look wrong lowers them. slow_motion: how many times slower than the
    machine. ending: of the motion over an edge that is shown, where they end differently. view: the
    first view.
    """

    static_eccentricity: float = 0.0
    leg: int = 0
    field: float = 1.0
    unbalance: float = 1.0
    exaggeration: float = 50.0
    bow: float = 200.0
    slow_motion: float = 8.0
    ending: str = "any"
    playing: bool = True
    names: bool = True
    dark: bool = False
    view: str = "machine"

    @property
    def solved_for(self) -> tuple[float, int, float, float]:
        """The settings on which the orbit depends."""
        return self.static_eccentricity, self.leg, self.field, self.unbalance


def changed(settings: SceneSettings, wanted: Mapping[str, Any],
            limits: Mapping[str, tuple[float, float]], words: Mapping[str, Collection[str]],
            legs: int) -> SceneSettings:
    """Settings with what is wanted, numbers clamped to their limits and the leg to the `legs` there
    are.

    views: their names. Raises BadInput for a name that is no setting or a value of another kind.
    """
    return replace(settings, **{name: _accepted(settings, name, value, limits, words, legs)
                                for name, value in wanted.items()})


def _accepted(settings: SceneSettings, name: str, value: Any,
              limits: Mapping[str, tuple[float, float]], words: Mapping[str, Collection[str]],
              legs: int) -> Any:
    own = vars(settings).get(name)
    if own is None:
        raise BadInput(f"{name!r} is no setting of the 3D view; there are "
                       f"{', '.join(vars(settings))}.")
    if isinstance(own, str):
        if not isinstance(value, str) or value not in words[name]:
            raise BadInput(f"{name} is {value!r}; there are {', '.join(words[name])}.")
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
        self.shown: Shown = self.live.at(0.0, 0, 1.0, 1.0)
        self.where = self.drawn = stations(machine, self.shown.orbit)
        self.centre = np.array(self.shown.orbit.centre)
        # of the place whose orbit is the machine's
        self.at = int(np.argmin([np.abs(place[:2] - self.shown.orbit.coefficients).max()
                                 for place in self.where.coefficients]))
        scale = self._first_exaggeration()
        self.limits: dict[str, tuple[float, float]] = {
            "static_eccentricity": (0.0, math.floor(1e3 * self.live.reach) / 1e3),
            "field": FIELDS, "unbalance": UNBALANCES, "exaggeration": (1.0, 1.6 * scale),
            "bow": (1.0, 8.0 * scale), "slow_motion": (1.0, 100.0)}
        # the motion over an edge: integrated, shown from the loop's phase less `_begun`
        self.jump: Jump | None = None
        self.flight: Flight | None = None
        self._begun, self.held, self._landed = 0.0, False, 0
        self._searched = False  # whether the thread that looks for flips has not been heard yet
        self._until = math.inf  # the phase at which it stops
        self._eased = 0.0  # s since what is drawn set out for `where`
        self._glide: tuple[SceneSettings, SceneSettings, float, float] | None = None
        self.track: deque[tuple[float, float, float]] = deque(maxlen=KEPT)
        self._build()
        self.settings = self._applied = SceneSettings(exaggeration=scale, bow=BOW * scale)
        self.settings = self._checked(self.settings, settings)
        self._wish = self.settings.exaggeration, self.settings.bow
        self._light(self.settings.dark)
        if self.settings.solved_for != self._applied.solved_for:
            self._solve(self.settings)
        self.where = self.drawn = stations(machine, self.shown.orbit)
        self.centre = np.array(self.shown.orbit.centre)
        self.settings = self._applied = self._factors(self.settings)
        self._dress()
        camera = server.initial_camera
        camera.position, camera.look_at = self.views[self.settings.view].camera(ASPECT)
        camera.fov, camera.up = LENS, tuple(self.sizes.up)
        self.draw(0.0)

    # ------------------------------------------------------------------ settings

    def change(self, **settings: Any) -> None:
        """Set what the scene shows; numbers are clamped to their `limits`. The loop does the rest.

        Raises BadInput for a name it does not have or a value of another kind.
        """
        with self._lock:
            self.settings, self._glide = self._checked(self.settings, settings), None
            if "playing" in settings:
                self._until = math.inf
            self._wished(settings)
        self._wake.set()
        if self._thread is None:
            self._update(math.inf)
            self.draw(self.phase)

    def bring(self, seconds: float, **settings: Any) -> None:
        """Set what the scene shows, eccentricity, field and unbalance evenly within some seconds.

        Raises BadInput as `change` does.
        """
        if self._thread is None:
            return self.change(**settings)
        with self._lock:
            now, wanted = self.settings, self._checked(self.settings, settings)
            self._wished(settings)
            begin = replace(wanted, **{name: getattr(now, name) for name in MOVING})
            self.settings = begin
            self._glide = begin, wanted, time.perf_counter(), seconds
        self._wake.set()

    def _wished(self, settings: Mapping[str, Any]) -> None:
        self._wish = tuple(getattr(self.settings, name) if name in settings else wish
                           for name, wish in zip(("exaggeration", "bow"), self._wish, strict=True))

    def go_on(self, revolutions: float) -> None:
        """Turn on by so many revolutions, in slow motion, and stop."""
        until = self.phase + 2 * math.pi * revolutions
        if self._thread is None:
            self.phase = until
        self.change(playing=True)
        self._until = until

    def again(self) -> None:
        """Show the motion over the edge once more, with the other ending where there is one."""
        jump, flight = self.jump, self.flight
        if jump is not None and self._pending is None:
            last = flight.ends if flight else self._landed
            self._next_ending = "orbit" if last < 0 else "stator"
            self._pending = jump
            self._wake.set()

    def go_to(self, eccentricity: float, first: float) -> None:
        """Go to the steady state nearest to an eccentricity and 1X in x (m 0-to-peak)."""
        reach = self.board.reach[0] / 100, self.board.reach[1] / 1e6
        nearest = []
        for leg, (legs, own) in enumerate(self.live.ways):
            value = float(np.clip(eccentricity, legs.all[own].low, legs.all[own].high))
            orbit = legs.orbit(value, own)
            if orbit is not None:
                own_first = float(legs.first(np.empty(0), orbit.local[None])[0]) / 1e6
                away = math.hypot((value - eccentricity) / reach[0], (own_first - first) / reach[1])
                nearest.append((away, value, leg))
        if nearest:
            _, value, leg = min(nearest)
            self.change(static_eccentricity=value, leg=leg)

    def _checked(self, settings: SceneSettings, wanted: dict[str, Any]) -> SceneSettings:
        return changed(settings, wanted, self.limits, {"view": self.views, "ending": ENDINGS},
                       max(len(self.live.ways), 1))

    @property
    def smallest_gap(self) -> float:
        """Smallest air gap on the orbit shown, m (inf where there is none)."""
        if self.flight is not None:
            return self.flight.smallest_gap(self.phase - self._begun)
        return self.shown.orbit.smallest_gap

    @property
    def legs(self) -> tuple[int, ...]:
        """The legs of the branch that the machine can be on at the present eccentricity."""
        return self.live.stable_at(self.settings.static_eccentricity)

    @property
    def reading(self) -> str:
        """What is shown, in words."""
        if self.flight is not None:
            told = self._story if self.held else "Its motion is integrated, and shown."
            return f"{self.shown.words} {told}"
        return f"{self.shown.words} {reading(self.shown.orbit)} {self._said_scale}."

    @property
    def _said_scale(self) -> str:
        applied, what = self._applied, "Gap" if self.machine.air_gap else "Motion"
        bow = f", bow × {applied.bow:.0f}" if self.machine.shaft else ""
        slow = SLOWED if self.flight else applied.slow_motion
        return f"{what} × {applied.exaggeration:.0f}{bow}, {slow:.3g} times slower"

    # ------------------------------------------------------------------ building

    def _first_exaggeration(self) -> float:
        """A whole factor that draws the gap, or the largest displacement of a machine without one,
        to be seen well.
        """
        if self.machine.air_gap:
            return float(round(SHARE * self.sizes.stator / self.machine.air_gap.gap))
        motion = self.where.motion(PERIOD)
        largest = float(np.hypot(motion[:, 0], motion[:, 1]).max())
        return float(max(round(SHARE * self.sizes.unit / largest), 1)) if largest else 1.0

    def _factors(self, wanted: SceneSettings) -> SceneSettings:
        """The settings with the factors that can be drawn: as wished, less where a tilt would look
        wrong.
        """
        k = min(self._wish[0], largest_exaggeration(self.where))
        flat = magnified(self.machine, self.where, k, k)
        bow = min(self._wish[1], largest_bow(flat, self.where))
        self.lens: Magnified = replace(flat, bow=bow)
        return replace(wanted, exaggeration=k, bow=bow)

    def _build(self) -> None:
        server, machine, sizes = self.server, self.machine, self.sizes
        nodes, rest = np.split(self.drawn.depths, [self.drawn.nodes])
        self.parts.add(nodes, self._first_exaggeration())
        self.board = add_board(server, sizes, self.live.legs is not None)
        self.names = add_names(server, machine, sizes, rest, self.board)
        self.views = views_of(sizes, self.names, self.board)
        self._pending: Jump | None = None
        self._next_ending = ""
        self._drawn_branch: object = None

    def _light(self, dark: bool) -> None:
        """A bright room or a dark one."""
        self.server.gui.configure_theme(dark_mode=dark, show_share_button=False, show_logo=False)
        add_surroundings(self.server, self.sizes, dark)
        self.board.dress(dark)

    def _dress(self) -> None:
        """Everything that changes with a setting and not with time."""
        shown, settings, flight = self.shown, self._applied, self.flight
        path = self.lens(self.where.whole())[:self.where.nodes, :2]
        rings, away = orbit_rings(self.where.depths[:self.where.nodes], path,
                                  GHOST * self.sizes.shaft)
        self.parts.dress_ghost(rings, orbit_colours(away, float(away.max())))
        gap = self.machine.air_gap
        self.names.say("the motion over the edge" if flight else
                       f"gap {1e3 * shown.orbit.smallest_gap:.2f} of {1e3 * gap.gap:.3g} mm"
                       if gap else "", self._said_scale, settings.names)
        self.board.show_orbit(shown.orbit, shown.verdict, flight.shown if flight else None)
        self._dress_branch()
        if gap is None:
            return
        self.parts.dress_gap(settings.exaggeration)
        largest = float(np.hypot(*self._pull(PERIOD * shown.orbit.revolutions)).max())
        self._pull_scale = ARROW * self.sizes.unit / max(largest, 1e-9)

    def _dress_branch(self) -> None:
        """The branch, where it is another one or more of it has been found."""
        branches = self.live.legs, self.live.doubled, self.live.flips
        if self.live.legs is not None and branches != self._drawn_branch:
            self.board.show_branch(*branches)
            self._drawn_branch = branches

    def _pull(self, phase: NDArray) -> NDArray:
        """Magnetic pull on the generator at phases of the orbit, N, (2, P)."""
        orbit = self.shown.orbit
        u = orbit.model.relative(orbit.coordinates(phase), orbit.centre[:, None])
        return orbit.model.pull(u, phase, orbit.speed)

    # ------------------------------------------------------------------ moving

    def draw(self, phase: float) -> None:
        """Show the machine at a phase Ωt, rad."""
        flight, depths = self.flight, self.drawn.depths
        real = (at_stations(self.machine, flight.nodes(phase - self._begun))[2][..., 0] if flight
                else self.drawn.motion(phase))
        motion = self.lens(real)
        places, leaning = positions(depths, motion), quaternions(motion)
        spinning = quaternions(motion, phase)
        moving, at = self.parts.moving, self.at
        tail = self._rotor(phases_of_tail(phase))
        with self.server.atomic():
            for bone, place, turn in zip(moving["shaft"].bones, places, leaning, strict=False):
                bone.position, bone.wxyz = place, turn
            for name, station, spins in self.parts.riding:
                moving[name].position = places[station]
                moving[name].wxyz = (spinning if spins else leaning)[station]
            self.board.move(real[at, :2], tail)
            if self.live.legs is not None:
                self.board.roll(self.centre[0] / self.machine.air_gap.gap, self._first(phase))
            if self.machine.air_gap:
                self._draw_gap(phase, real, places)
        self.server.flush()
        self.track.append((phase / (2 * math.pi), *real[at, :2].tolist()))

    def _rotor(self, phases: NDArray) -> NDArray:
        """x, z of the rotor at phases of the loop, m, (P, 2)."""
        if self.flight is not None:
            return self.flight.rotor(phases - self._begun)
        drawn = self.drawn
        return synthesise(drawn.coefficients[self.at, :2], phases / drawn.revolutions).T

    def _first(self, phase: float) -> float:
        """1X in x of what is drawn, m 0-to-peak."""
        if self.flight is not None:
            return self.flight.first_harmonic(phase - self._begun)
        q = self.drawn.revolutions
        return math.hypot(*self.drawn.coefficients[self.at, 0, 2 * q - 1:2 * q + 1])

    def _draw_gap(self, phase: float, motion: NDArray, places: NDArray) -> None:
        """The stator, and the arrow of the pull on top of the rotor."""
        moving, gap, factor = self.parts.moving, self.machine.air_gap, self._applied.exaggeration
        at = self.at
        moving["stator"].position = (*(factor * self.centre), -self.drawn.depths[at])
        self.parts.dress_pressure(motion[at, :2] - self.centre, phase)
        if self.flight is None:
            fx, fz = self._pull_scale * self._pull(np.array([phase]))[:, 0]
        else:
            u = motion[at, :2] - self.centre
            model = self.shown.orbit.model
            place = np.zeros((len(model.selection), 1))
            place[:2, 0] = u * min(1.0, 0.97 * gap.gap / max(math.hypot(*u), 1e-12))
            fx, fz = self._pull_scale * model.pull(place, np.array([phase]),
                                                   self.machine.speed)[:, 0]
        length, angle = math.hypot(fx, fz), math.atan2(fz, fx)
        length = min(length, 2 * ARROW * self.sizes.unit)
        tail = places[at] + [0, 0, 0.78 * gap.length]
        turn = (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))
        for bone, along in zip(moving["pull"].bones, (0.0, length), strict=False):
            bone.position = tail + along * np.array([math.cos(angle), math.sin(angle), 0.0])
            bone.wxyz = turn

    def _update(self, passed: float) -> None:
        """Follow the settings: solve where they changed, integrate over an edge, and bring what is
        drawn nearer to the motion, `passed` s later.
        """
        with self._lock:
            self._go_on()
            wanted = self.settings
        if wanted != self._applied:
            if wanted.solved_for != self._applied.solved_for:
                self._solve(wanted)
            if wanted.dark != self._applied.dark:
                self._light(wanted.dark)
            self._applied = self._settled(wanted)
            self._dress()
        elif self._searched and not self.live.searching:  # what it waited for is known
            self._searched = False
            if self.shown.verdict == "unknown":
                self._solve(wanted)
                self._applied = self._settled(wanted)
            self._dress()
        if self._pending is not None and self._pending.work(math.inf if passed == math.inf
                                                            else WORK):
            self._begin()
        if self.flight is not None and not self.held and (
                passed == math.inf or self.phase - self._begun >= 2 * math.pi * self.flight.last):
            self._arrive()
        share = 1 - math.exp(-passed / EASE)
        self._eased += passed
        self.drawn = self.where if self._eased > SETTLED * EASE else self.drawn.towards(self.where,
                                                                                        share)
        centre = np.array([self.flight.value * self.machine.air_gap.gap, 0.0]) if (
            self.flight is not None) else self.shown.orbit.centre
        self.centre = (1 - share) * self.centre + share * centre

    def _go_on(self) -> None:
        """One frame of what is brought slowly."""
        if self._glide is None:
            return
        begin, end, start, seconds = self._glide
        share = min((time.perf_counter() - start) / seconds, 1.0)
        if share >= 1 or self._pending is not None:
            self.settings, self._glide = end, None
            return
        self.settings = replace(end, **{name: (1 - share) * getattr(begin, name)
                                        + share * getattr(end, name) for name in MOVING})

    def _solve(self, wanted: SceneSettings) -> None:
        """Find the steady state of settings, and how it is left where it cannot stay."""
        self.flight, self.held, self.jump = None, False, None
        with self._lock:
            if self._glide is not None:
                _, end, *_ = self._glide
                ahead = self.live.at(*wanted.solved_for, self.shown)
                if ahead.jump is not None:  # over the edge, and on to where it is brought
                    self.settings, self._glide, wanted = end, None, end
        self.shown = self.live.at(*wanted.solved_for, self.shown)
        self.where, self._eased = stations(self.machine, self.shown.orbit), 0.0
        self.jump = self._pending = self.shown.jump
        self._next_ending = wanted.ending

    def _begin(self) -> None:
        """Show one of the motions over the edge."""
        jump, self._pending = self._pending, None
        self.flight = jump.flight(jump.member(self._next_ending, self.phase))
        q = jump.start.revolutions
        first = math.ceil(self.flight.first / q) * q
        self._begun = self.phase - self.phase % (2 * math.pi * q) - 2 * math.pi * first
        self.held = False
        names = [self.live.name(leg) for leg in jump.labels]
        self._story = f"{self.flight.words(names)} {jump}"
        self.where, self._eased = stations(self.machine, jump.start), 0.0
        self._dress()

    def _arrive(self) -> None:
        """The end of a motion over the edge: the orbit it has come to, or the stator."""
        flight, jump = self.flight, self.jump
        self._landed = flight.ends
        if flight.ends < 0:
            self.held = True
            self.phase = self._begun + 2 * math.pi * flight.last
            return
        leg = jump.labels[flight.ends]
        self.shown = Shown(jump.orbits[flight.ends], leg, "stable",
                           f"{self.shown.words} {self._story}")
        self.where = stations(self.machine, self.shown.orbit)
        if self._thread is not None:
            self.drawn = self.where
        self.flight = None
        with self._lock:
            self.settings = replace(self.settings, leg=leg)
        self._applied = self._factors(replace(self._applied, leg=leg))
        self._dress()

    def _settled(self, wanted: SceneSettings) -> SceneSettings:
        """The settings as they can be drawn, which are then the scene's, unless something else was
        set meanwhile.
        """
        # it stays where it came to: lowering the eccentricity again does not bring it back
        leg = self.shown.leg if self.shown.verdict != "unknown" else wanted.leg
        drawn = self._factors(replace(wanted, leg=leg))
        with self._lock:
            if self.settings == wanted:
                self.settings = drawn
        return drawn

    def run(self) -> None:
        """Start the loop that moves the machine; it ends with `stop`."""
        if self._thread is None:
            self._stopping = False
            self.live.search_doubled()
            self._searched = self.live.search is not None
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
            if self.settings.playing and not self.held:
                slow = self.settings.slow_motion if self.flight is None else SLOWED
                self.phase += self.machine.speed / slow * (now - last)
                if self.phase >= self._until:
                    self.phase = self._until
                    self.change(playing=False)
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
