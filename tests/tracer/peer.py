"""The tests' scenes in Mitsuba 3, a renderer of its own right: what it makes of them, with the error of that."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raytrace.camera import Camera
from raytrace.scene import Material, Mesh, Scene, Texture

F64 = NDArray[np.float64]

mi: Any = import_module("mitsuba")  # its stubs are written for a later Python than mypy checks for


def peer_images(what: Scene, size: tuple[int, int], samples: int, runs: int, folder: Path) -> F64:
    """``runs`` independent images (runs, H, W, 3) of ``samples`` paths per pixel, row 0 at the bottom.

    Paths of two bounces without roulette, a box filter over the pixel. Materials are diffuse, or metals of reflectance
    1, which both renderers understand alike.
    """
    mi.set_variant("scalar_rgb")
    description: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 3, "rr_depth": 1000},
        "sensor": _sensor(what.camera, size),
    }
    if what.sky is not None:
        description["sky"] = {"type": "constant", "radiance": {"type": "rgb", "value": list(what.sky)}}
    for k, mesh in enumerate(what.meshes):
        description[f"mesh{k}"] = _shape(what, mesh, folder / f"{k}.ply")
    scene = mi.load_dict(description)
    images = [np.array(mi.render(scene, spp=samples, seed=seed)) for seed in range(runs)]
    return np.stack(images)[:, ::-1, :, :3].astype(np.float64)


def _sensor(camera: Camera, size: tuple[int, int]) -> dict[str, Any]:
    position = np.array(camera.position)
    _, up, forward = camera.basis()
    to_world = mi.ScalarTransform4f().look_at(
        origin=position.tolist(), target=(position + forward).tolist(), up=np.asarray(up).tolist()
    )
    return {
        "type": "perspective",
        "fov": float(np.degrees(camera.yfov)),
        "fov_axis": "y",
        "near_clip": 1e-3,
        "to_world": to_world,
        "sampler": {"type": "independent"},
        "film": {
            "type": "hdrfilm",
            "width": size[0],
            "height": size[1],
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
        },
    }


def _shape(what: Scene, mesh: Mesh, path: Path) -> dict[str, Any]:
    material = what.materials[int(mesh.materials[0])]
    _write_ply(path, mesh)
    shape: dict[str, Any] = {
        "type": "ply",
        "filename": str(path),
        "face_normals": mesh.normals is None,
        "bsdf": {"type": "twosided", "bsdf": _bsdf(material, what.textures)},
    }
    if material.emits:
        shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": list(material.emission)}}
    return shape


def _bsdf(material: Material, textures: tuple[Texture, ...]) -> dict[str, Any]:
    if material.specular:
        assert material.metallic == 1.0
        assert material.base_color == (1.0, 1.0, 1.0)
        return {
            "type": "roughconductor",
            "material": "none",
            "distribution": "ggx",
            "alpha": material.roughness**2,
            "sample_visible": True,
        }
    if material.base_texture < 0:
        return {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(material.base_color)}}
    assert material.base_color == (1.0, 1.0, 1.0)
    pixels = np.ascontiguousarray(textures[material.base_texture].pixels[::-1])
    bitmap = mi.Bitmap(pixels)
    bitmap.set_srgb_gamma(True)
    return {"type": "diffuse", "reflectance": {"type": "bitmap", "bitmap": bitmap, "filter_type": "bilinear"}}


def _write_ply(path: Path, mesh: Mesh) -> None:
    uvs = np.zeros((len(mesh.vertices), 2)) if mesh.uvs is None else mesh.uvs
    names = ("x", "y", "z", "u", "v")
    header = ["ply", "format ascii 1.0", f"element vertex {len(mesh.vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = [" ".join(map(repr, map(float, row))) for row in np.hstack([mesh.vertices, uvs])]
    faces = [f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist()]
    path.write_text("\n".join([*header, *rows, *faces]) + "\n")
