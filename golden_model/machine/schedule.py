"""Lays the work of many frames out in time on a machine ([0048] to [0053], claims 6 and 7, FIG. 3 to 5).

Several frames are in flight. The stages of one depend on each other as in FIG. 5; a unit works on the oldest frame that
has something for it. Maintenance of the lightmaps runs beside the stages: it has a share of the ray tracer and of the
shader cores whenever it has work, a larger one while the rasterizer works, and all of them where the frames have none.

    input ► geometry ┬► visible surfaces ┬► fragment shading ─► fragment rays ┬► ray shading ► blending ► output
                     │                   ├► frame shader ─────► frame rays ───┘
                     │                   └► selection ► lightmap rays ► lightmap shading ► lightmap update
                     └► structure (before any rays)

The update completes version k + versions - 1. With `Machine.early_selection` selection looks at the surfaces of the
frame before instead: maintenance then depends on a frame's geometry and acceleration structure alone ([0052]).

What streams (rays to their shading, for example) may start as soon as what it follows has started, and cannot end
before it. All times are integer cycles; nothing depends on the host.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from lightloom.golden_model.machine.cost_model import (
    MAINTENANCE,
    RASTERIZER,
    SHADER,
    STAGES,
    TRACER,
    FrameCounts,
    Machine,
    work,
)

WHOLE = 256
"""A unit's whole time, in the shares of `Event`."""

DISPLAY = "display"

READERS = ("fragment shading", "ray shading")
"""Stages of a frame that read its version of the lightmaps (lightmap shading does too, before its update ends)."""

AFTER = {
    "geometry": ("input",),
    "structure": ("geometry",),
    "visible surfaces": ("geometry",),
    "fragment rays": ("structure",),
    "frame rays": ("structure",),
    "blending": ("fragment shading", "ray shading"),
    "output": ("blending",),
    "selection": ("geometry",),
    "lightmap rays": ("structure",),
}
"""What has to have ended before a stage begins, within a frame."""

FOLLOWING = {
    "fragment rays": ("fragment shading",),
    "frame rays": ("frame shader",),
    "ray shading": ("fragment rays", "frame rays"),
    "lightmap rays": ("selection",),
    "lightmap shading": ("lightmap rays",),
    "lightmap update": ("lightmap shading",),
}
"""What streams: a stage begins after these have begun and ends after they have ended, within a frame."""


@dataclass(frozen=True, kw_only=True)
class Event:
    """A stage of a frame occupies (a share of) a unit from `begin` to `end`, in cycles."""

    frame: int
    stage: str
    """One of `golden_model.machine.cost_model.STAGES`, or DISPLAY."""
    resource: str
    begin: int
    end: int
    share: int = WHOLE
    """Part of the unit, in 1/256."""


@dataclass(frozen=True, kw_only=True)
class FrameTime:
    """One frame; times in cycles."""

    frame: int
    begin: int
    """Its input is taken."""
    done: int
    """Its picture is complete."""
    shown: int
    """Its display time begins."""
    read_from: int
    """Its shading begins, which reads version `frame` of the lightmaps."""
    read_until: int
    """The last of its shading is done: nothing reads that version any more."""
    version_complete: int
    """When that version was complete: 0 for those that were there before the first frame."""
    updated: int
    """Its lightmap updates are complete, and with them version frame + versions - 1."""

    @property
    def latency(self) -> int:
        """From input to display."""
        return self.shown - self.begin


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """Frames laid out in time."""

    machine: Machine
    events: tuple[Event, ...]
    """Sorted by begin, then frame."""
    frames: tuple[FrameTime, ...]
    duration: int
    """Cycles from the first input to the end of the last stage; display times may go on."""

    def intervals(self) -> tuple[int, ...]:
        """Cycles from each frame's display to the next one's."""
        return tuple(b.shown - a.shown for a, b in zip(self.frames, self.frames[1:], strict=False))

    def utilisation(self) -> dict[str, float]:
        """Part of the duration in which each unit works, 0 to 1."""
        busy = dict.fromkeys(STAGES.values(), 0)
        for event in self.events:
            if event.stage != DISPLAY:
                busy[event.resource] += (event.end - event.begin) * event.share
        return {name: cycles / (WHOLE * max(self.duration, 1)) for name, cycles in busy.items()}


def schedule(machine: Machine, counts: Sequence[FrameCounts]) -> Schedule:
    """Frames 0, 1, … with these counts, the first input at cycle 0.

    A frame's input waits until the frame `frames_in_flight` before it is shown. Frame k's shading waits for version k
    of the lightmaps, which frame k - versions + 1 writes (the first ones are there from the start). Updates of frame k
    wait until version k - 1 is read no more: then the chain has room.
    """
    return _Simulation(machine, counts).run()


class _Task:
    """A stage of a frame, while the schedule is made."""

    def __init__(self, frame: int, stage: str, cycles: int):
        self.frame, self.stage, self.resource = frame, stage, STAGES[stage]
        self.left = cycles * WHOLE
        """Work left, in 1/256 cycles."""
        self.after: list[_Task] = []
        """Must have ended before this begins."""
        self.following: list[_Task] = []
        """Must have begun before this begins, and have ended before this ends."""
        self.earliest: int | None = 0
        """Not before this cycle; None: not known yet."""
        self.begin: int | None = None
        self.end: int | None = None

    def ready(self, now: int) -> bool:
        if self.earliest is None or self.earliest > now or any(task.end is None for task in self.after):
            return False
        return all(task.begin is not None for task in self.following)

    def finished(self) -> bool:
        return self.begin is not None and self.left == 0 and all(task.end is not None for task in self.following)


class _Simulation:
    """Advances from one change to the next; between two of them every unit's shares stay as they are."""

    def __init__(self, machine: Machine, counts: Sequence[FrameCounts]):
        self.machine = machine
        self.frames = _tasks(machine, counts)
        self.pending = [task for tasks in self.frames for task in tasks.values()]
        self.events: list[Event] = []
        self.shown: list[int] = []
        self.now = 0

    def run(self) -> Schedule:
        while self.pending:
            rates = self._shares(self._settle())
            steps = [-(-task.left // rate) for task, rate in rates]
            coming = [task.earliest for task in self._current() if task.earliest is not None]
            steps += [time - self.now for time in coming if time > self.now]
            if self.pending:
                assert steps, "stages wait for each other"
                self._advance(min(steps), rates)
        times = tuple(self._frame_time(k) for k in range(len(self.frames)))
        for time in times:
            assert time.version_complete <= time.read_from, f"frame {time.frame} reads a version that is not complete"
        # Nothing follows the last picture: it is drawn for one display time, or until all work is done.
        last = [max(time + max(self.machine.refresh_cycles, 1), self.now) for time in self.shown[-1:]]
        ends = [*self.shown[1:], *last]
        for k, (begin, end) in enumerate(zip(self.shown, ends, strict=True)):
            self.events.append(Event(frame=k, stage=DISPLAY, resource=DISPLAY, begin=begin, end=end))
        return Schedule(machine=self.machine, events=_joined(self.events), frames=times, duration=self.now)

    def _current(self) -> list[_Task]:
        """Tasks that have not ended, of the oldest frames: those of later ones wait for these."""
        window = self.pending[0].frame + self.machine.frames_in_flight + self.machine.versions if self.pending else 0
        return [task for task in self.pending if task.frame <= window]

    def _settle(self) -> list[_Task]:
        """Begins and ends what can at this cycle, until nothing changes. Returns the tasks that units work on now."""
        served: dict[tuple[str, bool], _Task] = {}
        while True:
            before = self._progress()
            for task in self._current():
                if task.begin is None and task.left == 0 and task.ready(self.now):
                    task.begin = self.now
                if task.finished():
                    task.end = self.now
                elif task.left and (task.begin is not None or task.ready(self.now)):
                    # Whoever gets a unit keeps it until the next change: it has begun, for those that follow it, too.
                    first = served.setdefault((task.resource, task.stage in MAINTENANCE), task)
                    if first is task and task.begin is None:
                        task.begin = self.now
            self.pending = [task for task in self.pending if task.end is None]
            self._show()
            if self._progress() == before:
                return list(served.values())

    def _progress(self) -> tuple[int, int]:
        """Tasks not ended, tasks of them begun."""
        return len(self.pending), sum(task.begin is not None for task in self.pending)

    def _show(self) -> None:
        """Gives every picture that is complete its display time, and the frame that waits for it its input."""
        refresh = self.machine.refresh_cycles
        while len(self.shown) < len(self.frames):
            done = self.frames[len(self.shown)]["output"].end
            if done is None:
                return
            time = -(-done // refresh) * refresh if refresh else done
            if self.shown:
                time = max(time, self.shown[-1] + refresh)
            later = len(self.shown) + self.machine.frames_in_flight
            if later < len(self.frames):
                self.frames[later]["input"].earliest = time
            self.shown.append(time)

    def _shares(self, served: list[_Task]) -> list[tuple[_Task, int]]:
        """What part of its unit each task gets now, in 1/256."""
        machine = self.machine
        rasterizing = any(task.resource == RASTERIZER for task in served)
        wanted = {TRACER: machine.raster_share if rasterizing else machine.other_share, SHADER: machine.shader_share}
        busy = [task.resource for task in served]
        rates = []
        for task in served:
            if busy.count(task.resource) == 1:
                rates.append((task, WHOLE))
            else:
                share = wanted[task.resource]
                rates.append((task, share if task.stage in MAINTENANCE else WHOLE - share))
        return rates

    def _advance(self, step: int, rates: list[tuple[_Task, int]]) -> None:
        for task, rate in rates:
            task.left = max(task.left - step * rate, 0)
            self.events.append(
                Event(
                    frame=task.frame,
                    stage=task.stage,
                    resource=task.resource,
                    begin=self.now,
                    end=self.now + step,
                    share=rate,
                )
            )
        self.now += step

    def _frame_time(self, k: int) -> FrameTime:
        tasks = self.frames[k]
        writer = k - self.machine.versions + 1
        read = [tasks[stage] for stage in READERS]
        return FrameTime(
            frame=k,
            begin=_known(tasks["input"].begin),
            done=_known(tasks["output"].end),
            shown=self.shown[k],
            read_from=min(_known(task.begin) for task in read),
            read_until=max(_known(task.end) for task in read),
            version_complete=_known(self.frames[writer]["lightmap update"].end) if writer >= 0 else 0,
            updated=_known(tasks["lightmap update"].end),
        )


def _tasks(machine: Machine, counts: Sequence[FrameCounts]) -> list[dict[str, _Task]]:
    """The stages of all frames and what they wait for."""
    frames: list[dict[str, _Task]] = []
    for k, frame in enumerate(counts):
        tasks = {stage: _Task(k, stage, cycles) for stage, cycles in work(machine, frame).items()}
        for stage, names in AFTER.items():
            tasks[stage].after += [tasks[name] for name in names]
        for stage, names in FOLLOWING.items():
            tasks[stage].following += [tasks[name] for name in names]
        for stage in ("fragment shading", "frame shader"):
            surfaces = tasks["visible surfaces"]
            (tasks[stage].following if machine.overlap_shading else tasks[stage].after).append(surfaces)
        if not machine.early_selection:
            tasks["selection"].after.append(tasks["visible surfaces"])
        if k:
            before = frames[k - 1]
            tasks["input"].after.append(before["input"])
            tasks["output"].after.append(before["output"])
            # Version k - 1 is read until the shading of its frame is done.
            tasks["selection"].after += [before[name] for name in (*READERS, "lightmap update")]
            if machine.early_selection:
                tasks["selection"].after.append(before["visible surfaces"])
        if k >= machine.frames_in_flight:
            tasks["input"].earliest = None
        frames.append(tasks)
    for k, tasks in enumerate(frames):
        writer = k - machine.versions + 1
        if writer >= 0:
            for stage in ("fragment shading", "ray shading"):
                tasks[stage].after.append(frames[writer]["lightmap update"])
    return frames


def _joined(events: list[Event]) -> tuple[Event, ...]:
    """Events one after the other of the same task and share become one."""
    open_events: dict[tuple[int, str], Event] = {}
    done: list[Event] = []
    for event in events:
        key = event.frame, event.stage
        last = open_events.get(key)
        if last is not None and last.end == event.begin and last.share == event.share:
            event = replace(event, begin=last.begin)
        elif last is not None:
            done.append(last)
        open_events[key] = event
    done += open_events.values()
    return tuple(sorted(done, key=lambda event: (event.begin, event.frame, event.stage)))


def _known(time: int | None) -> int:
    assert time is not None
    return time
