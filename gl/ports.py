"""What a pass declares: its ports, its parameters, its shader. Pure Python, no OpenGL.

A pass is one class whose attributes are its ports, and the attribute's name IS the identifier in GLSL, so that one
search finds both sides. The prefix tells the role: ``in_`` is read, ``prev_`` is last frame's, ``out_`` is written and
``u_`` is a parameter. All of it is checked when the class is created.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Final

from errors import did_you_mean
from gl.formats import lookup

UNIFORM_TYPES: Final = frozenset(
    [*("float", "int", "uint", "bool", "mat3", "mat4"), *(f"{k}vec{n}" for k in ("", "i", "u") for n in (2, 3, 4))]
)
"""GLSL types a parameter may have."""

HISTORY_FLAG: Final = "u_history_valid"
"""The ``bool`` every shader with ``prev_`` ports declares; the executor sets it, no pass does."""

MAX_SAMPLERS: Final = 16
MAX_OUTPUTS: Final = 8
"""What OpenGL 4.3 guarantees: texture units of a stage; colour attachments, and image units of a compute shader."""

ONE_TEXEL: Final = 1 << 16
"""The divisor of a texture of one texel, whatever the frame's size: no frame has that many pixels on a side."""

DefineValue = int | float | str


class GraphError(Exception):
    """The graph was wired wrongly: a mistake in code that builds it, not of the user."""


@dataclass(frozen=True, slots=True)
class In:
    """A texture of this frame that the pass reads; in GLSL ``uniform sampler2D in_x``.

    Attributes:
        doc: what the texture holds, with units and spaces.
        optional: it may stay unconnected. The shader asks with ``#if HAS_IN_X``, and must not declare the sampler then.
    """

    doc: str
    optional: bool = False


@dataclass(frozen=True, slots=True)
class Prev:
    """A history: what was fed to it last frame; in GLSL ``uniform sampler2D prev_x``.

    A shader with such a port declares ``uniform bool u_history_valid``. It is false when any of the pass's histories
    does not hold the last frame (first frame, resize, cut, ...); what the sampler returns then means nothing.
    """

    doc: str


@dataclass(frozen=True, slots=True)
class Out:
    """A texture that the pass writes, every texel of it.

    In a fragment shader ``layout(location = k) out vec4 out_x``, in a compute shader
    ``layout(FORMAT, binding = k) writeonly uniform image2D out_x``; k counts the pass's outputs from 0.

    Attributes:
        fmt: name of a format of :mod:`gl.formats`.
        doc: what the texture holds, with units and spaces.
        divisor: its size is the frame's divided by this, rounded up; :data:`ONE_TEXEL` for what belongs to the frame
            as a whole.
    """

    fmt: str
    doc: str
    divisor: int = 1

    def __post_init__(self) -> None:
        lookup(self.fmt)
        if self.divisor < 1:
            raise ValueError(f"divisor is {self.divisor}, must be at least 1")


@dataclass(frozen=True, slots=True)
class Uniform:
    """A parameter; in GLSL ``uniform TYPE u_x``. The value goes to the pass's constructor.

    Attributes:
        type: one of :data:`UNIFORM_TYPES`. A ``mat3`` or ``mat4`` is given as rows, as one writes it on paper.
        doc: opens with range and unit: ``"[0;1] weight of the new sample"``.
    """

    type: str
    doc: str

    def __post_init__(self) -> None:
        if self.type not in UNIFORM_TYPES:
            raise ValueError(f"unknown uniform type {self.type!r}{did_you_mean(self.type, UNIFORM_TYPES)}")


Port = In | Prev | Out | Uniform
PREFIXES: Final[dict[str, type]] = {"in_": In, "prev_": Prev, "out_": Out, "u_": Uniform}


@dataclass(frozen=True, slots=True)
class Ports:
    """All ports of a pass class by name, in the order of declaration, base classes first."""

    ins: dict[str, In]
    prevs: dict[str, Prev]
    outs: dict[str, Out]
    uniforms: dict[str, Uniform]
    samplers: tuple[str, ...]
    """``ins`` and ``prevs`` in the order of declaration; the index is the texture unit."""


def collect_ports(cls: type) -> Ports:
    """The ports of ``cls`` and its bases.

    Raises:
        GraphError: a name and its kind of port do not agree, or OpenGL's guaranteed limits are exceeded.
    """
    found: dict[str, Port] = {}
    for base in reversed(cls.__mro__):
        for name, value in vars(base).items():
            wanted = next((kind for prefix, kind in PREFIXES.items() if name.startswith(prefix)), None)
            if isinstance(value, Port):
                if wanted is not type(value):
                    prefix = next(p for p, kind in PREFIXES.items() if kind is type(value))
                    raise GraphError(
                        f"{cls.__name__}.{name} is {type(value).__name__}: its name must start with {prefix!r}"
                    )
                if name == HISTORY_FLAG:
                    raise GraphError(f"{cls.__name__}.{name}: the executor sets it, only the shader declares it")
                found[name] = value
            elif wanted is not None:
                raise GraphError(f"{cls.__name__}.{name} must be {wanted.__name__}(...), got {value!r}")
    ports = Ports(
        {n: p for n, p in found.items() if isinstance(p, In)},
        {n: p for n, p in found.items() if isinstance(p, Prev)},
        {n: p for n, p in found.items() if isinstance(p, Out)},
        {n: p for n, p in found.items() if isinstance(p, Uniform)},
        tuple(n for n, p in found.items() if isinstance(p, In | Prev)),
    )
    if len(ports.samplers) > MAX_SAMPLERS or len(ports.outs) > MAX_OUTPUTS:
        raise GraphError(
            f"{cls.__name__} has {len(ports.samplers)} inputs and {len(ports.outs)} outputs;"
            f" OpenGL guarantees {MAX_SAMPLERS} and {MAX_OUTPUTS}"
        )
    return ports


@lru_cache(1024, typed=True)
def define_text(name: str, value: DefineValue) -> str:
    """``value`` as it stands after ``#define NAME``: integers without a point, floats always with one.

    Raises:
        GraphError: the value is no finite number and no text, or ``name`` is no identifier in capitals.
    """
    if not re.fullmatch(r"[A-Z][A-Z0-9_]*", name):
        raise GraphError(f"define {name!r}: names are capitals, digits and underscores")
    if isinstance(value, bool | int):
        return str(int(value))
    if isinstance(value, str):
        return value
    text = repr(float(value))
    if "n" in text:  # nan, inf
        raise GraphError(f"define {name} = {value}: not a finite number")
    return text


class Pass:
    """One shader with its ports. Derive from :class:`FragmentPass` or :class:`ComputePass`.

    Args:
        defines: ``#define NAME value`` for this instance; each different set compiles a program of its own.
        formats: other formats than declared, by ``out_`` port.
        uniforms: a value for every declared :class:`Uniform`, and for nothing else.

    Raises:
        GraphError: a uniform has no value, or an argument names no port.
    """

    shader: ClassVar[str] = ""
    """Path below ``gl/shaders``: ``"svgf/temporal.frag"``."""
    suffix: ClassVar[str] = ""
    ports: ClassVar[Ports] = Ports({}, {}, {}, {}, ())
    declared_formats: ClassVar[dict[str, str]] = {}

    def __init_subclass__(cls) -> None:
        cls.ports = collect_ports(cls)
        cls.declared_formats = {name: out.fmt for name, out in cls.ports.outs.items()}
        if cls.shader and not cls.shader.endswith(cls.suffix):
            raise GraphError(f"{cls.__name__}.shader is {cls.shader!r}, must end with {cls.suffix!r}")
        if cls.shader and not cls.ports.outs:
            raise GraphError(f"{cls.__name__} writes nothing: it needs an Out port")

    def __init__(
        self,
        *,
        defines: Mapping[str, DefineValue] | None = None,
        formats: Mapping[str, str] | None = None,
        **uniforms: object,
    ) -> None:
        if not self.shader:
            raise GraphError(f"{type(self).__name__} has no shader, only passes derived from it can be made")
        if uniforms.keys() != self.ports.uniforms.keys():
            self._reject(uniforms)
        self.uniforms = uniforms
        self.defines = {name: define_text(name, value) for name, value in defines.items()} if defines else {}
        self.formats = self._override(formats) if formats else self.declared_formats

    def _override(self, formats: Mapping[str, str]) -> dict[str, str]:
        for name, fmt in formats.items():
            if name not in self.declared_formats:
                raise GraphError(
                    f"{type(self).__name__} has no output {name!r}{did_you_mean(name, self.declared_formats)}"
                )
            try:
                lookup(fmt)
            except ValueError as error:
                raise GraphError(f"{type(self).__name__}.{name}: {error}") from None
        return {**self.declared_formats, **formats}

    def _reject(self, uniforms: Mapping[str, object]) -> None:
        declared = self.ports.uniforms
        wrong = [f"no uniform {name!r}{did_you_mean(name, declared)}" for name in uniforms if name not in declared]
        wrong += [f"{name!r} ({port.doc}) needs a value" for name, port in declared.items() if name not in uniforms]
        raise GraphError(f"{type(self).__name__}: {'; '.join(wrong)}")

    @property
    def variant(self) -> tuple[object, ...]:
        """Equal for two instances exactly when they need the same program, connections apart; hashable."""
        return type(self), *self.formats.values(), *sorted(self.defines.items())


class FragmentPass(Pass):
    """A full-screen triangle into one or more textures of one size. The usual choice for a filter per pixel."""

    suffix = ".frag"

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if len({out.divisor for out in cls.ports.outs.values()}) > 1:
            raise GraphError(f"{cls.__name__}: all outputs of a fragment pass must have one divisor")


class ComputePass(Pass):
    """Work groups over the first output, for what needs shared memory or scattered writes.

    The executor rounds the number of groups up, so the shader must guard against invocations outside of the image.
    It finds ``group`` as ``GROUP_X`` and ``GROUP_Y``; with one invocation per texel it begins with
    ``layout(local_size_x = GROUP_X, local_size_y = GROUP_Y) in;``.

    Args:
        group: texels of the first output that one work group covers, instead of the class's.
    """

    suffix = ".comp"
    group: tuple[int, int] = (8, 8)

    def __init__(
        self,
        *,
        group: tuple[int, int] | None = None,
        defines: Mapping[str, DefineValue] | None = None,
        formats: Mapping[str, str] | None = None,
        **uniforms: object,
    ) -> None:
        super().__init__(defines=defines, formats=formats, **uniforms)
        if group is not None:
            self.group = group
        if min(self.group) < 1:
            raise GraphError(f"{type(self).__name__}: group is {self.group}, both sides must be at least 1")
        self.defines |= {"GROUP_X": str(self.group[0]), "GROUP_Y": str(self.group[1])}

    def work_groups(self, size: tuple[int, int]) -> tuple[int, int]:
        """Number of work groups in x and y for a first output of ``size`` texels; override for another layout."""
        return -(-size[0] // self.group[0]), -(-size[1] // self.group[1])
