"""Adapters for the conventions of other libraries, none of which is imported."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ._native import (
    Camera,
    Model,
    Observation,
    Pipeline,
    read_depth,
    read_mask,
    read_pose,
    render_depth,
)
from ._results import Result

__all__ = ["DepthRefiner", "FoundationPoseFolder"]


class DepthRefiner:
    """Refines the estimates of HappyPose: call it as its depth refiners.

    The estimates are duck-typed: `infos` is a table with the columns `label` and `batch_im_id`, and
    `poses` has the shape (N, 4, 4), camera from object, meters. Both may be of pandas and torch.

    Parameters
    ----------
    models : mapping of str to Model
        The models by label.
    pipeline : Pipeline, optional
    """

    def __init__(self, models: Mapping[str, Model], pipeline: Pipeline | None = None) -> None:
        self.models = models
        self.pipeline = pipeline or Pipeline()

    def refine_poses(
        self, predictions: Any, *, depth: Any, K: Any, masks: Any = None
    ) -> tuple[Any, dict[str, Any]]:
        """Refines every estimate in its image.

        Parameters
        ----------
        predictions : PoseEstimatesType
            Estimates with `infos`, `poses` and `clone()`.
        depth : array_like, shape (B, H, W)
            Depth images, meters.
        K : array_like, shape (B, 3, 3)
            Calibrations, pixels.
        masks : array_like, shape (N, H, W), bool, optional
            A mask per estimate. By default, the box of the silhouette at the estimate, widened by a
            tenth of its size.

        Returns
        -------
        predictions : PoseEstimatesType
            A copy with the refined poses, shape (N, 4, 4), meters.
        extra : dict
            `results`: the Result of every estimate.
        """
        depths, calibrations = np.asarray(depth), np.asarray(K)
        poses = np.array(predictions.poses, dtype=np.float64)
        # Lists, because the rows of a filtered table keep their old numbers.
        labels, images = (list(predictions.infos[name]) for name in ("label", "batch_im_id"))
        results: list[Result] = []
        for index, pose in enumerate(poses):
            image, model = int(images[index]), self.models[labels[index]]
            height, width = depths[image].shape
            camera = Camera.from_K(calibrations[image], (width, height))
            mask = _around(model, camera, pose) if masks is None else np.asarray(masks[index])
            observation = Observation(depths[image].astype(np.float32), mask, camera)
            results.append(self.pipeline.refine(model, observation, pose))
        refined = predictions.clone()
        for index, result in enumerate(results):
            # By element, which arrays and tensors accept alike.
            for row, column in np.ndindex(4, 4):
                refined.poses[index, row, column] = float(result.T_co[row, column])
        return refined, {"results": results}


def _around(model: Model, camera: Camera, T_co: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    """Returns the box around the silhouette, widened by a tenth of its size."""
    mask = render_depth(model, camera, T_co) > 0
    v, u = np.nonzero(mask)
    if len(v):
        border = int(0.1 * max(np.ptp(u), np.ptp(v))) + 1
        rows = slice(max(v.min() - border, 0), v.max() + border + 1)
        mask[rows, max(u.min() - border, 0) : u.max() + border + 1] = True
    return mask


class FoundationPoseFolder:
    """Reads a folder in the layout of FoundationPose: `depth/`, `masks/`, `cam_K.txt`, `ob_in_cam/`.

    The mask of the first frame may be the only one, as in its demos.

    Parameters
    ----------
    folder : str or os.PathLike
    scale : float, optional
        Meters per unit of the depth images.
    """

    def __init__(self, folder: str | PathLike[str], *, scale: float = 0.001) -> None:
        self.folder, self.scale = Path(folder), scale
        self.names = sorted(path.stem for path in (self.folder / "depth").iterdir())

    def __len__(self) -> int:
        return len(self.names)

    def observation(self, index: int) -> Observation:
        """Returns an image with its mask; without one, the mask has all pixels.

        Parameters
        ----------
        index : int
            Place of the image in the order of names.

        Returns
        -------
        Observation
        """
        name = self.names[index]
        depth = read_depth(next((self.folder / "depth").glob(name + ".*")), scale=self.scale)
        size = (depth.shape[1], depth.shape[0])
        camera = Camera.from_file(self.folder / "cam_K.txt", size)
        masks = list((self.folder / "masks").glob(name + ".*"))
        mask = read_mask(masks[0]) if masks else None
        return Observation(depth, mask, camera)

    def pose(self, index: int) -> npt.NDArray[np.float64]:
        """Returns the stored pose of an image, from `ob_in_cam/`.

        Parameters
        ----------
        index : int
            Place of the image in the order of names.

        Returns
        -------
        numpy.ndarray, shape (4, 4), float64
            Camera from object, meters.
        """
        return read_pose(self.folder / "ob_in_cam" / f"{self.names[index]}.txt")
