"""The tracer's thread: what it hands over, what it remembers, how it ends."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import assets
from raytrace.camera import Camera
from raytrace.compiled import compile_scene
from raytrace.frame import FramePacket
from raytrace.integrator import Settings, Tracer
from raytrace.shot import FPS, Shot, jitter_of
from raytrace.still import Snapshot, StillView
from raytrace.worker import Request, Worker

SIZE = (4, 3)
CAMERA = Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0))


@dataclass(frozen=True)
class Call:
    """Arguments of one call of :meth:`Tracer.frame`."""

    index: int
    camera: Camera
    previous_camera: Camera
    size: tuple[int, int]
    now: float
    previous: float
    cut: bool
    remember: str
    lamps: float


class FakeTracer:
    """Notes what it is asked for. ``gate``: no frame is finished while it is closed. ``error``: raised once."""

    def __init__(self) -> None:
        self.calls: list[Call] = []
        self.threads: set[str] = set()
        self.gate = threading.Event()
        self.gate.set()
        self.error: BaseException | None = None
        self.samples: list[tuple[int, Camera, tuple[int, int], float]] = []
        self.sample_error: BaseException | None = None

    def frame(self, *args: Any, **kwargs: Any) -> FramePacket:
        call = Call(*args, **kwargs)
        self.calls.append(call)
        self.threads.add(threading.current_thread().name)
        assert self.gate.wait(10.0)
        if self.error is not None:
            error, self.error = self.error, None
            raise error
        image = np.zeros((call.size[1], call.size[0], 4), np.float32)
        gradient = np.zeros((call.size[1], call.size[0], 2), np.float32)
        return FramePacket(call.index, call.now, image, image, image, image, image, gradient, image, cut=call.cut)

    def reference_frame(
        self, sample: int, camera: Camera, size: tuple[int, int], now: float, lamps: float
    ) -> FramePacket:
        if self.sample_error is not None:
            error, self.sample_error = self.sample_error, None
            raise error
        self.samples.append((sample, camera, size, now))
        image = np.full((size[1], size[0], 4), 1.0 + sample, np.float32)
        zero = np.zeros_like(image)
        return FramePacket(sample, now, image, zero, np.ones_like(image), zero, zero, zero[..., :2], zero)


def at(x: float) -> Camera:
    return replace(CAMERA, position=(x, 0.0, 0.0))


def trace(worker: Worker, request: Request) -> FramePacket:
    worker.submit(request)
    packet = worker.take(timeout=None)
    assert packet is not None
    return packet


def test_frames_are_numbered_and_traced_in_the_workers_thread():
    tracer = FakeTracer()
    with Worker(tracer, samples=tracer) as worker:
        packets = [trace(worker, Request(CAMERA, SIZE, time)) for time in (0.0, 0.5, 0.5)]
    assert [(p.index, p.time) for p in packets] == [(0, 0.0), (1, 0.5), (2, 0.5)]
    assert tracer.threads == {"tracer"}


def test_motion_leads_to_the_frame_traced_before():
    tracer = FakeTracer()
    with Worker(tracer, samples=tracer) as worker:
        for step, time in ((0.0, 2.0), (1.0, 2.25), (7.0, 3.0)):
            trace(worker, Request(at(step), SIZE, time))
    assert [(c.camera.position[0], c.previous_camera.position[0]) for c in tracer.calls] == [(0, 0), (1, 0), (7, 1)]
    assert [(c.now, c.previous) for c in tracer.calls] == [(2.0, 2.0), (2.25, 2.0), (3.0, 2.25)]
    assert {(c.remember, c.lamps) for c in tracer.calls} == {("", 1.0)}


def test_the_first_frame_is_a_cut_and_so_are_one_of_another_size_and_one_that_is_asked_to_be():
    tracer = FakeTracer()
    requests = [
        Request(at(0), SIZE),
        Request(at(1), SIZE, 1.0),
        Request(at(2), (8, 6), 2.0),
        Request(at(3), (8, 6), 3.0, cut=True),
        Request(at(4), (8, 6), 4.0),
    ]
    with Worker(tracer, samples=tracer) as worker:
        packets = [trace(worker, request) for request in requests]
    assert [p.cut for p in packets] == [True, False, True, True, False]
    for call in tracer.calls:
        # After a cut nothing has moved: there is no frame that it could have moved from.
        expected = (call.camera, call.now) if call.cut else (at(call.now - 1), call.now - 1)
        assert (call.previous_camera, call.previous) == expected


def test_jitter_moves_the_camera_but_not_the_one_before():
    tracer = FakeTracer()
    with Worker(tracer, samples=tracer) as worker:
        for jitter in (True, True, False):
            trace(worker, Request(CAMERA, SIZE, jitter=jitter))
    assert [c.camera.jitter for c in tracer.calls] == [jitter_of(0), jitter_of(1), (0.0, 0.0)]
    assert [c.previous_camera.jitter for c in tracer.calls] == [(0.0, 0.0)] * 3


def test_the_caller_works_while_a_frame_is_traced_and_is_told_when_it_is_ready():
    tracer, ready = FakeTracer(), threading.Event()
    tracer.gate.clear()
    with Worker(tracer, ready.set, tracer) as worker:
        busy = [worker.busy]
        worker.submit(Request(CAMERA, SIZE))
        assert worker.take() is None
        assert worker.take(timeout=0.01) is None
        assert not ready.is_set()
        tracer.gate.set()
        assert ready.wait(10.0)
        busy.append(worker.busy)
        assert worker.take() is not None
        busy.append(worker.busy)
    assert busy == [False, True, False], "until the frame is taken"


def test_one_frame_at_a_time():
    with Worker(FakeTracer()) as worker:
        with pytest.raises(RuntimeError, match="submit one first"):
            worker.take()
        worker.submit(Request(CAMERA, SIZE))
        with pytest.raises(RuntimeError, match="take it first"):
            worker.submit(Request(CAMERA, SIZE))


def test_errors_surface_where_the_frame_is_taken_and_the_frame_after_continues_nothing():
    tracer = FakeTracer()
    with Worker(tracer, samples=tracer) as worker:
        trace(worker, Request(at(0), SIZE))
        tracer.error = MemoryError("no room for the rays")
        worker.submit(Request(at(1), SIZE))
        with pytest.raises(MemoryError, match="no room for the rays"):
            worker.take(timeout=None)
        packet = trace(worker, Request(at(2), SIZE))
    assert packet.cut
    assert packet.index == 1, "the random numbers of the lost frame are not lost"
    assert tracer.calls[-1].previous_camera == at(2)


def test_closing_waits_for_the_frame_under_way_and_leaves_no_thread():
    before = threading.active_count()
    tracer = FakeTracer()
    worker = Worker(tracer, samples=tracer)
    tracer.gate.clear()
    worker.submit(Request(CAMERA, SIZE))
    opener = threading.Timer(0.05, tracer.gate.set)
    opener.start()
    worker.close()
    opener.join()
    assert threading.active_count() == before
    assert len(tracer.calls) == 1
    worker.close()
    with pytest.raises(RuntimeError, match="closed"):
        worker.submit(Request(CAMERA, SIZE))


def test_the_same_frames_as_without_a_thread():
    compiled = compile_scene(assets.build("cornell", animate=True))
    with Tracer(compiled, Settings(threads=1)) as tracer:
        shot = Shot(compiled, tracer, (16, 9), "flight", animate=True)
        expected = [shot.frame(index) for index in range(3)]
        with Worker(tracer, samples=tracer) as worker:
            found = [trace(worker, Request(shot.camera(i), (16, 9), i / FPS)) for i in range(3)]
    for one, other in zip(expected, found, strict=True):
        assert one.cut == other.cut
        for name in ("direct", "indirect", "surface", "motion", "prev_normal"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


# ------------------------------------------------------------------------------------------- the view's own reference

VIEW = StillView(CAMERA, SIZE, 0.0, False)


def samples_of(worker: Worker, count: int) -> Snapshot:
    """The reference, once it has ``count`` samples."""
    end = time.monotonic() + 10.0
    while (snapshot := worker.snapshot) is None or snapshot.samples < count:
        assert time.monotonic() < end
        time.sleep(0.001)
    return snapshot


def next_frame(worker: Worker) -> None:
    worker.submit(Request(CAMERA, SIZE))
    assert worker.take(timeout=10.0) is not None


def test_a_reference_grows_while_no_frame_is_wanted():
    tracer = FakeTracer()
    with Worker(tracer, samples=tracer) as worker:
        worker.accumulate(VIEW)
        next_frame(worker)
        snapshot = samples_of(worker, 5)
    assert [sample for sample, *_ in tracer.samples[:5]] == [0, 1, 2, 3, 4]
    assert tracer.samples[0][1:] == (CAMERA, SIZE, 0.0)
    np.testing.assert_allclose(snapshot.radiance, (snapshot.samples + 1) / 2)  # of 1, 2, 3, ...


def test_a_reference_gets_its_turn_however_busy_the_worker_is():
    tracer = FakeTracer()
    with Worker(tracer, samples=tracer) as worker:
        worker.accumulate(VIEW)
        for _ in range(24):
            next_frame(worker)
        assert len(tracer.samples) >= 24 // 3 - 1


def test_another_view_begins_anew_and_none_forgets():
    tracer = FakeTracer()
    with Worker(tracer, samples=tracer) as worker:
        worker.accumulate(VIEW)
        next_frame(worker)
        samples_of(worker, 3)
        other = replace(VIEW, camera=at(1.0))
        worker.accumulate(other)
        next_frame(worker)
        end = time.monotonic() + 10.0
        while samples_of(worker, 1).view != other:
            assert time.monotonic() < end
        assert next(sample for sample, camera, *_ in tracer.samples if camera == other.camera) == 0
        worker.accumulate(None)
        for _ in range(2):
            next_frame(worker)
        assert worker.snapshot is None
        count = len(tracer.samples)
        next_frame(worker)
        assert len(tracer.samples) == count


def test_trouble_with_the_reference_is_raised_with_the_next_frame():
    tracer = FakeTracer()
    with Worker(tracer, samples=tracer) as worker:
        tracer.sample_error = MemoryError("too large")
        worker.accumulate(VIEW)

        def until_trouble() -> None:
            for _ in range(6):
                next_frame(worker)

        with pytest.raises(MemoryError, match="too large"):
            until_trouble()
        next_frame(worker)


def test_frames_do_not_depend_on_the_reference_between_them():
    scene = compile_scene(assets.build("cornell"))
    pictures = []
    for wanted in (None, StillView(scene.scene.camera, (16, 9), 0.0, True)):
        with Tracer(scene, Settings(threads=1)) as tracer, Worker(tracer, samples=tracer) as worker:
            worker.accumulate(wanted)
            for _ in range(4):
                worker.submit(Request(scene.scene.camera, (16, 9)))
                packet = worker.take(timeout=None)
                if wanted is not None:
                    samples_of(worker, 1)
            assert packet is not None
            pictures.append(packet.radiance())
    np.testing.assert_array_equal(pictures[0], pictures[1])
