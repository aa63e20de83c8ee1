"""The colors of meshes of other libraries."""

from typing import Any

import numpy as np


def of_trimesh(mesh: Any) -> Any:
    """Returns the argument `colors` of `Model` for a mesh of trimesh; None without colors."""
    visual: Any = getattr(mesh, "visual", None)
    if getattr(visual, "kind", None) in ("vertex", "face"):
        return np.ascontiguousarray(visual.vertex_colors[:, :3])
    material, places = getattr(visual, "material", None), getattr(visual, "uv", None)
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    if image is None or places is None:
        return None
    corners = np.asarray(places, np.float32)[np.asarray(mesh.faces)]
    # The origin of trimesh is the lower left corner.
    corners[..., 1] = 1 - corners[..., 1]
    return [np.asarray(image.convert("RGB"))], np.zeros(len(corners), np.uint32), corners


def of_open3d(mesh: Any) -> Any:
    """Returns the argument `colors` of `Model` for a mesh of Open3D; None without colors."""
    if not mesh.has_vertex_colors():
        return None
    return (255 * np.asarray(mesh.vertex_colors)).round().astype(np.uint8)
