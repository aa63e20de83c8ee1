# The types of the native module. The module itself has the docstrings, and stubtest compares both.

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, Protocol, TypedDict, Union, final

import numpy as np
import numpy.typing as npt

from ._results import (
    Alignment,
    IterationEvent,
    RegimeEvent,
    Result,
    SequentialStep,
    StageEvent,
    Tracked,
)

__all__ = [
    "Camera",
    "DatasetRefiner",
    "DepthImage",
    "Fuser",
    "Model",
    "Observation",
    "Pipeline",
    "PoseEstimate",
    "SequentialEstimator",
    "Tracker",
    "add",
    "adi",
    "align",
    "fuse",
    "mspd",
    "mssd",
    "mve",
    "parts",
    "point_to_plane_step",
    "point_to_point_step",
    "read_cloud",
    "read_depth",
    "read_depth_png",
    "read_images",
    "read_mask",
    "read_mask_png",
    "read_pose",
    "render_depth",
    "result_header",
    "vsd",
]

_Array = npt.NDArray[np.float64]
_Unit = Literal["m", "mm", "cm"]
_Axis = tuple[Sequence[float], Sequence[float]]
_Path = Union[str, os.PathLike[str]]
_Fields = Union[Mapping[str, object], Sequence[str]]
_Part = Union[str, Mapping[str, object]]

class _OnIteration(Protocol):
    def on_iteration(self, event: IterationEvent, /) -> object: ...

class _OnRegime(Protocol):
    def on_regime(self, event: RegimeEvent, /) -> object: ...

class _OnStageEnd(Protocol):
    def on_stage_end(self, event: StageEvent, /) -> object: ...

_Observer = Union[Callable[[IterationEvent], object], _OnIteration, _OnRegime, _OnStageEnd]

@final
class Camera:
    def __new__(
        cls,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        width: int,
        height: int,
        *,
        pixel_centers: Literal["integers", "halves"] = "integers",
    ) -> Camera: ...
    @staticmethod
    def from_K(K: npt.ArrayLike, size: tuple[int, int]) -> Camera: ...
    @staticmethod
    def from_file(path: _Path, size: tuple[int, int]) -> Camera: ...
    @property
    def fx(self) -> float: ...
    @property
    def fy(self) -> float: ...
    @property
    def cx(self) -> float: ...
    @property
    def cy(self) -> float: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def K(self) -> _Array: ...
    def __getnewargs__(self) -> tuple[float, float, float, float, int, int]: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...

class _HasArray(Protocol):
    def __array__(self, /) -> npt.NDArray[Any]: ...

class _HasMesh(Protocol):
    @property
    def vertices(self) -> Any: ...
    @property
    def faces(self) -> Any: ...

_Depth = Union[
    npt.NDArray[np.float32], npt.NDArray[np.float64], npt.NDArray[np.uint16], _HasArray
]
_Mask = Union[npt.NDArray[np.bool_], npt.NDArray[np.uint8], _HasArray]

@final
class DepthImage:
    def __new__(cls, depth: _Depth, *, scale: float | None = None) -> DepthImage: ...
    @staticmethod
    def from_png(path: _Path, scale: float) -> DepthImage: ...
    @staticmethod
    def from_points(
        points: npt.ArrayLike, camera: Camera, T_cp: npt.ArrayLike | None = None
    ) -> DepthImage: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    def to_numpy(self) -> npt.NDArray[np.float32]: ...
    def __getnewargs__(self) -> tuple[npt.NDArray[np.float32]]: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...

@final
class Model:
    def __new__(
        cls,
        vertices: npt.ArrayLike,
        faces: npt.ArrayLike,
        *,
        unit: _Unit = "m",
        samples: int = 1000,
        diameter: float | None = None,
        symmetries: npt.ArrayLike | None = None,
        symmetry_axes: Sequence[_Axis] = ...,
    ) -> Model: ...
    @staticmethod
    def from_file(
        path: _Path,
        *,
        unit: _Unit,
        samples: int = 1000,
        diameter: float | None = None,
        symmetries: npt.ArrayLike | None = None,
        symmetry_axes: Sequence[_Axis] = ...,
    ) -> Model: ...
    @staticmethod
    def from_bop(folder: _Path, obj_id: int) -> Model: ...
    @staticmethod
    def from_trimesh(
        mesh: _HasMesh,
        *,
        unit: _Unit,
        samples: int = 1000,
        diameter: float | None = None,
        symmetries: npt.ArrayLike | None = None,
        symmetry_axes: Sequence[_Axis] = ...,
    ) -> Model: ...
    def nearest_equivalent(self, T_co: npt.ArrayLike, reference: npt.ArrayLike) -> _Array: ...
    @property
    def vertices(self) -> npt.NDArray[np.float32]: ...
    @property
    def faces(self) -> npt.NDArray[np.uint32]: ...
    @property
    def diameter(self) -> float: ...
    @property
    def center(self) -> tuple[float, float, float]: ...
    @property
    def radius(self) -> float: ...
    def __getnewargs_ex__(
        self,
    ) -> tuple[tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]], dict[str, Any]]: ...
    def _repr_png_(self) -> bytes: ...

@final
class Observation:
    def __new__(
        cls,
        depth: DepthImage | _Depth,
        mask: _Mask | None,
        camera: Camera,
        *,
        scale: float | None = None,
    ) -> Observation: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def depth(self) -> npt.NDArray[np.float32]: ...
    @property
    def image(self) -> DepthImage: ...
    @property
    def mask(self) -> npt.NDArray[np.bool_]: ...
    @property
    def n_measured(self) -> int: ...
    @property
    def n_surfels(self) -> int: ...
    def surfels(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]: ...
    @staticmethod
    def from_open3d(
        depth: Any, intrinsic: Any, mask: _Mask | None = None, *, scale: float = 0.001
    ) -> Observation: ...
    def residuals(
        self, result: Result, *, model: Model | None = None
    ) -> npt.NDArray[np.float32]: ...
    def __getnewargs__(self) -> tuple[DepthImage, npt.NDArray[np.bool_], Camera]: ...
    def _repr_png_(self) -> bytes: ...

@final
class Pipeline:
    def __new__(cls, name: str = "auto", *, overrides: _Fields | None = None) -> Pipeline: ...
    @staticmethod
    def preset(name: str, *, overrides: _Fields | None = None) -> Pipeline: ...
    @staticmethod
    def from_toml(text_or_path: _Path, *, overrides: _Fields | None = None) -> Pipeline: ...
    @staticmethod
    def icp(
        *,
        selection: _Part,
        association: _Part,
        metric: _Part,
        filter: Sequence[_Part] | None = None,
        stop: Sequence[_Part] | None = None,
    ) -> Pipeline: ...
    @staticmethod
    def presets() -> list[str]: ...
    @property
    def name(self) -> str: ...
    @property
    def toml(self) -> str: ...
    def refine(
        self,
        model: Model,
        observation: Observation,
        T_co: npt.ArrayLike,
        observer: _Observer | None = None,
    ) -> Result: ...
    def estimate(self, model: Model, observation: Observation) -> Result: ...
    def refine_batch(
        self,
        model: Model,
        observation: Observation,
        T_co: npt.ArrayLike,
        threads: int | None = None,
    ) -> list[Result]: ...
    def refine_many(
        self,
        items: Iterable[tuple[Model, Observation, npt.ArrayLike]],
        threads: int | None = None,
    ) -> list[Result]: ...
    def __reduce__(self) -> tuple[Callable[[str, str, list[str]], Pipeline], tuple[str, str, list[str]]]: ...
    @staticmethod
    def _restore(origin: str, toml: str, overrides: Sequence[str]) -> Pipeline: ...

@final
class PoseEstimate:
    def __new__(
        cls, T_co: npt.ArrayLike, covariance: npt.ArrayLike, *, mve: float | None = None
    ) -> PoseEstimate: ...
    @property
    def T_co(self) -> _Array: ...
    @property
    def covariance(self) -> _Array: ...
    @property
    def mve(self) -> float | None: ...
    def mahalanobis_squared(self, other: PoseEstimate) -> float: ...
    def __getnewargs_ex__(self) -> tuple[tuple[_Array, _Array], dict[str, float | None]]: ...

@final
class Fuser:
    def __new__(
        cls,
        method: str,
        *,
        model: Model | None = None,
        max_mve: float | None = None,
        max_mahalanobis_squared: float | None = None,
        restart_after: int | None = None,
        window: int | None = None,
        transport: Literal["adjoint", "kept"] = "adjoint",
    ) -> Fuser: ...
    @staticmethod
    def methods() -> list[str]: ...
    def propagate(self, T_nc: npt.ArrayLike, covariance: npt.ArrayLike | None = None) -> None: ...
    def update(
        self, estimate: PoseEstimate
    ) -> Literal["accepted", "provisional", "rejected", "restarted"]: ...
    @property
    def estimate(self) -> PoseEstimate | None: ...
    def reset(self) -> None: ...

@final
class SequentialEstimator:
    def __new__(
        cls,
        pipeline: Pipeline,
        method: str,
        model: Model,
        T_co: npt.ArrayLike,
        *,
        paper: bool = False,
    ) -> SequentialEstimator: ...
    def step(
        self,
        observation: Observation,
        T_nc: npt.ArrayLike | None = None,
        covariance: npt.ArrayLike | None = None,
    ) -> SequentialStep: ...
    def move_camera(self, T_nc: npt.ArrayLike, covariance: npt.ArrayLike | None = None) -> None: ...
    def restart(self, T_co: npt.ArrayLike) -> None: ...
    @property
    def T_co(self) -> _Array: ...
    @property
    def estimate(self) -> PoseEstimate | None: ...

@final
class Tracker:
    def __new__(
        cls,
        model: Model,
        camera: Camera,
        T_co: npt.ArrayLike,
        *,
        meters_per_second: float = 0.3,
        degrees_per_second: float = 90.0,
    ) -> Tracker: ...
    def step(
        self,
        depth: DepthImage | npt.ArrayLike,
        seconds: float,
        mask: npt.ArrayLike | None = None,
        *,
        scale: float | None = None,
    ) -> Tracked: ...
    def restart(self, T_co: npt.ArrayLike) -> None: ...

def align(
    source: npt.ArrayLike,
    target: npt.ArrayLike,
    T_ts: npt.ArrayLike | None = None,
    *,
    source_normals: npt.ArrayLike | None = None,
    target_normals: npt.ArrayLike | None = None,
    method: Literal["point-to-plane", "point-to-point", "gicp"] = "point-to-plane",
    max_distance: float | None = None,
    voxel: float | None = None,
    neighbors: int = 20,
) -> Alignment: ...
def add(T_est: npt.ArrayLike, T_gt: npt.ArrayLike, model: Model) -> float: ...
def adi(T_est: npt.ArrayLike, T_gt: npt.ArrayLike, model: Model) -> float: ...
def mssd(T_est: npt.ArrayLike, T_gt: npt.ArrayLike, model: Model) -> float: ...
def mspd(T_est: npt.ArrayLike, T_gt: npt.ArrayLike, model: Model, camera: Camera) -> float: ...
def vsd(
    model: Model,
    observation: Observation,
    T_est: npt.ArrayLike,
    T_gt: npt.ArrayLike,
    *,
    delta: float = ...,
) -> _Array: ...
def mve(
    model: Model,
    observation: Observation,
    T_co: npt.ArrayLike,
    *,
    occlusion_tolerance: float | None = ...,
    imperfect_mask: bool = ...,
) -> float: ...
def render_depth(
    model: Model, camera: Camera, T_co: npt.ArrayLike
) -> npt.NDArray[np.float32]: ...
def fuse(estimates: Sequence[PoseEstimate]) -> PoseEstimate: ...
def parts() -> list[dict[str, Any]]: ...
def point_to_point_step(
    sources: npt.ArrayLike, targets: npt.ArrayLike
) -> tuple[_Array, float]: ...
def point_to_plane_step(
    sources: npt.ArrayLike, targets: npt.ArrayLike, normals: npt.ArrayLike
) -> tuple[_Array, float]: ...
def read_cloud(
    path: _Path, unit: _Unit = "m"
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32] | None]: ...
def read_depth(path: _Path, *, scale: float | None = None) -> npt.NDArray[np.float32]: ...
def read_depth_png(path: _Path, scale: float) -> npt.NDArray[np.float32]: ...
def read_mask(
    path: _Path, *, threshold: float | None = None, value: float | None = None
) -> npt.NDArray[np.bool_]: ...
def read_mask_png(path: _Path) -> npt.NDArray[np.bool_]: ...
def read_pose(path: _Path, *, unit: _Unit | None = None) -> _Array: ...
def read_images(
    results: _Path, *, limit: int | None = None
) -> list[tuple[int, int, list[int], str]]: ...
def result_header() -> str: ...

@final
class DatasetRefiner:
    def __new__(
        cls,
        dataset: _Path,
        split: str,
        pipeline: Pipeline,
        objects: Sequence[int],
        *,
        detections: _Path | None = None,
        rescore: Literal["keep", "mve", "confidence"] = "keep",
    ) -> DatasetRefiner: ...
    def refine(self, rows: str) -> tuple[list[str], list[str], list[str]]: ...
    @property
    def broken_models(self) -> dict[int, str]: ...
    @property
    def missing_models(self) -> list[int]: ...
