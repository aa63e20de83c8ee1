# The types of the native module; the docstrings are there, and a test holds the two together.

import os
from collections.abc import Callable, Sequence
from typing import Any, Literal, Protocol, Union, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "Camera",
    "DatasetRefiner",
    "Fuser",
    "IterationEvent",
    "Model",
    "Observation",
    "Pipeline",
    "PoseEstimate",
    "RegimeEvent",
    "Result",
    "SequentialEstimator",
    "SequentialStep",
    "StageEvent",
    "add",
    "adi",
    "fuse",
    "mspd",
    "mssd",
    "mve",
    "point_to_plane_step",
    "point_to_point_step",
    "read_depth_png",
    "read_images",
    "read_mask_png",
    "render_depth",
    "result_header",
    "vsd",
]

_Array = npt.NDArray[np.float64]
_Unit = Literal["m", "mm", "cm"]
_Axis = tuple[Sequence[float], Sequence[float]]
_Path = Union[str, os.PathLike[str]]
_Outcome = Literal["refined", "kept_initial"]

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

@final
class Observation:
    def __new__(
        cls,
        depth: npt.NDArray[np.float32] | npt.NDArray[np.float64] | npt.NDArray[np.uint16],
        mask: npt.NDArray[np.bool_] | npt.NDArray[np.uint8] | None,
        camera: Camera,
        *,
        scale: float | None = None,
    ) -> Observation: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def depth(self) -> npt.NDArray[np.float32]: ...
    @property
    def mask(self) -> npt.NDArray[np.bool_]: ...
    @property
    def n_measured(self) -> int: ...
    @property
    def n_surfels(self) -> int: ...
    def surfels(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]: ...

@final
class Pipeline:
    @staticmethod
    def preset(name: str, *, overrides: Sequence[str] = ...) -> Pipeline: ...
    @staticmethod
    def from_toml(text_or_path: _Path, *, overrides: Sequence[str] = ...) -> Pipeline: ...
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
    def refine_batch(
        self,
        model: Model,
        observation: Observation,
        T_co: npt.ArrayLike,
        threads: int | None = None,
    ) -> list[Result]: ...
    def __reduce__(self) -> tuple[Callable[[str, str, list[str]], Pipeline], tuple[str, str, list[str]]]: ...
    @staticmethod
    def _restore(origin: str, toml: str, overrides: Sequence[str]) -> Pipeline: ...

@final
class Result:
    @property
    def T_co(self) -> _Array: ...
    @property
    def mve(self) -> float: ...
    @property
    def mve_initial(self) -> float: ...
    @property
    def outcome(self) -> _Outcome: ...
    @property
    def refined(self) -> bool: ...
    @property
    def termination(self) -> str: ...
    @property
    def iterations(self) -> int: ...
    @property
    def n_pairs(self) -> int: ...
    @property
    def mean_loss(self) -> float | None: ...
    @property
    def fitness(self) -> float | None: ...
    @property
    def point_rmse(self) -> float | None: ...
    @property
    def plane_rmse(self) -> float | None: ...
    @property
    def information(self) -> _Array | None: ...
    @property
    def covariance(self) -> _Array | None: ...
    @property
    def stages(self) -> list[StageEvent]: ...
    def to_dict(self) -> dict[str, Any]: ...

@final
class IterationEvent:
    @property
    def iteration(self) -> int: ...
    @property
    def T_co(self) -> _Array: ...
    @property
    def increment(self) -> _Array: ...
    @property
    def n_pairs(self) -> int: ...
    @property
    def mean_loss(self) -> float: ...

@final
class RegimeEvent:
    @property
    def regime(self) -> str: ...
    @property
    def score(self) -> float | None: ...

@final
class StageEvent:
    @property
    def regime(self) -> str | None: ...
    @property
    def regime_mve(self) -> float | None: ...
    @property
    def selection(self) -> str: ...
    @property
    def association(self) -> str: ...
    @property
    def metric(self) -> str: ...
    @property
    def n_source(self) -> int: ...
    @property
    def T_co(self) -> _Array: ...
    @property
    def outcome(self) -> _Outcome: ...
    @property
    def termination(self) -> str: ...
    @property
    def iterations(self) -> int: ...
    @property
    def n_pairs(self) -> int: ...
    @property
    def mean_loss(self) -> float | None: ...
    def to_dict(self) -> dict[str, Any]: ...

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
class SequentialStep:
    @property
    def T_co(self) -> _Array: ...
    @property
    def covariance(self) -> _Array | None: ...
    @property
    def T_init(self) -> _Array: ...
    @property
    def T_registered(self) -> _Array: ...
    @property
    def termination(self) -> str: ...
    @property
    def mve(self) -> float | None: ...
    @property
    def event(self) -> str: ...

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
) -> float: ...
def render_depth(
    model: Model, camera: Camera, T_co: npt.ArrayLike
) -> npt.NDArray[np.float32]: ...
def fuse(estimates: Sequence[PoseEstimate]) -> PoseEstimate: ...
def point_to_point_step(
    sources: npt.ArrayLike, targets: npt.ArrayLike
) -> tuple[_Array, float]: ...
def point_to_plane_step(
    sources: npt.ArrayLike, targets: npt.ArrayLike, normals: npt.ArrayLike
) -> tuple[_Array, float]: ...
def read_depth_png(path: _Path, scale: float) -> npt.NDArray[np.float32]: ...
def read_mask_png(path: _Path) -> npt.NDArray[np.bool_]: ...
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
        rescore: Literal["keep", "mve"] = "keep",
    ) -> DatasetRefiner: ...
    def refine(self, rows: str) -> tuple[list[str], list[str], list[str]]: ...
    @property
    def broken_models(self) -> dict[int, str]: ...
    @property
    def missing_models(self) -> list[int]: ...
