# The types of the native module. The module itself has the docstrings, and stubtest compares both.

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, Protocol, TypedDict, Union, final
import numpy as np
import numpy.typing as npt
from ._results import Alignment, DecisionEvent, Diagnosis, IterationEvent, RegimeEvent, Result, SequentialStep, StageEvent, Tracked
__all__ = ['Camera', 'DatasetRefiner', 'DepthImage', 'Fuser', 'Model', 'Observation', 'Pipeline', 'PoseEstimate', 'SequentialEstimator', 'Tracker', 'add', 'adi', 'align', 'diagnose', 'fuse', 'mask_in_box', 'mspd', 'mssd', 'mve', 'parts', 'point_to_plane_step', 'point_to_point_step', 'read_cloud', 'read_depth', 'read_depth_png', 'read_images', 'read_mask', 'read_mask_png', 'read_pose', 'render_depth', 'result_header', 'run_program', 'vsd']
_Array = npt.NDArray[np.float64]
_Unit = Literal['m', 'mm', 'cm']
_Axes = Union[npt.ArrayLike, Sequence[tuple[npt.ArrayLike, npt.ArrayLike]]]
_Path = Union[str, os.PathLike[str]]
_Fields = Union[Mapping[str, object], Sequence[str]]
_Part = Union[str, Mapping[str, object]]

class _Cloud(Protocol):

    @property
    def points(self) -> Any:
        ...

    @property
    def normals(self) -> Any:
        ...
_Points = Union[npt.ArrayLike, tuple[npt.ArrayLike, Union[npt.ArrayLike, None]], _Cloud]

class _OnIteration(Protocol):

    def on_iteration(self, event: IterationEvent, /) -> object:
        ...

class _OnRegime(Protocol):

    def on_regime(self, event: RegimeEvent, /) -> object:
        ...

class _OnDecision(Protocol):

    def on_decision(self, event: DecisionEvent, /) -> object:
        ...

class _OnStageEnd(Protocol):

    def on_stage_end(self, event: StageEvent, /) -> object:
        ...
_Observer = Union[Callable[[IterationEvent], object], _OnIteration, _OnRegime, _OnDecision, _OnStageEnd]

@final
class Camera:
    """A pinhole camera without distortion, in the frame of OpenCV.

    It looks along +z, with x right and y down. A point (x, y, z) in meters projects to
    u = fx·x/z + cx and v = fy·y/z + cy.

    Parameters
    ----------
    fx, fy : float
        Focal lengths, pixels.
    cx, cy : float
        Principal point, pixels.
    width, height : int
        Image size, pixels.
    pixel_centers : {"integers", "halves"}, optional
        Position of the center of the first pixel in the calibration. It is (0, 0) for "integers",
        as in OpenCV and BOP, and (½, ½) for "halves", as in OpenGL and BlenderProc.

    Examples
    --------
    >>> from hybrid_icp import Camera
    >>> Camera(572.4, 573.6, 325.3, 242.0, 640, 480)
    Camera(fx=572.4, fy=573.6, cx=325.3, cy=242, width=640, height=480)
    """

    def __new__(cls, fx: float, fy: float, cx: float, cy: float, width: int, height: int, *, pixel_centers: Literal['integers', 'halves']='integers') -> Camera:
        ...

    @staticmethod
    def from_K(K: npt.ArrayLike, size: Sequence[int]) -> Camera:
        """Creates a camera from a calibration matrix.

        Parameters
        ----------
        K : array_like, shape (3, 3)
            [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], pixels, pixel centers at integers.
        size : (int, int)
            Width and height of the image, pixels.

        Returns
        -------
        Camera

        Examples
        --------
        >>> from hybrid_icp import Camera
        >>> Camera.from_K([[600, 0, 319.5], [0, 600, 239.5], [0, 0, 1]], (640, 480)).fx
        600.0
        """

    @staticmethod
    def from_file(path: _Path, size: Sequence[int]) -> Camera:
        """Reads a camera from a file of BOP, ROS, OpenCV, RealSense, Open3D or NumPy.

        Parameters
        ----------
        path : str or os.PathLike
            JSON, YAML, XML, text, NPY or NPZ.
        size : (int, int)
            Width and height of the image, pixels. A size in the file must be the same.

        Returns
        -------
        Camera

        Raises
        ------
        FileError
            If the file cannot be read, has no camera, or has lens distortion.
        """

    @property
    def fx(self) -> float:
        """Horizontal focal length, pixels."""

    @property
    def fy(self) -> float:
        """Vertical focal length, pixels."""

    @property
    def cx(self) -> float:
        """Column of the principal point, pixels, centers at integers."""

    @property
    def cy(self) -> float:
        """Row of the principal point, pixels, centers at integers."""

    @property
    def width(self) -> int:
        """Image width, pixels."""

    @property
    def height(self) -> int:
        """Image height, pixels."""

    @property
    def K(self) -> _Array:
        """The calibration matrix, shape (3, 3), float64, pixels."""

    def __getnewargs__(self) -> tuple[float, float, float, float, int, int]:
        ...

    def __hash__(self) -> int:
        ...

    def __eq__(self, value: object, /) -> bool:
        ...

    def __ne__(self, value: object, /) -> bool:
        ...

class _HasArray(Protocol):

    def __array__(self, /) -> npt.NDArray[Any]:
        ...

class _HasArrayInterface(Protocol):

    @property
    def __array_interface__(self) -> Any:
        ...

class _HasScene(Protocol):

    def to_mesh(self) -> Any:
        ...

class _HasMesh(Protocol):

    @property
    def vertices(self) -> Any:
        ...

    @property
    def faces(self) -> Any:
        ...
_Depth = Union[npt.NDArray[np.floating[Any]], npt.NDArray[np.integer[Any]], _HasArray, _HasArrayInterface]
_Mask = Union[npt.NDArray[np.bool_], npt.NDArray[np.integer[Any]], _HasArray, _HasArrayInterface]
_Color = Union[npt.NDArray[np.uint8], _HasArray, _HasArrayInterface]
_Textures = tuple[Sequence[npt.NDArray[np.uint8]], npt.ArrayLike, npt.ArrayLike]

@final
class DepthImage:
    """A depth image that the observations of several masks share.

    The array is read, checked and copied once. The copy is necessary: other threads can write to
    the array while the GIL is released.

    Parameters
    ----------
    depth : numpy.ndarray, shape (H, W) or (H, W, 1)
        Depth along the optical axis: float32 (or float16 or float64) meters, or integers of 16 or
        more bits with `scale`. Pixels without a measurement are 0, negative, infinite or NaN, or
        65535 in uint16.
    scale : float, optional
        Meters per unit of an image of integers, such as 0.001; BOP's `depth_scale` divided by 1000.

    Raises
    ------
    InputError
        If the shape, dtype or unit is wrong. The message has the value found and the one expected.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid_icp import Camera, DepthImage, Observation
    >>> camera = Camera(100, 100, 31.5, 23.5, 64, 48)
    >>> image = DepthImage(np.full((48, 64), 800, np.uint16), scale=0.001)  # Once per image.
    >>> image
    DepthImage(64x48)
    >>> masks = np.zeros((2, 48, 64), bool)
    >>> masks[0, :, :32] = masks[1, :, 32:] = True
    >>> [Observation(image, mask, camera).n_measured for mask in masks]
    [1536, 1536]
    """

    def __new__(cls, depth: _Depth, *, scale: float | None=None) -> DepthImage:
        ...

    @staticmethod
    def from_png(path: _Path, scale: float) -> DepthImage:
        """Reads a 16-bit gray PNG without an intermediate array.

        Parameters
        ----------
        path : str or os.PathLike
        scale : float
            Meters per unit, such as 0.001; BOP's `depth_scale` divided by 1000.

        Returns
        -------
        DepthImage

        Raises
        ------
        FileError
            If the file cannot be read or is not such an image.
        InputError
            If `scale` is wrong, or if the depths at this scale cannot be meters.
        """

    @staticmethod
    def from_points(points: npt.ArrayLike, camera: Camera, T_cp: npt.ArrayLike | None=None) -> DepthImage:
        """Projects the points of a depth sensor into a camera.

        A pixel has the depth of its nearest point, and is missing without points.
        `Observation(image, image.to_numpy() > 0, camera)` is the observation of a cloud that shows
        the object alone.

        Parameters
        ----------
        points : array_like, shape (N, 3), float32
            Points, meters. Those that are not finite or not in the image are skipped.
        camera : Camera
        T_cp : array_like, shape (4, 4), optional
            The pose of the points' frame, camera from points, meters. The default is the identity.

        Returns
        -------
        DepthImage

        Raises
        ------
        InputError
            If the depths cannot be meters, such as those of points in millimeters.

        Warns
        -----
        InputWarning
            If no point is in the image.
        """

    @property
    def width(self) -> int:
        """Image width, pixels."""

    @property
    def height(self) -> int:
        """Image height, pixels."""

    def to_numpy(self) -> npt.NDArray[np.float32]:
        """Returns a copy as an array.

        Returns
        -------
        numpy.ndarray, shape (H, W), float32
            Meters; 0 for pixels without a measurement.
        """

    def __getnewargs__(self) -> tuple[npt.NDArray[np.float32]]:
        ...

    def __eq__(self, value: object, /) -> bool:
        ...

    def __ne__(self, value: object, /) -> bool:
        ...

@final
class Model:
    """The model of an object: its mesh, surface samples, size and symmetries.

    Create one per object, because the samples are computed once. It is immutable, and threads can
    share it.

    Parameters
    ----------
    vertices : array_like, shape (V, 3)
        Coordinates in the object frame, in `unit`. They are stored as float32 meters.
    faces : array_like of int, shape (F, 3)
        Indices of the triangle corners, counter-clockwise seen from outside. Of more than 20,000
        faces, about 12,000 are rendered, unless their colors are compared with an image.
    unit : {"m", "mm", "cm"}, optional
        Unit of the vertices, of `diameter`, and of the offsets and translations of the symmetries.
    samples : int, optional
        Number of area-uniform surface samples. Searches and the confidence use them, too: with
        fewer than some hundred, poses that look alike are overlooked.
    diameter : float, optional
        The diameter that a dataset prescribes. The default is the largest distance between two
        vertices.
    symmetries : array_like, shape (N, 4, 4), optional
        Discrete symmetries: rigid motions of the object frame that do not change its appearance.
        List all of them but the identity: for a quarter turn, also the half and the three-quarter
        turn.
    symmetry_axes : array_like, shape (N, 2, 3), optional
        Continuous symmetries as pairs (axis, offset): any rotation around the line through the
        offset, in `unit`, along the axis.
    colors : array_like of uint8, shape (V, 3), optional
        Red, green and blue of each vertex, or textures as a tuple (images, indices, corners): a
        list of (H, W, 3) arrays of uint8, the image of each face, and its corners in the image,
        shape (F, 3, 2), from (0, 0) at the upper left to (1, 1) at the lower right.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid_icp import Model
    >>> plate = np.array([[-100, -100, 0], [100, -100, 0], [100, 100, 0], [-100, 100, 0]])
    >>> Model(plate, [[0, 2, 1], [0, 3, 2]], unit="mm")
    Model(4 vertices, 2 faces, diameter 0.2828 m)
    """

    def __new__(cls, vertices: npt.ArrayLike, faces: npt.ArrayLike, *, unit: _Unit='m', samples: int=1000, diameter: float | None=None, symmetries: npt.ArrayLike | None=None, symmetry_axes: _Axes=..., colors: npt.ArrayLike | _Textures | None=None) -> Model:
        ...

    @staticmethod
    def from_file(path: _Path, *, unit: _Unit, samples: int=1000, diameter: float | None=None, symmetries: npt.ArrayLike | None=None, symmetry_axes: _Axes=...) -> Model:
        """Reads a mesh and its colors from a GLB, glTF, OBJ, OFF, PLY or STL file.

        Colors that cannot be used are left out (`has_color`).

        Parameters
        ----------
        path : str or os.PathLike
            The file.
        unit : {"m", "mm", "cm"}
            Unit of its coordinates, which mesh files do not contain. BOP models are in "mm".
        samples, diameter, symmetries, symmetry_axes
            As for `Model`.

        Returns
        -------
        Model

        Raises
        ------
        FileError
            If the file cannot be read or has no mesh. The message names the place.
        """

    @staticmethod
    def from_bop(folder: _Path, obj_id: int) -> Model:
        """Reads a model of a BOP dataset, with its diameter and its symmetries.

        Parameters
        ----------
        folder : str or os.PathLike
            The dataset, or a folder of its models, such as `models_eval`. Without a
            `models_info.json` there, that of the folder `models` next to it is read.
        obj_id : int
            The number of the object.

        Returns
        -------
        Model

        Raises
        ------
        FileError
            If a file cannot be read, or there is no such model.
        """

    @staticmethod
    def from_trimesh(mesh: _HasMesh | _HasScene, *, unit: _Unit, samples: int=1000, diameter: float | None=None, symmetries: npt.ArrayLike | None=None, symmetry_axes: _Axes=...) -> Model:
        """Creates a model from a mesh of trimesh, or from anything with `vertices` and `faces`.

        The colors of its vertices or its texture are kept.

        Parameters
        ----------
        mesh : trimesh.Trimesh or trimesh.Scene
            The meshes of a scene are one object.
        unit : {"m", "mm", "cm"}
            Unit of its coordinates.
        samples, diameter, symmetries, symmetry_axes
            As for `Model`.

        Returns
        -------
        Model
        """

    @staticmethod
    def from_open3d(mesh: Any, *, unit: _Unit, samples: int=1000, diameter: float | None=None, symmetries: npt.ArrayLike | None=None, symmetry_axes: _Axes=...) -> Model:
        """Creates a model from a triangle mesh of Open3D.

        The colors of its vertices are kept, but no textures.

        Parameters
        ----------
        mesh : open3d.geometry.TriangleMesh
        unit : {"m", "mm", "cm"}
            Unit of its coordinates.
        samples, diameter, symmetries, symmetry_axes
            As for `Model`.

        Returns
        -------
        Model
        """

    def nearest_equivalent(self, T_co: npt.ArrayLike, reference: npt.ArrayLike) -> _Array:
        """Returns the pose that is equivalent by a declared symmetry and nearest to another pose.

        Parameters
        ----------
        T_co : array_like, shape (4, 4)
            Camera from object, meters.
        reference : array_like, shape (4, 4)
            Camera from object, meters, such as the pose in the previous image.

        Returns
        -------
        numpy.ndarray, shape (4, 4), float64
            Camera from object, meters.
        """

    @property
    def vertices(self) -> npt.NDArray[np.float32]:
        """The vertices, shape (V, 3), float32, meters, object frame."""

    @property
    def faces(self) -> npt.NDArray[np.uint32]:
        """The triangles as indices into `vertices`, shape (F, 3), uint32."""

    @property
    def has_color(self) -> bool:
        """True if the mesh has colors, of its vertices or as textures."""

    @property
    def diameter(self) -> float:
        """Largest distance between two vertices, or the prescribed diameter, meters."""

    @property
    def center(self) -> tuple[float, float, float]:
        """Center of the bounding box, meters, object frame."""

    @property
    def radius(self) -> float:
        """Largest distance of a vertex from `center`, meters."""

    def __getnewargs_ex__(self) -> tuple[tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]], dict[str, Any]]:
        ...

    def _repr_png_(self) -> bytes:
        ...

@final
class Observation:
    """A segmented depth image, for refining poses.

    It is immutable, and hypotheses and threads can share it. Each array is copied once, so later
    changes of the arrays have no effect. For several objects in one image, create one `DepthImage`
    and an observation per mask.

    Parameters
    ----------
    depth : DepthImage or numpy.ndarray, shape (H, W) or (H, W, 1)
        Depth along the optical axis: float32 (or float16 or float64) meters, or integers of 16 or
        more bits with `scale`. Pixels without a measurement are 0, negative, infinite or NaN, or
        65535 in uint16. A `DepthImage` is shared, not copied.
    mask : numpy.ndarray of bool or uint8, shape (H, W) or (H, W, 1), or None
        Nonzero on the object. `None` selects every pixel. Other integers must be 0 and 1, or 0 and
        255.
    camera : Camera
        A camera for images of this size.
    scale : float, optional
        Meters per unit of an image of integers, such as 0.001; BOP's `depth_scale` divided by 1000.
    color : numpy.ndarray of uint8, shape (H, W, 3), optional
        Red, green and blue of the same pixels. It decides where depth alone is ambiguous, with a
        model that has colors (`Model.has_color`). Only `Pipeline("color")`, custom pipelines with
        parts that compare colors, and `estimate` use it.
    normal_window : int, optional
        Half side of the window that normals are fitted over, from 1 (3 × 3 pixels) to 10. By
        default, it follows the noise of the image.

    Raises
    ------
    InputError
        If a shape, dtype or unit is wrong. The message has the value found and the one expected.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid_icp import Camera, Observation
    >>> camera = Camera(100, 100, 31.5, 23.5, 64, 48)
    >>> wall = np.full((48, 64), 0.8, np.float32)
    >>> Observation(wall, None, camera).n_measured
    3072
    >>> Observation(wall * 1000, None, camera)
    Traceback (most recent call last):
    ...
    hybrid_icp.InputError: depth looks like millimeters: median 800, expected meters (divide by
    1000, or pass uint16 with scale=0.001)
    """

    def __new__(cls, depth: DepthImage | _Depth, mask: _Mask | None, camera: Camera, *, scale: float | None=None, color: _Color | None=None, normal_window: int | None=None) -> Observation:
        ...

    @property
    def camera(self) -> Camera:
        """The camera."""

    @property
    def depth(self) -> npt.NDArray[np.float32]:
        """A copy of the depth image, shape (H, W), float32, meters; 0 for pixels without a
        measurement.
        """

    @property
    def image(self) -> DepthImage:
        """The depth image as a `DepthImage`, (H, W) meters, for observations with other masks.

        It is shared and not copied.
        """

    @property
    def mask(self) -> npt.NDArray[np.bool_]:
        """A copy of the mask, shape (H, W), bool."""

    @property
    def color(self) -> npt.NDArray[np.uint8] | None:
        """A copy of the colors of the pixels, shape (H, W, 3), uint8, or None if there are none."""

    @property
    def n_measured(self) -> int:
        """Number of masked pixels with a depth."""

    @property
    def n_surfels(self) -> int:
        """Number of masked pixels with a surfel (a point with a normal)."""

    def surfels(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Returns the points and normals of the masked surface, in the camera frame.

        Returns
        -------
        points : numpy.ndarray, shape (n_surfels, 3), float32
            Meters.
        normals : numpy.ndarray, shape (n_surfels, 3), float32
            Unit length, toward the camera.
        """

    @staticmethod
    def from_open3d(depth: Any, intrinsic: Any, mask: _Mask | None=None, *, scale: float=0.001, color: _Color | None=None) -> Observation:
        """Creates an observation from a depth image and an intrinsic calibration of Open3D.

        Parameters
        ----------
        depth : open3d.geometry.Image or open3d.geometry.RGBDImage
            Depth in integers of `scale` meters, or in floats of meters. The color of an `RGBDImage`
            is used if it has three channels.
        intrinsic : open3d.camera.PinholeCameraIntrinsic
        mask : array_like, shape (H, W), bool or uint8, optional
            Nonzero on the object. By default, every pixel.
        scale : float, optional
            Meters per unit of integers: one divided by the `depth_scale` of Open3D.
        color : open3d.geometry.Image or array_like, shape (H, W, 3), uint8, optional
            The color image of the same pixels.

        Returns
        -------
        Observation
        """

    def residuals(self, result: Result, *, model: Model | None=None) -> npt.NDArray[np.float32]:
        """Returns the measured minus the rendered depth at the pose of a result.

        Parameters
        ----------
        result : Result
        model : Model, optional
            By default, the model that was refined.

        Returns
        -------
        numpy.ndarray, shape (H, W), float32
            Meters; NaN where nothing was measured or rendered.
        """

    def __getnewargs_ex__(self) -> tuple[tuple[DepthImage, npt.NDArray[np.bool_], Camera], dict[str, Any]]:
        ...

    def _repr_png_(self) -> bytes:
        ...

@final
class Pipeline:
    """A refinement pipeline: the default, another preset, or a custom pipeline from a TOML file.

    `Pipeline()` is "auto", which suits most uses. `Pipeline.from_toml` reads a custom pipeline. A
    pipeline keeps scratch memory between calls. Threads can share it.

    Parameters
    ----------
    name : str, optional
        One of `Pipeline.presets()`. "local" refines the pose near its start. "search" and "auto"
        also search for the object: "search" unless the refined pose explains the image well, "auto"
        only if it explains the image badly. "color" is "auto" with the colors of the model and the
        observation, which the others use only in `estimate`. "hybrid" is Hybrid ICP as in the
        paper, and "hybrid-visible" is a variant of it.
    overrides : dict, or sequence of str, optional
        Fields to set, such as `{"threshold": 0.3}` of "auto" or `["times=3"]` of "hybrid".

    Raises
    ------
    InputError
        If there is no such preset or field. The message suggests similar names.

    Examples
    --------
    >>> from hybrid_icp import Pipeline
    >>> Pipeline()
    Pipeline('auto')
    >>> Pipeline(overrides={"threshold": 0.3}).name
    'auto threshold=0.3'
    >>> Pipeline("hybrid")
    Pipeline('hybrid')
    """

    def __new__(cls, name: str='auto', *, overrides: _Fields | None=None) -> Pipeline:
        ...

    @staticmethod
    def preset(name: str, *, overrides: _Fields | None=None) -> Pipeline:
        """Creates a pipeline by name, like `Pipeline(name)`.

        Parameters
        ----------
        name : str
            One of `Pipeline.presets()`.
        overrides : dict, or sequence of str, optional
            Fields to set, as for `Pipeline`.

        Returns
        -------
        Pipeline
        """

    @staticmethod
    def from_toml(text_or_path: _Path, *, overrides: _Fields | None=None) -> Pipeline:
        """Creates a pipeline from a TOML file or its text.

        Parameters
        ----------
        text_or_path : str or os.PathLike
            A path object, a string that ends with ".toml", or the text itself.
        overrides : dict, or sequence of str, optional
            Fields to set, as for `Pipeline`.

        Returns
        -------
        Pipeline

        Raises
        ------
        InputError
            If the text is not a valid pipeline. The message names the line, the field, the value
            found and the values expected.
        FileError
            If the file cannot be read.

        Examples
        --------
        >>> from hybrid_icp import Pipeline
        >>> Pipeline.from_toml('''
        ... type = "icp"
        ... selection = "visible-surface"
        ... association = "projective"
        ... metric = "point-to-plane"
        ... ''')
        Pipeline('text')
        """

    @staticmethod
    def icp(*, selection: _Part, association: _Part, metric: _Part, filter: Sequence[_Part] | None=None, stop: Sequence[_Part] | None=None) -> Pipeline:
        """Creates a pipeline of one ICP stage from its parts.

        A part is its name, or a dict with its name as "type" and its parameters. `parts` returns
        all of them.

        Parameters
        ----------
        selection, association, metric : str or dict
            The points to register, how they are paired, and the error to minimize.
        filter, stop : list of str or dict, optional
            Outlier filters and weights, and stop rules, in order.

        Returns
        -------
        Pipeline

        Examples
        --------
        >>> from hybrid_icp import Pipeline
        >>> Pipeline.icp(
        ...     selection="visible-surface",
        ...     association="projective",
        ...     metric="point-to-plane",
        ...     filter=[{"type": "max-distance", "limit": 0.25, "unit": "diameters"}],
        ... )
        Pipeline('icp')
        """

    @staticmethod
    def presets() -> list[str]:
        """Returns the names of the pipelines that ship with the library, Hybrid ICP first.

        Returns
        -------
        list of str
        """

    @property
    def name(self) -> str:
        """Name in reports: the name of the preset or file, followed by the overrides."""

    @property
    def toml(self) -> str:
        """The pipeline as TOML text, without the overrides."""

    def refine(self, model: Model, observation: Observation, T_co: npt.ArrayLike, observer: _Observer | None=None) -> Result:
        """Refines a pose.

        The result is deterministic. Data never causes an exception: without overlap, or with
        degenerate geometry, the result reports the reason. The call releases the GIL.

        Parameters
        ----------
        model : Model
            The object.
        observation : Observation
            The image.
        T_co : array_like, shape (4, 4)
            The initial pose, camera from object, meters.
        observer : callable or object, optional
            A callable receives an `IterationEvent` per iteration. An object can have any of the
            methods `on_iteration`, `on_regime`, `on_decision` and `on_stage_end`. If one of them
            returns `False`, the run stops at the last accepted pose. An exception stops the run
            and is raised again.

        Returns
        -------
        Result

        Raises
        ------
        InputError
            If the pose is not a rigid motion in meters.

        Warns
        -----
        InputWarning
            If the inputs do not fit together: the object is behind the camera, or at less than a
            third or more than three times the measured depth; the mask is empty, without depth, or
            has far more or fewer pixels than the object; or colors that the pipeline compares are
            missing.

        Examples
        --------
        A plate is 0.5 m in front of the camera, and the detector reports 0.54 m:

        >>> import numpy as np
        >>> from hybrid_icp import Camera, Model, Observation, Pipeline, render_depth
        >>> corners = [[-.1, -.1, 0], [.1, -.1, 0], [.1, .1, 0], [-.1, .1, 0]]
        >>> model = Model(corners, [[0, 2, 1], [0, 3, 2]])
        >>> camera = Camera(100, 100, 31.5, 31.5, 64, 64)
        >>> true = np.eye(4); true[2, 3] = 0.5
        >>> depth = render_depth(model, camera, true)
        >>> observation = Observation(depth, depth > 0, camera)
        >>> rough = np.eye(4); rough[2, 3] = 0.54
        >>> result = Pipeline().refine(model, observation, rough)
        >>> bool(abs(result.T_co[2, 3] - 0.5) < 1e-4)
        True
        """

    def estimate(self, model: Model, observation: Observation) -> Result:
        """Finds the pose of an object in its mask, without an initial pose.

        The pipeline refines the best poses that a search over all rotations finds. The result is
        deterministic. Data never causes an exception. The call releases the GIL.

        Parameters
        ----------
        model : Model
            The object.
        observation : Observation
            The image. Its mask shows one instance of the object.

        Returns
        -------
        Result
            Its `mve_initial` equals `mve`, because there is no initial pose. If no surface was
            measured inside the mask, `outcome` is "kept_initial" and `T_co` is the identity.

        Warns
        -----
        InputWarning
            As for `refine`, if the model does not fit the image at the measured depth. Any pipeline
            compares the colors of the observation.

        Examples
        --------
        A plate is 0.5 m in front of the camera:

        >>> import numpy as np
        >>> from hybrid_icp import Camera, Model, Observation, Pipeline, render_depth
        >>> corners = [[-.1, -.1, 0], [.1, -.1, 0], [.1, .1, 0], [-.1, .1, 0]]
        >>> model = Model(corners, [[0, 2, 1], [0, 3, 2]])
        >>> camera = Camera(100, 100, 31.5, 31.5, 64, 64)
        >>> true = np.eye(4); true[2, 3] = 0.5
        >>> depth = render_depth(model, camera, true)
        >>> result = Pipeline("local").estimate(model, Observation(depth, depth > 0, camera))
        >>> bool(result.mve < 0.1 and abs(result.T_co[2, 3] - 0.5) < 1e-3)
        True
        """

    def judge(self, model: Model, observation: Observation, T_co: npt.ArrayLike) -> Result:
        """Judges a pose as it is, for example a fused one or that of another library.

        The result has the scores, the confidence and the warnings of `estimate`: nothing is assumed
        about the way in which the pose was found. The call releases the GIL.

        Parameters
        ----------
        model : Model
            The object.
        observation : Observation
            The image. Its mask shows one instance of the object.
        T_co : array_like, shape (4, 4)
            The pose, camera from object, meters.

        Returns
        -------
        Result
            Its `T_co` is the given pose, and `outcome` is "kept_initial".

        Warns
        -----
        InputWarning
            As for `refine`, except for colors.
        """

    def refine_batch(self, model: Model, observation: Observation, T_co: npt.ArrayLike, threads: int | None=None) -> list[Result]:
        """Refines many poses of one object in one image, on several threads.

        The results have the bits of single calls of `refine`, for any number of threads. The call
        releases the GIL. Ctrl-C stops it.

        Parameters
        ----------
        model : Model
        observation : Observation
        T_co : array_like, shape (N, 4, 4)
            The initial poses, camera from object, meters.
        threads : int, optional
            Number of threads. The default is the number that the machine runs at once.

        Returns
        -------
        list of Result
            In the order of the poses.

        Warns
        -----
        InputWarning
            As for `refine`, if no pose fits the image.
        """

    def refine_many(self, items: Iterable[tuple[Model, Observation, npt.ArrayLike]], threads: int | None=None) -> list[Result]:
        """Refines poses of any objects in any images, on several threads.

        It reads at most two items per thread ahead, so images can be loaded on the way.

        Parameters
        ----------
        items : iterable of (Model, Observation, T_co)
            T_co has the shape (4, 4): camera from object, meters.
        threads : int, optional
            Number of threads. The default is the number that the machine runs at once.

        Returns
        -------
        list of Result
            In the order of the items, with the bits of single calls of `refine`.

        Raises
        ------
        InputError
            As for `refine`, with the index of the item. The remaining items are not refined.
        """

    def __reduce__(self) -> tuple[Callable[[str, str, list[str]], Pipeline], tuple[str, str, list[str]]]:
        ...

    @staticmethod
    def _restore(origin: str, toml: str, overrides: Sequence[str]) -> Pipeline:
        ...

@final
class PoseEstimate:
    """An estimate of the pose of an object, with its covariance and, if known, its MVE.

    Parameters
    ----------
    T_co : array_like, shape (4, 4)
        Camera from object, meters.
    covariance : array_like, shape (6, 6)
        Covariance of ξ = [ρ; φ], a left perturbation in the camera frame, translation first
        (meters, radians). It may be singular.
    mve : float, optional
        Mean VSD estimate, 0 to 1.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid_icp import PoseEstimate
    >>> PoseEstimate(np.eye(4), np.eye(6) * 1e-4, mve=0.1).mve
    0.1
    """

    def __new__(cls, T_co: npt.ArrayLike, covariance: npt.ArrayLike, *, mve: float | None=None) -> PoseEstimate:
        ...

    @staticmethod
    def from_result(result: Result, model: Model) -> PoseEstimate:
        """Creates the estimate of a refined pose, with a covariance about as wide as the error.

        The covariance of a result accounts for the noise of its pixels alone. This one has the
        factors of `SequentialEstimator(…, covariance="calibrated")`, and a wrong pose with a high
        MVE gets little weight. If `result.covariance` is None, as of a can, it is that of a nearly
        unknown pose (0.3 radii, 0.3 rad): use `SequentialEstimator` there. It leaves out the
        error of the mesh, which fusion does not average out.

        Parameters
        ----------
        result : Result
        model : Model

        Returns
        -------
        PoseEstimate
        """

    @property
    def T_co(self) -> _Array:
        """The pose, camera from object, shape (4, 4), float64, meters."""

    @property
    def covariance(self) -> _Array:
        """The covariance of ξ = [ρ; φ], shape (6, 6), float64, m², m·rad and rad²."""

    @property
    def mve(self) -> float | None:
        """The mean VSD estimate, if known."""

    def mahalanobis_squared(self, other: PoseEstimate) -> float:
        """Returns the squared Mahalanobis distance of two independent estimates of one pose.

        It follows χ² with 6 degrees of freedom if both covariances are right and small.

        Parameters
        ----------
        other : PoseEstimate

        Returns
        -------
        float
        """

    def __getnewargs_ex__(self) -> tuple[tuple[_Array, _Array], dict[str, float | None]]:
        ...

@final
class Fuser:
    """Fuses pose estimates while the camera moves (§V of the paper).

    The fused estimate is in the current camera frame.

    Parameters
    ----------
    method : str
        One of `Fuser.methods()`.
    model : Model, optional
        With a model, one unit of uncertainty is the radius of the object and 1 rad around its
        center, and symmetric poses are fused as one. Without, it is 1 m and 1 rad around the
        camera.
    max_mve, max_mahalanobis_squared : float, optional
        The gate. Estimates above one of these limits are rejected.
    restart_after : int, optional
        Number of consecutive estimates above `max_mahalanobis_squared` that agree with each other,
        after which the fuser starts again. Without that limit, it has no effect.
    window : int, optional
        Maximum number of estimates that "average" and "weighted-average" keep, the newest ones.
    transport : {"adjoint", "kept"}, optional
        "adjoint" transforms covariances with the camera motion, "kept" does not.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid_icp import Fuser, PoseEstimate
    >>> fuser = Fuser("average")
    >>> fuser.update(PoseEstimate(np.eye(4), np.eye(6) * 1e-4))
    'accepted'
    >>> advance = np.eye(4); advance[2, 3] = -0.1
    >>> fuser.propagate(advance)
    >>> float(fuser.estimate.T_co[2, 3])
    -0.1
    """

    def __new__(cls, method: str, *, model: Model | None=None, max_mve: float | None=None, max_mahalanobis_squared: float | None=None, restart_after: int | None=None, window: int | None=None, transport: Literal['adjoint', 'kept']='adjoint') -> Fuser:
        ...

    @staticmethod
    def methods() -> list[str]:
        """Returns the names of the methods, in the order of the paper.

        Returns
        -------
        list of str
        """

    def propagate(self, T_nc: npt.ArrayLike, covariance: npt.ArrayLike | None=None) -> None:
        """Moves the fused estimate to the next camera frame.

        Parameters
        ----------
        T_nc : array_like, shape (4, 4)
            Next camera from camera, meters.
        covariance : array_like, shape (6, 6), optional
            Covariance of the motion, as a left perturbation in the next camera frame. By default,
            the motion is exact.
        """

    def update(self, estimate: PoseEstimate) -> Literal['accepted', 'provisional', 'rejected', 'restarted']:
        """Adds an estimate in the current camera frame.

        Parameters
        ----------
        estimate : PoseEstimate

        Returns
        -------
        str
            "accepted", "rejected" or "restarted"; "provisional" if it failed the gate but there is
            no other estimate.
        """

    @property
    def estimate(self) -> PoseEstimate | None:
        """The fused estimate in the current camera frame; None before the first estimate."""

    def reset(self) -> None:
        """Removes all estimates."""

@final
class SequentialEstimator:
    """Estimates the pose of a static object from the images of a moving camera (§V of the paper).

    Each image is registered from the fused pose, moved with the camera. The registered pose is then
    fused, and the next image starts from the result. While all images have failed a limit
    ("provisional"), the next one is also registered from the initial pose.

    Parameters
    ----------
    pipeline : Pipeline
        The pipeline that registers each image.
    method : str
        The fusion method, one of `Fuser.methods()`.
    model : Model
    T_co : array_like, shape (4, 4)
        The initial pose in the first camera frame, camera from object, meters.
    paper : bool, optional
        If true, follows §V exactly: no gate, and covariances e_MVE·I₆ that do not move with the
        camera. Otherwise uncertainty refers to the center of the object, estimates with an MVE
        above 0.4 are rejected, and symmetric poses are fused as one.
    covariance : {"mve", "calibrated"}, optional
        Covariance of the estimates. "calibrated" is the default, unless `paper` is true, which
        requires "mve". It is about as wide as the errors: the covariance of the registration, with
        factors that were fitted to "hybrid" and to models reconstructed from images. It also
        rejects estimates with an MVE above 0.25, and those whose squared Mahalanobis distance from
        the fused pose is above 100. The distance allows for a camera that is off by 1 mm and 0.11°
        along and around each axis. After three such estimates that agree with each other, it starts
        again from the last. "mve" is a weight: the MVE in units of the object. It is not
        calibrated, so do not use it as an error.
        `bop sequence` names them `--uncertainty registration` and `--uncertainty mve`.
    """

    def __new__(cls, pipeline: Pipeline, method: str, model: Model, T_co: npt.ArrayLike, *, paper: bool=False, covariance: Literal['mve', 'calibrated'] | None=None) -> SequentialEstimator:
        ...

    def step(self, observation: Observation, T_nc: npt.ArrayLike | None=None, covariance: npt.ArrayLike | None=None) -> SequentialStep:
        """Registers and fuses an image, after a motion of the camera since the previous image.

        Parameters
        ----------
        observation : Observation
        T_nc : array_like, shape (4, 4), optional
            Camera of this image from the camera of the previous image, meters. By default, the
            camera did not move.
        covariance : array_like, shape (6, 6), optional
            Covariance of the motion, as a left perturbation in the camera frame of this image.

        Returns
        -------
        SequentialStep

        Warns
        -----
        InputWarning
            As for `Pipeline.refine`, while there is no estimate. If the images contradict `T_nc`:
            the event is "restarted", or two or more images, and as many as were accepted, do not
            show the object at the pose that moved with the camera. If a filter makes this warning
            an error, the step has been taken: `T_co` has its pose.
        """

    def move_camera(self, T_nc: npt.ArrayLike, covariance: npt.ArrayLike | None=None) -> None:
        """Moves the camera without an image.

        Parameters
        ----------
        T_nc : array_like, shape (4, 4)
            Next camera from camera, meters.
        covariance : array_like, shape (6, 6), optional
            Covariance of the motion.
        """

    def restart(self, T_co: npt.ArrayLike) -> None:
        """Removes all estimates and starts again from a pose in the current camera frame.

        Parameters
        ----------
        T_co : array_like, shape (4, 4)
            Camera from object, meters.
        """

    @property
    def T_co(self) -> _Array:
        """The fused pose in the current camera frame, shape (4, 4), float64, meters; the initial pose
        while there is no estimate.
        """

    @property
    def estimate(self) -> PoseEstimate | None:
        """The fused estimate in the current camera frame; None before the first estimate."""

@final
class Tracker:
    """Tracks a moving object from depth image to depth image, without masks.

    The pose is predicted at constant velocity, and refined in the pixels around the predicted
    silhouette. Neither the object nor the camera has to stand still. A lost object is searched
    around its last place.

    Parameters
    ----------
    model : Model
    camera : Camera
        The camera of all images.
    T_co : array_like, shape (4, 4)
        The rough pose in the first image, camera from object, meters.
    meters_per_second : float, optional
        Typical speed of the object relative to the camera, m/s. An object that leaves the image
        faster is rarely found again.
    degrees_per_second : float, optional
        Typical angular speed, degrees per second.
    memory_seconds : float, optional
        The time in which the object changes its velocity, seconds.
    coast_seconds : float, optional
        The time for which an object that is not seen stays "doubtful" before it is "lost", seconds.

    Warns
    -----
    InputWarning
        If the rough pose puts the object behind the camera.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid_icp import Camera, Model, Tracker, render_depth
    >>> corners = np.array([[0, 0, 0], [.1, 0, 0], [0, .08, 0], [0, 0, .06]])
    >>> model = Model(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> camera = Camera(285, 285, 159.5, 119.5, 320, 240)
    >>> pose = np.eye(4)
    >>> pose[2, 3] = 0.5
    >>> tracker = Tracker(model, camera, pose)
    >>> for frame in range(3):
    ...     pose[0, 3] += 0.004
    ...     depth = render_depth(model, camera, pose)
    ...     depth[depth == 0] = 0.8  # The wall behind.
    ...     tracked = tracker.step(depth, 1 / 30)
    >>> bool(np.allclose(tracked.T_co, pose, atol=0.005))
    True
    """

    def __new__(cls, model: Model, camera: Camera, T_co: npt.ArrayLike, *, meters_per_second: float=0.3, degrees_per_second: float=90.0, memory_seconds: float=0.5, coast_seconds: float=0.1) -> Tracker:
        ...

    def step(self, depth: DepthImage | _Depth, seconds: float, mask: _Mask | None=None, *, scale: float | None=None) -> Tracked:
        """Tracks the object in the next image.

        Parameters
        ----------
        depth : DepthImage or numpy.ndarray, shape (H, W) or (H, W, 1)
            In meters, as for `Observation`, in the size of the camera.
        seconds : float
            Time since the previous image, not a time stamp, also if images in between are missing:
            0 for an image of the same instant, at most 10. After a longer pause, restart the
            tracker.
        mask : numpy.ndarray, shape (H, W), optional
            Pixels to which the object is restricted. Not needed. It may be passed for some images
            only, for example to find a lost object by a segmentation.
        scale : float, optional
            Meters per unit of an image of integers.

        Returns
        -------
        Tracked

        Raises
        ------
        InputError
            If the sizes of the image, the mask and the camera differ, or `seconds` is no such time.
        """

    def restart(self, T_co: npt.ArrayLike) -> None:
        """Starts again from a rough pose in the next image.

        Parameters
        ----------
        T_co : array_like, shape (4, 4)
            Camera from object, meters.
        """

def align(source: _Points, target: _Points, T_ts: npt.ArrayLike | None=None, *, source_normals: npt.ArrayLike | None=None, target_normals: npt.ArrayLike | None=None, method: Literal['point-to-plane', 'point-to-point', 'gicp']='gicp', max_distance: float | None=None, voxel: float | None=None, neighbors: int=20) -> Alignment:
    """Registers two point clouds: finds the pose that moves the source onto the target.

    Points that are not finite or at exactly (0, 0, 0) are skipped. Absent normals are estimated if
    the method needs them. Warnings in the result report both. Ctrl-C stops the call.

    Fitness and RMSE do not prove the pose: a can slides around its axis, and a box on its wrong
    side can fit better than the truth. Start from a rough pose, and read the warning about
    directions that the clouds do not determine.

    Parameters
    ----------
    source, target : array_like, shape (N, 3), float32
        Points, meters. A point cloud of Open3D, or the pair that `read_cloud` returns, is accepted
        with its normals.
    T_ts : array_like, shape (4, 4), optional
        The rough pose, target from source, meters. The default is the identity. A translation
        above 100 m is probably in millimeters, and causes a warning.
    source_normals, target_normals : array_like, shape (N, 3), float32, optional
        One normal per point, of any length above 0. Points whose normal is zero are skipped, except
        for targets of "point-to-point".
    method : {"gicp", "point-to-plane", "point-to-point"}, optional
        The error to minimize. "gicp" ends at fewer wrong poses without a warning, and
        "point-to-plane" is a little faster.
    max_distance : float, optional
        Largest distance of a pair, meters. The default is a tenth of the diameter of the source,
        then a fiftieth.
    voxel : float, optional
        Edge of the cubic cells in which points are replaced by their mean first, meters.
    neighbors : int, optional
        Number of neighbors from which normals are estimated, at least 3.

    Returns
    -------
    Alignment
        The pose and how well the clouds fit.
    """

def add(T_est: npt.ArrayLike, T_gt: npt.ArrayLike, model: Model) -> float:
    """Computes ADD, the mean distance between corresponding model points at two poses.

    Parameters
    ----------
    T_est, T_gt : array_like, shape (4, 4)
        The estimated and the true pose, camera from object, meters.
    model : Model
        Its vertices are used.

    Returns
    -------
    float
        Meters.
    """

def adi(T_est: npt.ArrayLike, T_gt: npt.ArrayLike, model: Model) -> float:
    """Computes ADI (ADD-S), the mean distance between closest model points at two poses.

    For each model point at the true pose, it uses the closest model point at the estimate.

    Parameters
    ----------
    T_est, T_gt : array_like, shape (4, 4)
        The estimated and the true pose, camera from object, meters.
    model : Model
        Its vertices are used.

    Returns
    -------
    float
        Meters.
    """

def mssd(T_est: npt.ArrayLike, T_gt: npt.ArrayLike, model: Model) -> float:
    """Computes MSSD, the maximum symmetry-aware surface distance of BOP.

    Parameters
    ----------
    T_est, T_gt : array_like, shape (4, 4)
        The estimated and the true pose, camera from object, meters.
    model : Model
        Its vertices and declared symmetries are used.

    Returns
    -------
    float
        Meters.
    """

def mspd(T_est: npt.ArrayLike, T_gt: npt.ArrayLike, model: Model, camera: Camera) -> float:
    """Computes MSPD, the maximum symmetry-aware projection distance of BOP.

    Parameters
    ----------
    T_est, T_gt : array_like, shape (4, 4)
        The estimated and the true pose, camera from object, meters.
    model : Model
        Its vertices and declared symmetries are used.
    camera : Camera

    Returns
    -------
    float
        Pixels; infinite if a point is not in front of the camera.
    """

def vsd(model: Model, observation: Observation, T_est: npt.ArrayLike, T_gt: npt.ArrayLike, *, delta: float=...) -> _Array:
    """Computes the visible surface discrepancy (VSD) of BOP'19 between an estimated and a true pose.

    Parameters
    ----------
    model : Model
    observation : Observation
        Only its depth image and camera are used, not its mask.
    T_est, T_gt : array_like, shape (4, 4)
        The estimated and the true pose, camera from object, meters.
    delta : float, optional
        Visibility tolerance, meters, 0.015 if not given.

    Returns
    -------
    numpy.ndarray, shape (10,), float64
        e_VSD for τ = 5 %, 10 %, …, 50 % of the diameter; 1 if neither render has a visible pixel.
    """

def diagnose(model: Model, observation: Observation, T_co: npt.ArrayLike) -> Diagnosis:
    """Names what is wrong with the inputs of `Pipeline.refine`, and the fix.

    Each fault that inputs can have is corrected on trial, and a short refinement scores the
    corrected inputs. A fault is named if its correction improves the score clearly. The initial
    pose may be off by some millimeters and degrees, as those of detectors are. Two faults at once
    are often not found: correct one, and diagnose again. Like `hybrid-icp doctor`, but without the
    faults of files, such as a label image as the mask.

    It takes about as long as 10 refinements, and releases the GIL.

    Parameters
    ----------
    model : Model
        The object.
    observation : Observation
        The image. Its mask shows the object alone: in a box, other objects hide the fault.
    T_co : array_like, shape (4, 4)
        The initial pose, camera from object, meters. Any length of its translation is accepted.

    Returns
    -------
    Diagnosis
        The faults, the most probable one first.

    Raises
    ------
    InputError
        If the pose is not a rigid motion.

    Warns
    -----
    InputWarning
        If no fault is found, but the inputs do not fit together (`Pipeline.refine`).

    Examples
    --------
    A plate is 0.5 m in front of the camera, but its depth was read at ten times its scale:

    >>> import numpy as np
    >>> from hybrid_icp import Camera, Model, Observation, diagnose, render_depth
    >>> corners = [[-.1, -.1, 0], [.1, -.1, 0], [.1, .1, 0], [-.1, .1, 0]]
    >>> model = Model(corners, [[0, 2, 1], [0, 3, 2]])
    >>> camera = Camera(100, 100, 31.5, 31.5, 64, 64)
    >>> true = np.eye(4); true[2, 3] = 0.5
    >>> depth = render_depth(model, camera, true)
    >>> observation = Observation(10 * depth, depth > 0, camera)
    >>> rough = np.eye(4); rough[2, 3] = 0.503
    >>> diagnosis = diagnose(model, observation, rough)
    >>> diagnosis.faults[0].problem, diagnosis.faults[0].fix
    ('the depth is 10 times too large', 'multiply the depth by 0.1')
    """

def mve(model: Model, observation: Observation, T_co: npt.ArrayLike, *, occlusion_tolerance: float | None=..., imperfect_mask: bool=...) -> float:
    """Computes the mean VSD estimate (MVE) of a pose, which needs no ground truth.

    It is 0 if the pose explains the image everywhere, and 1 if it explains the image nowhere.

    Parameters
    ----------
    model : Model
    observation : Observation
    T_co : array_like, shape (4, 4)
        Camera from object, meters.
    occlusion_tolerance : float or None, optional
        Rendered pixels outside the mask do not count if the measured surface hides them by more
        than this distance, meters, 0.015 if not given. With a negative value, the measured surface
        can also be that far behind, for masks that miss a part of the object. `None` is the
        definition of the paper: every rendered pixel counts.
    imperfect_mask : bool, optional
        Expects the mask of a detector: too large, too small, soft, or a box. `occlusion_tolerance`
        then has no effect.

    Returns
    -------
    float
        The mean over τ = 5 %, …, 50 % of the diameter.
    """

def run_program(words: Sequence[str]) -> int:
    """Runs the program with the words of its command line, and returns the exit code."""

def mask_in_box(bbox: npt.ArrayLike, camera: Camera) -> npt.NDArray[np.bool_]:
    """Returns the mask of a box, for a detector without a segmentation.

    The presets `local`, `search`, `auto` and `color`, and `estimate`, give no weight to a table in
    the box. `hybrid`, `hybrid-visible` and the baselines treat it as part of the object.

    Parameters
    ----------
    bbox : array_like, shape (4,)
        x and y of the left upper corner, width and height, pixels. A box of two corners
        (x1, y1, x2, y2) is (x1, y1, x2 - x1, y2 - y1).
    camera : Camera
        The camera of the image, which has its size.

    Returns
    -------
    numpy.ndarray, shape (H, W), bool
        The mask, for `Observation`.

    Raises
    ------
    InputError
        If `bbox` does not have four numbers, or the box has no pixel in the image.

    Warns
    -----
    InputWarning
        If `bbox` looks like two corners, or like fractions of the image.

    Examples
    --------
    >>> from hybrid_icp import Camera, mask_in_box
    >>> camera = Camera(100, 100, 31.5, 31.5, 64, 64)
    >>> int(mask_in_box((20, 20, 25, 30), camera).sum())
    750
    """

def render_depth(model: Model, camera: Camera, T_co: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """Renders the depth of a model at a pose.

    Parameters
    ----------
    model : Model
    camera : Camera
    T_co : array_like, shape (4, 4)
        Camera from object, meters.

    Returns
    -------
    numpy.ndarray, shape (H, W), float32
        Depth along the optical axis, meters; 0 for pixels that the model does not cover.
    """

def fuse(estimates: Sequence[PoseEstimate]) -> PoseEstimate:
    """Fuses estimates of one pose, in one camera frame (Barfoot & Furgale 2014).

    Parameters
    ----------
    estimates : sequence of PoseEstimate
        One or more.

    Returns
    -------
    PoseEstimate

    Examples
    --------
    Two estimates differ by 2 mm, and the second has twice the standard deviation:

    >>> import numpy as np
    >>> from hybrid_icp import PoseEstimate, fuse
    >>> other = np.eye(4); other[2, 3] = 0.002
    >>> first = PoseEstimate(np.eye(4), np.eye(6) * 1e-6)
    >>> fused = fuse([first, PoseEstimate(other, np.eye(6) * 4e-6)])
    >>> round(float(fused.T_co[2, 3]), 9)
    0.0004
    """

def parts() -> list[dict[str, Any]]:
    """Returns the parts of which pipelines are made, with their parameters.

    Returns
    -------
    list of dict
        The keys `kind` (such as "metric"), `type` (the name in pipelines), `about` and
        `parameters`: a list of dicts with `name`, `accepts`, `default` (None if the parameter is
        required), `unit` and `meaning`.

    Examples
    --------
    >>> from hybrid_icp import parts
    >>> [part["type"] for part in parts() if part["kind"] == "metric"][:2]
    ['point-to-point', 'point-to-plane']
    """

def point_to_point_step(sources: npt.ArrayLike, targets: npt.ArrayLike) -> tuple[_Array, float]:
    """Computes one step of point-to-point ICP on given pairs.

    The step is the rigid motion that minimizes Σ|T pᵢ − cᵢ|² (Kabsch).
    Of the steps that fit pairs on a line equally well, it has the smallest rotation.

    Parameters
    ----------
    sources : array_like, shape (N, 3)
        Model points pᵢ in the camera frame, read as float32, meters.
    targets : array_like, shape (N, 3)
        The observed points cᵢ of the pairs, meters.

    Returns
    -------
    increment : numpy.ndarray, shape (4, 4), float64
        T, meters. It multiplies the pose from the left.
    mean_loss : float
        Mean of |pᵢ − cᵢ|² before the step, m².

    Raises
    ------
    InputError
        If there are fewer than three pairs, numbers that are not finite, or different numbers of
        sources and targets.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid_icp import point_to_point_step
    >>> corners = np.eye(3)
    >>> increment, loss = point_to_point_step(corners, corners + [0, 0, 0.5])
    >>> np.round(increment[:3, 3], 6) + 0.0
    array([0. , 0. , 0.5])
    """

def point_to_plane_step(sources: npt.ArrayLike, targets: npt.ArrayLike, normals: npt.ArrayLike) -> tuple[_Array, float]:
    """Computes one step of point-to-plane ICP on given pairs.

    The step is a Gauss–Newton step on Σ(nᵢ·(T pᵢ − cᵢ))².
    Directions that the normals do not determine are damped, so they hardly move.

    Parameters
    ----------
    sources : array_like, shape (N, 3)
        Model points pᵢ in the camera frame, read as float32, meters.
    targets : array_like, shape (N, 3)
        The observed points cᵢ of the pairs, meters.
    normals : array_like, shape (N, 3)
        The observed normals nᵢ of the pairs. They are normalized to unit length.

    Returns
    -------
    increment : numpy.ndarray, shape (4, 4), float64
        T = exp(ξ^) of the linear least-squares solution ξ, meters. It multiplies the pose from the
        left.
    mean_loss : float
        Mean of (nᵢ·(pᵢ − cᵢ))² before the step, m².

    Raises
    ------
    InputError
        If there are fewer than six pairs, numbers that are not finite, normals of length 0, or
        different numbers of rows.
    """

def read_cloud(path: _Path, unit: _Unit='m') -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32] | None]:
    """Reads a point cloud in meters, from a file of any supported format.

    PLY, PCD, XYZ, CSV, NPY and NPZ files are recognized by their first bytes.

    Parameters
    ----------
    path : str or os.PathLike
    unit : {"m", "mm", "cm"}, optional
        Unit of the coordinates in the file.

    Returns
    -------
    points : numpy.ndarray, shape (N, 3), float32
        Points, meters. Those that are not finite are left out, and those without a normal if others
        have one.
    normals : numpy.ndarray, shape (N, 3), float32, or None
        Their normals, if the file has them.

    Raises
    ------
    FileError
        If the file is malformed, or not a point cloud.
    """

def read_depth(path: _Path, *, scale: float | None=None) -> npt.NDArray[np.float32]:
    """Reads a depth image as an array of meters, from a file of any supported format.

    PNG, TIFF, NPY, NPZ, EXR, PGM and PFM files are recognized by their first bytes.

    Parameters
    ----------
    path : str or os.PathLike
    scale : float, optional
        Meters per unit, such as 0.001 for integers of millimeters. Floating point is in meters if
        not given.

    Returns
    -------
    numpy.ndarray, shape (H, W), float32
        Meters; 0 for pixels without a measurement.

    Raises
    ------
    FileError
        If the file cannot be read, is not such an image, or has integers and `scale` is missing.
    InputError
        If `scale` is wrong, or if the depths at this scale cannot be meters.
    """

def read_depth_png(path: _Path, scale: float) -> npt.NDArray[np.float32]:
    """Reads a 16-bit gray PNG as an array of meters.

    Parameters
    ----------
    path : str or os.PathLike
    scale : float
        Meters per unit, such as 0.001; BOP's `depth_scale` divided by 1000.

    Returns
    -------
    numpy.ndarray, shape (H, W), float32
        Meters; 0 for pixels without a measurement.
    """

def read_mask(path: _Path, *, threshold: float | None=None, value: float | None=None) -> npt.NDArray[np.bool_]:
    """Reads a mask from a file of any supported format.

    PNG, TIFF, BMP, NPY, NPZ and PGM files are recognized by their first bytes. If the opacity of an
    image varies, it is the value of its pixels.

    Parameters
    ----------
    path : str or os.PathLike
    threshold : float, optional
        Smallest value on the object, such as 128 or 0.5. For soft masks and probabilities.
    value : float, optional
        Value on the object, such as 3. For label images.

    Returns
    -------
    numpy.ndarray, shape (H, W), bool
        Without `threshold` and `value`: the pixels that are not 0, and with a PNG or BMP palette
        those that are neither black nor transparent.

    Raises
    ------
    FileError
        If the file cannot be read, is not such an image, or has no pixel of the stated value.
    InputError
        If both `threshold` and `value` are passed.

    Warns
    -----
    InputWarning
        If neither is passed, and the file has more than two values.
    """

def read_mask_png(path: _Path) -> npt.NDArray[np.bool_]:
    """Reads a mask from a PNG that is nonzero on the object.

    Parameters
    ----------
    path : str or os.PathLike

    Returns
    -------
    numpy.ndarray, shape (H, W), bool
    """

def read_pose(path: _Path, *, unit: _Unit | None=None) -> _Array:
    """Reads a pose from a JSON, YAML, XML, text, NPY or NPZ file.

    The file has a 4x4 or 3x4 matrix, BOP's `cam_R_m2c` and `cam_t_m2c`, a rotation and a
    translation, a translation and a quaternion of stated order or an `rvec`, or a TUM line.

    Parameters
    ----------
    path : str or os.PathLike
    unit : {"m", "mm", "cm"}, optional
        Unit of the translation. If not given, "mm" for `cam_t_m2c` and "m" for all other forms.

    Returns
    -------
    numpy.ndarray, shape (4, 4), float64
        The pose, meters.

    Raises
    ------
    FileError
        If the file cannot be read or has no such pose.
    """

def read_images(results: _Path, *, limit: int | None=None) -> list[tuple[int, int, list[int], str]]:
    """Reads a result file and groups its rows by image, in the order of scene and image.

    Parameters
    ----------
    results : str or os.PathLike
        The result file: CSV with scene_id, im_id, obj_id, score, R, t (mm) and time.
    limit : int, optional
        Read only the first rows.

    Returns
    -------
    list of (int, int, list of int, str)
        Scene, image, indices of its rows in the file, and those rows as CSV with a header.
    """

def result_header() -> str:
    """Returns the first line of a result file, without the line end.

    Returns
    -------
    str
    """

@final
class DatasetRefiner:
    """Refines the rows of result files image by image, like `hybrid-icp bop refine`.

    It reads the models of the dataset once. It has no threads and writes no files.

    Parameters
    ----------
    dataset : str or os.PathLike
        The folder of the dataset, with models/ and the folder of the split.
    split : str
        The folder of the split, such as "test".
    pipeline : Pipeline
    objects : sequence of int
        Ids of the objects whose models the constructor reads.
    detections : str or os.PathLike, optional
        Use the masks of a detections file instead of mask_visib.
    mask : {"visible", "none"}, optional
        Without detections: mask_visib, or all measured points in a box around the pose of each row.
    models : str or os.PathLike, optional
        Another folder of meshes: one of the dataset, such as "models_color", or a path. Diameters
        and symmetries are still those of models/models_info.json.
    color : bool, optional
        Use the colors of the meshes and the images in rgb/ if both exist.
    sensor : str, optional
        The sensor of scenes with several: "cam1" for scene_camera_cam1.json and depth_cam1/.
    rescore : {"keep", "mve", "confidence"}, optional
        The score of a row: its old score, 1 − MVE, or its confidence. With the last two, a row
        that did not reach the pipeline has the score 0.
    """

    def __new__(cls, dataset: _Path, split: str, pipeline: Pipeline, objects: Sequence[int], *, detections: _Path | None=None, mask: Literal['visible', 'none']='visible', models: _Path | None=None, color: bool=True, sensor: str | None=None, rescore: Literal['keep', 'mve', 'confidence']='keep') -> DatasetRefiner:
        ...

    def refine(self, rows: str) -> tuple[list[str], list[str], list[str]]:
        """Refines the rows of one image.

        Rows that cannot be refined keep their poses. The time column is -1, so that equal input
        gives equal bytes.

        Parameters
        ----------
        rows : str
            CSV with a header, as `read_images` returns it.

        Returns
        -------
        lines : list of str
            The refined rows in the same order, without line ends.
        statuses : list of str
            The status of each row.
        faults : list of str
            The damaged files.
        """

    @property
    def broken_models(self) -> dict[int, str]:
        """The faults of models, as a dict from object id to message. Rows of these objects keep their
        poses.
        """

    @property
    def missing_models(self) -> list[int]:
        """Ids of the objects without a model in the dataset."""
