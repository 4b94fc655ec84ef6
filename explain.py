"""What a frame costs and why: what the scene needs, hence which kernels, rays, images, passes and textures there are.

Everything is read from what a frame is really made with, the tracer prepared for the scene and the compiled plan; why a
pass is there is found by trying (:mod:`gl.switches`). No kernel is compiled and no OpenGL context is made.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from config import Config
from gl.pipelines import DENOISERS, FrameTraits, build, remembered
from gl.plan import Memory, Plan
from gl.switches import DENOISER, TRAIT, Effect, effects, nearest, reasons, ways
from gl.upload import PREFIX
from parameter import Value
from raytrace.compiled import CompiledScene
from raytrace.features import compiled_in, content_of, gradients_of, images_of, rays_of
from raytrace.frame import STRATUM
from raytrace.integrator import Tracer
from raytrace.scene import Scene
from session import find_scene, prepare_tracer, tell_notices
from ui.state import State

WORDS: Final = {
    "textured": "textures",
    "sky": "a sky",
    "has_sky": "a sky",
    "moving": "moving objects",
    "lamps": "lamps",
    "specular": "metals and gloss",
    "glossmap": "textures of roughness or metal",
    "bumps": "normal maps",
    "colored": "colours of vertices",
    "cutout": "cut-outs",
    "separable": "separable masking",
    "punctual": "lights without a surface",
    "environment": "an environment",
    "positions": "world positions",
}
"""What the switches of kernels and kinds of scenes mean; one that is not here goes by its own name."""

_FEW: Final = 3
_READERS_WIDTH: Final = 70
"""So many readers of an image are named, in so many letters; of more only the number is given."""

_WIDTH: Final = 118
_INDENT: Final = 40  # where the names of textures begin, or later
_WORDS_INDENT: Final = 60  # where the words about rays and kernels begin, at most


@dataclass(frozen=True)
class Subject:
    """A frame of ``scene`` by ``denoiser``. ``animate``, ``jitter``: whether these flags were given."""

    config: Config
    denoiser: str
    scene: CompiledScene
    tracer: Tracer
    animate: bool = False
    jitter: bool = False

    @property
    def size(self) -> tuple[int, int]:
        return self.config.render.width, self.config.render.height

    @property
    def traits(self) -> FrameTraits:
        """Those that frames of the tracer will have."""
        pixel = self.scene.scene.camera.pixel_size(self.size[1])
        images = self.tracer.images
        return FrameTraits(moving="prev_normal" in images, specular="specular" in images, pixel_size=pixel)

    @property
    def images(self) -> tuple[str, ...]:
        """Names of the images that frames for the denoiser will have."""
        return (
            *self.tracer.images,
            *(gradients_of(self.tracer.variant) if remembered(self.config, self.denoiser) else ()),
        )

    @cached_property
    def plan(self) -> Plan:
        return build(self.config, self.denoiser, self.traits).compile()

    @cached_property
    def effects(self) -> list[Effect]:
        """What other settings would do to :attr:`plan`."""
        return effects(self.config, self.denoiser, self.traits)

    @cached_property
    def unshared(self) -> int:
        """Bytes of the plan's textures if each had memory of its own."""
        return build(self.config, self.denoiser, self.traits).compile(alias=False).bytes(self.size)


def run(config: Config, name: str, denoiser: str, animate: bool, jitter: bool) -> None:
    """Print the explanation of a scene, built in or a file. Raises UserError where there is no such scene."""
    scene: Scene = find_scene(name, animate, config.surroundings)
    tell_notices(scene, animate)
    compiled, tracer = prepare_tracer(scene, config)
    with tracer:
        print(report(Subject(config, denoiser, compiled, tracer, animate, jitter)))


def report(subject: Subject) -> str:
    """All sections, for people."""
    sections = [
        scene_section(subject),
        tracer_section(subject),
        image_section(subject),
        pass_section(subject),
        memory_section(subject),
        switch_section(subject),
    ]
    return "\n\n".join("\n".join(lines) for lines in sections)


def scene_section(subject: Subject) -> list[str]:
    """What the scene consists of."""
    content = content_of(subject.scene, subject.tracer.tables)
    if content.moving:
        motion = f"{content.moving:,} in {_count(content.moving_objects, 'object')} move"
    else:
        motion = "none moves" + ("" if subject.animate else " (--animate lets move what can)")
    textures = f"{content.textures}, {content.texel_bytes:,} bytes with all levels" if content.textures else "none"
    lamps = _count(content.lamps, "triangle")
    lamps += f", {content.textured_lamps} by a texture" if content.textured_lamps else ""
    lamps += f", {content.double_sided_lamps} on both sides" if content.double_sided_lamps else ""
    share = f"takes {content.sky_share:.0%} of the light samples"
    sky = share if content.sky_share and not content.environment_size else "none"
    environment = "none"
    if around := subject.scene.scene.environment:
        assert content.environment_size is not None
        environment = (
            f"{around.name}, {_by(content.environment_size)} texels, {content.environment_bytes:,} bytes; {share}"
        )
    punctual = ", ".join(f"{count} {kind}" for kind, count in content.punctual.items()) or "none"
    carried = sum(light.motion is not None for light in subject.scene.scene.lights)
    moving = f"; {carried} of them {'moves' if carried == 1 else 'move'}" if carried else ""
    flat = content.triangles - content.smooth
    rows = [
        ("triangles", f"{content.triangles:,} in {_count(content.objects, 'object')}; {motion}"),
        ("textures", textures),
        ("lamps", lamps if content.lamps else "none"),
        ("lights", f"{punctual} without a surface{moving}" if content.punctual else "none without a surface"),
        ("sky", sky),
        ("environment", environment),
        ("camera", _cameras(subject.scene.scene)),
        ("normals", f"the vertices' on {_count(content.smooth, 'triangle')}, the face's on {flat:,}"),
        ("tables", f"{content.table_bytes:,} bytes of main memory, all that the kernels read"),
    ]
    return [f"scene {subject.scene.scene.name}", *_columns(rows)]


def _cameras(scene: Scene) -> str:
    """Those that can be asked for, and what moves of them."""
    names = [f"{camera.name!r}{' (moves)' if camera.flight else ''}" for camera in scene.cameras]
    listing = ", ".join(names) if len(names) <= _FEW else f"{len(names)} by name"
    words = [listing] if names else []
    return "; ".join([*words, "a flight" if scene.flight else "no flight"])


def tracer_section(subject: Subject) -> list[str]:
    """Rays of a path, kernels, jitter."""
    tracer, config = subject.tracer, subject.config
    rays = rays_of(subject.scene)
    total = sum(rays.values())
    pixels = subject.size[0] * subject.size[1]
    rows = [("ray", kind, str(count) if count else "left out: there is no light") for kind, count in rays.items()]
    for kernel in tracer.kernels:
        switches = compiled_in(kernel)
        there, missing = (_words(name for name, on in switches.items() if on is wanted) for wanted in (True, False))
        parts = [f"with {there}" if there else "", f"without {missing}" if missing else ""]
        first, *more = textwrap.wrap("; ".join(part for part in parts if part), _WIDTH - _WORDS_INDENT)
        rows += [("kernel", _name(kernel), first), *(("", "", line) for line in more)]
    scenes = "two scenes, that of what moves built anew every frame" if tracer.variant.moving else "one scene"
    rows.append(("Embree", tracer.rays.name, scenes))
    rule = remembered(config, subject.denoiser)
    place = f"1 in {STRATUM}x{STRATUM} pixels, {rule}; no ray more"
    rows.append(("sample", "carried over", place if rule else "none: the method does not ask for any"))
    wish = f"render.jitter = {_value(config.render.jitter)}"
    state = State(config, subject.denoiser)
    headless = subject.jitter or config.render.jitter == "on"
    because = "--jitter" if subject.jitter else wish
    rows.append(("jitter", "app.py render", f"{_on(headless)}: {because}"))
    taa = f", anti-aliasing over time is {_on(state.anti_aliased)}" if config.render.jitter == "auto" else ""
    rows.append(("jitter", "window", f"{_on(state.jitter)}: {wish}{taa}"))
    head = f"tracer: up to {total} rays per path, {total * pixels:,} per frame of {_by(subject.size)}"
    return [head, *_columns(rows)]


def image_section(subject: Subject) -> list[str]:
    """What the tracer makes of a frame, and what of it is uploaded."""
    plan, tracer = subject.plan, subject.tracer
    uploads = {row.names[0].removeprefix(PREFIX): row for row in plan.memory(subject.size) if row.kind == "import"}
    known = images_of(type(tracer.variant)(*(True for _ in tracer.variant)), positions=True, gradients=True)
    rows: list[tuple[str, ...]] = []
    for name in dict.fromkeys((*known, *uploads)):
        if name in uploads:
            row = uploads[name]
            made = "uploaded" if name in subject.images else "uploaded, given beside the frame"
            rows.append((name, f"{row.fmt} {_by(row.size)}", f"{row.bytes:,}", f"{made}; {_readers(plan, name)}"))
        elif name in subject.images:
            rows.append((name, "", "0", "made, not uploaded: no pass reads it"))
        else:
            rows.append((name, "", "0", f"not made: {_why_not_made(tracer, name)}"))
    total = sum(row.bytes for row in uploads.values())
    return [f"images of a frame: {len(uploads)} uploaded, {total:,} bytes per frame", *_columns(rows, right=(2,))]


def pass_section(subject: Subject) -> list[str]:
    """The passes that run, and those that could, each with the settings that decide on it."""
    plan = subject.plan
    programs = len({node.program for node in plan.passes})
    longest = max(len(node.name) for node in plan.passes)
    rows: list[tuple[str, ...]] = []
    for node in plan.passes:
        first, *more = textwrap.wrap(_because(subject, node.name), _WIDTH - longest - 4, break_on_hyphens=False)
        rows += [(node.name, first), *(("", line) for line in more)]
    head = f"passes of {subject.denoiser}: {len(plan.passes)}, by {programs} programs, {len(plan.culled)} culled"
    lines = [head, *_columns(rows)]
    lines += [f"  {node.name}  culled: no output needs it" for node in plan.culled]
    by_way: dict[str, list[str]] = {}
    for name, found in ways(subject.effects).items():
        found = [effect for effect in found if effect.setting != DENOISER]
        if found:
            by_way.setdefault(" or ".join(_setting(e, e.other) for e in _plainest(found)), []).append(name)
    if by_way:
        lines += ["", "passes that are off, and what would switch them on"]
    for way, names in by_way.items():
        lines += [f"  {way}", *_wrapped(names, "      ", _WIDTH)]
    return lines


def memory_section(subject: Subject) -> list[str]:
    """GPU memory by texture object."""
    plan = subject.plan
    memory = plan.memory(subject.size)
    outputs = {tex.name: name for name, tex in plan.outputs.items()}
    rows = []
    for number, row in enumerate(memory):
        slot = number - len(plan.imports)
        title = f"slot {slot}" if row.kind == "slot" else row.kind
        names = [f"{name} (output {outputs[name]})" if name in outputs else name for name in row.names]
        kind = f"{f'{row.copies} x ' if row.copies > 1 else ''}{row.fmt} {_by(row.size)}"
        first, *more = _wrapped(names, "", _WIDTH - _INDENT)
        rows += [(title, kind, f"{row.bytes:,}", first), *(("", "", "", line) for line in more)]
    totals = {kind: _total(memory, kind) for kind in ("import", "slot", "history")}
    total = sum(totals.values())
    parts = ", ".join(f"{kind} {value:,}" for kind, value in totals.items())
    saved = subject.unshared - plan.bytes(subject.size)
    return [
        f"GPU memory: {total:,} bytes ({parts})",
        *_columns(rows, right=(2,)),
        f"  sharing slots saves {saved:,} bytes",
    ]


def switch_section(subject: Subject) -> list[str]:
    """What another value of each setting would change: passes, GPU memory, upload."""
    rows: list[tuple[str, ...]] = [("", "passes", "compiled or wired anew", "GPU bytes", "bytes uploaded")]
    before = subject.plan.memory(subject.size)
    for effect in nearest(subject.effects):
        after = effect.plan.memory(subject.size)
        memory = sum(row.bytes for row in after) - sum(row.bytes for row in before)
        upload = _total(after, "import") - _total(before, "import")
        passes = len(effect.added) - len(effect.removed)
        changes = (_signed(passes), str(len(effect.changed)), _signed(memory), _signed(upload))
        rows.append((_setting(effect, effect.other), *changes))
    head = "what another value would change; settings that are not here change neither passes nor textures"
    return [
        head,
        *_columns(rows, right=(1, 2, 3, 4)),
        f"  {TRAIT}: no parameters, but what the scene and the renderer are; milliseconds of every pass: app.py bench",
    ]


def _total(memory: Iterable[Memory], kind: str) -> int:
    return sum(row.bytes for row in memory if row.kind == kind)


def _because(subject: Subject, name: str) -> str:
    """The settings without which the pass ``name`` would not run."""
    found = reasons(name, subject.effects)
    settings = [effect for effect in found if effect.setting != DENOISER]
    if settings:
        return ", ".join(_setting(effect, effect.now) + _limit(effect) for effect in _plainest(settings))
    without = [effect.other for effect in subject.effects if effect.setting == DENOISER and name in effect.removed]
    if not without:
        return "every picture has it"
    rest = "" if len(without) == len(DENOISERS) - 1 else f" (not {', '.join(map(str, without))})"
    return f"{DENOISER} {subject.denoiser}{rest}"


def _plainest(found: Sequence[Effect]) -> Sequence[Effect]:
    """Without presets, where another setting does the same: a preset is a bundle of settings."""
    return [effect for effect in found if not effect.setting.endswith(".preset")] or found


def _limit(effect: Effect) -> str:
    number = isinstance(effect.now, int | float) and not isinstance(effect.now, bool)
    return f" (off at {_value(effect.other)})" if number else ""


def _readers(plan: Plan, image: str) -> str:
    names = [node.name for node in plan.passes if any(tex.name == PREFIX + image for tex in node.reads.values())]
    if not names:
        return "handed on as it is"
    listed = ", ".join(names)
    short = len(names) <= _FEW and len(listed) <= _READERS_WIDTH
    return f"read by {listed if short else f'{len(names)} passes'}"


def _why_not_made(tracer: Tracer, image: str) -> str:
    """The feature of a scene or the wish that would have the tracer make ``image``."""
    variant, positions = tracer.variant, tracer.settings.positions
    if image in images_of(variant, positions, gradients=True):
        return "no method asks for it"
    for field in variant._fields:
        if image in images_of(variant._replace(**{field: True}), positions, gradients=True):
            return f"the scene has no {WORDS.get(field, field)}"
    return "no method asks for it"


def _name(kernel: object) -> str:
    return str(getattr(kernel, "__name__", kernel))


def _words(names: Iterable[str]) -> str:
    return ", ".join(WORDS.get(name, name) for name in names)


def _setting(effect: Effect, value: Value) -> str:
    return f"{DENOISER} {value}" if effect.setting == DENOISER else f"{effect.setting} = {_value(value)}"


def _value(value: Value) -> str:
    return json.dumps(value) if isinstance(value, str | bool) else f"{value:.12g}"


def _signed(number: int) -> str:
    return f"{number:+,}" if number else "0"


def _on(switch: bool) -> str:
    return "on" if switch else "off"


def _by(size: tuple[int, int]) -> str:
    return f"{size[0]}x{size[1]}"


def _count(number: int, word: str) -> str:
    return f"{number:,} {word}{'' if number == 1 else 's'}"


def _wrapped(names: Sequence[str], indent: str, width: int) -> list[str]:
    lines = [indent + names[0]]
    for name in names[1:]:
        if len(lines[-1]) + len(name) + 3 > width:
            lines[-1] += ","
            lines.append(indent + name)
        else:
            lines[-1] += f", {name}"
    return lines


def _columns(rows: Sequence[Sequence[str]], right: tuple[int, ...] = ()) -> list[str]:
    """Rows of equal length as indented lines; columns in ``right`` are aligned right, the others left."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]

    def padded(i: int, cell: str) -> str:
        return cell.rjust(widths[i]) if i in right else cell.ljust(widths[i])

    return [f"  {'  '.join(padded(i, cell) for i, cell in enumerate(row))}".rstrip() for row in rows]
