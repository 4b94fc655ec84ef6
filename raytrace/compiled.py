"""A scene as the kernels read it: float32 arrays relative to the scene's origin.

Triangles are stored one record each, corners included, rather than as indices into shared vertices: a ray that lands
anywhere then touches two cache lines instead of seven.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from errors import UserError
from raytrace.camera import Camera
from raytrace.light_tables import Lights, collect_lights, no_lights
from raytrace.punctual import punctual_rows
from raytrace.scene import Mesh, Scene
from raytrace.textures import TextureAtlas, build_atlas

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

MATERIAL, OBJECT, LIGHT, SMOOTH = 0, 1, 2, 3
"""Columns of :attr:`CompiledScene.triangle_info`."""

BASE_TEXTURE, EMISSION_TEXTURE, DOUBLE_SIDED, SPECULAR, GLOSS_TEXTURE, NORMAL_TEXTURE = 0, 1, 2, 3, 4, 5
"""Columns of :attr:`CompiledScene.material_info`."""

TEXTURES = [BASE_TEXTURE, EMISSION_TEXTURE, GLOSS_TEXTURE, NORMAL_TEXTURE]

CORNERS, NORMALS, FACE_NORMAL, OFFSET, RECORD = 0, 9, 18, 21, 22
"""First columns of the parts of a triangle's record, and its length."""

_OFFSET_SCALE = 2.0**-18


@dataclass
class CompiledScene:
    """``triangles`` (T, RECORD) float32, moving ones last: three corners, their three unit shading normals, the unit
    normal of the front face (counter-clockwise corners), and the ray offset.

    ``triangle_info`` (T, 4) int32: material, object, light index or -1, 1 if the shading normals are the vertices'.
    ``triangle_uvs`` (T, 6) float32 and ``uv_density`` (T,) float32, uv units per scene unit (both of length 1 where
    nothing is textured).
    ``base_color``, ``emission`` (M, 3) float32; ``material_info`` (M, 6) int32: base texture, emission texture, double
    sided, specular, metallic-roughness texture, normal texture. ``gloss`` (M, 3) float32: metallic, roughness, scale of
    the normal texture. ``colors`` (T, 9) float32: the corners' linear factors of the base colour, of length 1 where no
    mesh has any. ``prev_triangles`` (moving, RECORD) float32: the moving ones one frame ago.
    ``static_count``: number of triangles that never move. Arrays of moving triangles are rewritten for every frame: one
    tracer per compiled scene.
    """

    scene: Scene
    origin: F64
    triangles: F32
    triangle_info: I32
    triangle_uvs: F32
    uv_density: F32
    base_color: F32
    emission: F32
    material_info: I32
    gloss: F32
    colors: F32
    textures: TextureAtlas
    lights: Lights
    static_count: int
    prev_triangles: F32
    extent: float

    @property
    def has_textures(self) -> bool:
        return bool(self.material_info[:, :2].max() >= 0)

    @property
    def has_specular(self) -> bool:
        """Whether any triangle is metallic or glossy."""
        return bool(self._used[:, SPECULAR].any())

    @property
    def has_cutout(self) -> bool:
        """Whether any triangle may have a hole."""
        materials = self.scene.materials
        return any(materials[k].alpha_cutoff is not None for k in np.unique(self.triangle_info[:, MATERIAL]))

    @property
    def ordered_meshes(self) -> list[Mesh]:
        """Meshes in the order of their triangles."""
        return _ordered(self.scene)

    def has(self, column: int) -> bool:
        """Whether any triangle has the texture of that column of :attr:`material_info`."""
        return bool(self._used[:, column].max() >= 0)

    @property
    def _used(self) -> I32:
        return self.material_info[np.unique(self.triangle_info[:, MATERIAL])]

    @property
    def has_motion(self) -> bool:
        return self.static_count < len(self.triangles)

    @property
    def moves(self) -> bool:
        """Whether :meth:`move_to` changes anything."""
        return self.has_motion or self.scene.animated

    def move_to(self, time: float, previous_time: float) -> None:
        """Write the moving triangles' positions and normals at both times (seconds), and where lights are."""
        if self.moves:
            self.lights.punctual[:] = punctual_rows(self.scene.lights, self.origin, time)
        if not self.has_motion:
            return
        self.triangles[self.static_count :] = self._moving_at(time)
        self.prev_triangles[:] = self._moving_at(previous_time)

    def _moving_at(self, time: float) -> F32:
        parts = [_records(mesh, self.origin, time) for mesh in self.scene.meshes if mesh.motion is not None]
        return np.concatenate(parts)

    def dim(self, time: float, share: float) -> None:
        """Write the emission at ``time`` (seconds), ``share`` of what the dimmers leave.

        The lights' probabilities stay those of full power: the random numbers of a path then choose the same light
        whatever its dimmer does, as temporal gradients need it.
        """
        for row, material in zip(self.emission, self.scene.materials, strict=True):
            dimmed = share if material.dimmer is None else share * material.dimmer(time)
            row[:] = np.array(material.emission, np.float32) * np.float32(dimmed)

    def moving_box(self) -> F32:
        """Bounds of the moving triangles as they are now, (2, 3) float32, widened against rounding."""
        corners = self.triangles[self.static_count :, :9].reshape(-1, 3)
        margin = np.float32(1e-5 * self.extent)
        return np.stack([corners.min(0) - margin, corners.max(0) + margin])

    def camera_at(self, time: float, moving: bool) -> Camera:
        """The flight's camera at ``time`` seconds, or the still one."""
        return self.scene.flight(time) if moving and self.scene.flight is not None else self.scene.camera


def _records(mesh: Mesh, origin: F64, time: float = 0.0) -> F32:
    """(F, RECORD) float32 triangle records of one mesh, relative to ``origin``.

    The ray offset is the distance by which rays leave the surface, along the normal: Embree starts at t = 0 and would
    hit it again. The errors of an interpolated point and of the intersection grow with the coordinates (PBR book, 4th
    ed., sec. 6.8), so it is 64 units in the last place of the triangle's largest one: 23 µm in a room of 6 m.
    """
    matrix = np.eye(4) if mesh.motion is None else np.asarray(mesh.motion(time), dtype=np.float64)
    vertices = mesh.vertices if mesh.motion is None else mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    corners = (vertices - origin)[mesh.faces]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(face, axis=1, keepdims=True)
    face = face / np.where(length > 0.0, length, 1.0)
    if mesh.normals is None:
        normals = np.repeat(face[:, None], 3, axis=1)
    else:
        normals = mesh.normals[mesh.faces].astype(np.float64) @ matrix[:3, :3].T
    flat = corners.reshape(-1, 9)
    offset = np.abs(flat).max(1, keepdims=True) * _OFFSET_SCALE
    return np.concatenate([flat, normals.reshape(-1, 9), face, offset], axis=1).astype(np.float32)


def _uv_density(uvs: F64, triangles: F32) -> F32:
    """sqrt(area in texture space / area in the world): texture units per scene unit, (T,) float32."""
    a, b, c = uvs[:, 0:2], uvs[:, 2:4], uvs[:, 4:6]
    uv_area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    p = triangles[:, :9].reshape(-1, 3, 3).astype(np.float64)
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    density: F32 = np.sqrt(uv_area / np.maximum(area, 1e-30)).astype(np.float32)
    return density


def _colors(meshes: Sequence[Mesh]) -> F32:
    """The corners' colours without alpha, (T, 9) float32; (1, 9) where no mesh has any."""
    if all(mesh.colors is None for mesh in meshes):
        return np.ones((1, 9), np.float32)
    parts = [
        np.ones((len(mesh.faces), 9)) if mesh.colors is None else mesh.colors[mesh.faces][..., :3].reshape(-1, 9)
        for mesh in meshes
    ]
    return np.ascontiguousarray(np.concatenate(parts), dtype=np.float32)


def _ordered(scene: Scene) -> list[Mesh]:
    """Meshes in the order of the triangles: those that move last."""
    return sorted(scene.meshes, key=lambda mesh: mesh.motion is not None)


def compile_scene(scene: Scene) -> CompiledScene:
    """Prepare ``scene`` for tracing. Raises UserError for a scene without triangles."""
    if scene.triangle_count == 0:
        raise UserError(f"{scene.name}: there is no triangle in this scene", "check that the file holds meshes")
    meshes = _ordered(scene)
    static_count = sum(len(m.faces) for m in meshes if m.motion is None)
    origin = scene.origin
    triangles = np.concatenate([_records(mesh, origin) for mesh in meshes])
    info = np.full((len(triangles), 4), -1, dtype=np.int32)
    info[:, SMOOTH] = np.repeat([m.normals is not None for m in meshes], [len(m.faces) for m in meshes])
    info[:, MATERIAL] = np.concatenate([m.materials for m in meshes])
    info[:, OBJECT] = np.repeat(np.arange(len(meshes)), [len(m.faces) for m in meshes])

    materials = scene.materials
    material_info = np.array(
        [
            (
                m.base_texture,
                m.emission_texture if m.emits else -1,
                m.double_sided,
                m.specular,
                m.metallic_roughness_texture if m.specular else -1,
                m.normal_texture,
            )
            for m in materials
        ],
        dtype=np.int32,
    )
    uvs, density = np.zeros((1, 6), np.float32), np.zeros(1, np.float32)
    if material_info[:, TEXTURES].max() >= 0:
        zero = np.zeros((1, 2), np.float32)
        uvs = np.concatenate(
            [m.uvs[m.faces].reshape(-1, 6) if m.uvs is not None else np.tile(zero, (len(m.faces), 3)) for m in meshes]
        ).astype(np.float32)
        density = _uv_density(uvs.astype(np.float64), triangles)
    lower, upper = scene.bounds()
    compiled = CompiledScene(
        scene=scene,
        origin=origin,
        triangles=np.ascontiguousarray(triangles),
        triangle_info=info,
        triangle_uvs=np.ascontiguousarray(uvs),
        uv_density=density,
        base_color=np.array([m.base_color for m in materials], dtype=np.float32),
        emission=np.array([m.emission for m in materials], dtype=np.float32),
        material_info=material_info,
        colors=_colors(meshes),
        gloss=np.array([(m.metallic, m.roughness, m.normal_scale) for m in materials], dtype=np.float32),
        textures=build_atlas(scene.textures),
        lights=no_lights(),
        static_count=static_count,
        prev_triangles=triangles[static_count:].copy(),
        extent=float(np.linalg.norm(upper - lower)),
    )
    compiled.lights = collect_lights(compiled, info[:, MATERIAL])
    info[compiled.lights.triangles, LIGHT] = np.arange(len(compiled.lights.triangles))
    return compiled
