"""Results and events: what the native module returns."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ._native import Model, Observation

_Array = npt.NDArray[np.float64]
_Outcome = Literal["refined", "kept_initial"]


def _plain(value: Any) -> Any:
    """Returns a value as `json.dumps` accepts it."""
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return value.to_dict() if isinstance(value, _Record) else value


class _Record:
    """A result that can be written as JSON. Its arrays are read-only."""

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.__post_init__()

    def to_dict(self) -> dict[str, Any]:
        """Returns all attributes but a model as plain Python values that `json.dumps` accepts.

        Returns
        -------
        dict
            The attributes by name; matrices as nested lists, and NaN as None.
        """
        return {key: _plain(value) for key, value in vars(self).items() if key != "model"}


def _translation(T: _Array) -> str:
    x, y, z = T[:3, 3]
    return f"({x:.4f}, {y:.4f}, {z:.4f})"


@dataclass(frozen=True, eq=False, repr=False)
class IterationEvent:
    """One iteration, with the pose that was evaluated.

    Attributes
    ----------
    iteration : int
        Iteration within the stage, from 0.
    T_co : numpy.ndarray, shape (4, 4), float64
        The pose evaluated, camera from object, meters.
    increment : numpy.ndarray, shape (4, 4), float64
        The increment found at that pose, meters. The next pose is `increment @ T_co`.
    n_pairs : int
        Number of pairs after filtering.
    mean_loss : float
        Weighted mean of the metric's squared residuals, m².
    """

    iteration: int
    T_co: _Array
    increment: _Array
    n_pairs: int
    mean_loss: float

    def __repr__(self) -> str:
        loss = f"mean loss {self.mean_loss:.3e} m²"
        return f"IterationEvent(iteration {self.iteration}, {self.n_pairs} pairs, {loss})"


@dataclass(frozen=True, repr=False)
class RegimeEvent:
    """A switcher's choice.

    Attributes
    ----------
    regime : str
        The selected branch: "aligned", "misaligned" or "regime-N".
    score : float or None
        The score that decided, if there is one.
    """

    regime: str
    score: float | None

    def __repr__(self) -> str:
        score = "" if self.score is None else f", score {self.score:.3f}"
        return f"RegimeEvent({self.regime}{score})"


@dataclass(frozen=True, eq=False, repr=False)
class DecisionEvent:
    """The decision of a stage whether it keeps a pose that it scored.

    Attributes
    ----------
    stage : str
        Name of the stage: "guard", "keep-best", "alternate" or "hypothesis-search".
    T_co : numpy.ndarray, shape (4, 4), float64
        The scored pose, camera from object, meters.
    score : float
        Its score; lower is better.
    best : float
        The score of the best pose before it; infinity if there was none.
    kept : bool
        True if the stage keeps the pose, False if it rejects it.
    """

    stage: str
    T_co: _Array
    score: float
    best: float
    kept: bool

    def __repr__(self) -> str:
        verb = "keeps" if self.kept else "rejects"
        return f"DecisionEvent({self.stage} {verb} {self.score:.3f} after {self.best:.3f})"


@dataclass(frozen=True, eq=False, repr=False)
class StageEvent(_Record):
    """An ICP stage that ended.

    Attributes
    ----------
    regime : str or None
        The branch that the switcher selected, if this is the first stage after a choice. Always
        None in an observer.
    regime_mve : float or None
        The MVE for which it was selected.
    selection, association, metric : str
        Names of the point selection, the data association and the error metric.
    filters, stop_rules : list of str
        Names of the outlier filters and weights, and of the stop rules, in order.
    n_source : int
        Number of points selected.
    T_co : numpy.ndarray, shape (4, 4), float64
        The pose that the stage returned, camera from object, meters.
    outcome : {"refined", "kept_initial"}
        "kept_initial" if the stage returned the pose that it started from.
    termination : str
        The reason why the stage ended.
    iterations : int
        Number of evaluations, including rejected ones.
    n_pairs : int
        Number of pairs at the pose that was returned.
    mean_loss : float or None
        Weighted mean of the metric's squared residuals at that pose, m²; None if it was never
        evaluated.
    """

    regime: str | None
    regime_mve: float | None
    selection: str
    association: str
    filters: list[str]
    metric: str
    stop_rules: list[str]
    n_source: int
    T_co: _Array
    outcome: _Outcome
    termination: str
    iterations: int
    n_pairs: int
    mean_loss: float | None

    def __repr__(self) -> str:
        parts = f"{self.selection}, {self.association}, {self.metric}"
        numbers = f"{self.iterations} iterations, {self.n_pairs} pairs"
        return f"StageEvent({parts}: {numbers}, {self.termination})"


@dataclass(frozen=True, eq=False, repr=False)
class Alternative(_Record):
    """Another pose that a search found.

    Attributes
    ----------
    T_co : numpy.ndarray, shape (4, 4), float64
        The pose, camera from object, meters.
    score : float
        The score of the search; lower is better.
    gap : float
        The score minus that of the returned pose.
    color_gap : float or None
        The agreement of the colors at the returned pose minus that at this one, as correlations;
        None if there are no colors, or if they do not distinguish the poses.
    mssd : float
        Distance from the returned pose, meters.
    rotation_degrees : float
        Angle to the returned pose.
    """

    T_co: _Array
    score: float
    gap: float
    color_gap: float | None
    mssd: float
    rotation_degrees: float

    def __repr__(self) -> str:
        away = f"{1000 * self.mssd:.1f} mm, {self.rotation_degrees:.0f}° away"
        return f"Alternative({away}, gap {self.gap:.3f})"


@dataclass(frozen=True, eq=False, repr=False)
class Result(_Record):
    """The result of a refinement: a pose, its score, and the stages that ran.

    If the pose could not be refined, `T_co` has the numbers that were passed, and `outcome` is
    "kept_initial". This is not an error.

    A pickled or deep-copied result has no `model`. Its methods then need `model=`.

    Attributes
    ----------
    T_co : numpy.ndarray, shape (4, 4), float64
        The pose, camera from object, meters.
    confidence : float
        Probability that the pose is right, 0 to 1. A pose is right if no point of the surface is
        farther from its true place than a tenth of the diameter. Accept a pose with 0.95 or more.
    expected_error_meters : float
        Largest distance to expect of a surface point from its true place, meters.
    expected_error_degrees : float
        Rotation error to expect, degrees.
    look_alikes : float
        Number of other poses that look alike. A pose that explains the image as well counts 1, one
        that explains it better up to 2, and others less. They lower the confidence, less so if the
        returned pose is near the initial one.
    mve : float
        Mean VSD estimate of the returned pose: 0 if it explains the image everywhere, 1 if
        nowhere. Imperfect masks raise it for right poses, too; `confidence` does not have this
        weakness.
    mve_initial : float
        Mean VSD estimate of the initial pose; equal to `mve` after `Pipeline.estimate`.
    evidence : dict of float by name
        Evidence for and against the returned pose, from one render. The shares of the rendered
        pixels add up to 1:

        - `agrees`: the measured surface is within 10 % of the diameter of the rendered one.
        - `seen_through`: it is farther; the camera looks through the object.
        - `inside`: it is nearer and continues an agreeing surface; the object is in a table or
          wall.
        - `hidden`: it is nearer and ends in a step; something stands in front.
        - `unmeasured`: no depth was measured.

        The others are `pixels` (rendered), `unexplained` (share of the mask at which the model
        does not agree), `residual` and `noise` (medians, diameters), `contour` (share of the
        contour at which the measured surface ends; NaN if nothing was measured there),
        `mask_extra` and `mask_missing` (shares by which the mask is too large and too small) and
        `mask_growth_pixels` (negative if it is too small).
    warnings : list of str
        Reasons not to trust the pose, as sentences; empty if there are none.

        - The pose does not explain the image, or is more likely wrong than right.
        - The refinement made the pose worse.
        - The initial pose explained nothing of the image.
        - The measured surface is flat, but the model is not.
        - Another pose explains the image as well.
    alternatives : list of Alternative
        The distinct other poses that a search found, best first; empty without a search. Poses are
        distinct if their MSSD, up to declared symmetries, is above a tenth of the diameter.
    outcome : {"refined", "kept_initial"}
        "kept_initial" if the result is the initial pose.
    termination : str
        The reason why the pipeline ended, such as "converged", "iteration_limit",
        "loss_increased" or "no_pairs".
    iterations : int
        Number of evaluations in all stages, including rejected ones.
    n_pairs : int
        Number of pairs at the returned pose; 0 if it was never evaluated.
    mean_loss : float or None
        Weighted mean of the metric's squared residuals at the returned pose, m²; None if it was
        never evaluated.
    fitness : float or None
        Share of the points with a pair, 0 to 1; None if the pose was never evaluated.
    point_rmse : float or None
        Root mean square of the distances between the points of the pairs, meters.
    plane_rmse : float or None
        Root mean square of the distances from the observed tangent planes, meters.
    information : numpy.ndarray, shape (6, 6), float64, or None
        Information of the pairs about the pose, JᵀWJ; None if the metric has none. It refers to
        ξ = [ρ; φ], a left perturbation in the camera frame, translation first (meters, radians).
        The variance of the residuals is left out: a pose graph needs the inverse of `covariance`.
    covariance : numpy.ndarray, shape (6, 6), float64, or None
        Covariance of the pose in the same convention; None if a direction is not determined, or was
        frozen by the metric. It holds if the pairs are right and the residuals are independent.
    stages : list of StageEvent
        The ICP stages that ran, in order.
    model : Model or None
        The model that was refined.
    """

    T_co: _Array
    confidence: float
    expected_error_meters: float
    expected_error_degrees: float
    look_alikes: float
    mve: float
    mve_initial: float
    evidence: dict[str, float]
    warnings: list[str]
    alternatives: list[Alternative]
    outcome: _Outcome
    termination: str
    iterations: int
    n_pairs: int
    mean_loss: float | None
    fitness: float | None
    point_rmse: float | None
    plane_rmse: float | None
    information: _Array | None
    covariance: _Array | None
    stages: list[StageEvent]
    model: Model | None

    @property
    def refined(self) -> bool:
        """Returns `True` if the pose was refined. If not, the pose is the initial one."""
        return self.outcome == "refined"

    def overlay(
        self,
        observation: Observation,
        image: npt.ArrayLike | None = None,
        *,
        model: Model | None = None,
    ) -> npt.NDArray[np.uint8]:
        """Draws the contour of the model at the pose over an image.

        Parameters
        ----------
        observation : Observation
        image : array_like, shape (H, W) or (H, W, 3), uint8, optional
            Gray or RGB values of the pixels. By default, the picture of the depth.
        model : Model, optional
            By default, the model that was refined.

        Returns
        -------
        numpy.ndarray, shape (H, W, 3), uint8
            RGB values of the pixels.
        """
        from . import _pictures

        return _pictures.overlay(observation, self.T_co, self._model(model), image)

    def canonical_pose(self, reference: npt.ArrayLike, *, model: Model | None = None) -> _Array:
        """Returns the pose that is equivalent by a declared symmetry and nearest to another pose.

        Parameters
        ----------
        reference : array_like, shape (4, 4)
            Camera from object, meters, such as the pose in the previous image.
        model : Model, optional
            By default, the model that was refined.

        Returns
        -------
        numpy.ndarray, shape (4, 4), float64
            Camera from object, meters.
        """
        return self._model(model).nearest_equivalent(self.T_co, reference)

    def _model(self, model: Model | None) -> Model:
        if model is None:
            model = self.model
        if model is None:
            from ._errors import InputError

            raise InputError("this result was pickled without its model: expected model=")
        return model

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "model": None}

    def __copy__(self) -> Result:
        return dataclasses.replace(self)

    def __repr__(self) -> str:
        scores = f"confidence {self.confidence:.2f}, mve {self.mve_initial:.3f} -> {self.mve:.3f}"
        numbers = f"{self.n_pairs} pairs, {self.iterations} iterations"
        return f"Result({self.outcome}, {scores}, {numbers}, {self.termination})"

    def _repr_html_(self) -> str:
        rows = {
            "outcome": f"{self.outcome} ({self.termination})",
            "confidence": f"{self.confidence:.3f}",
            "expected error": f"{1000 * self.expected_error_meters:.1f} mm, "
            f"{self.expected_error_degrees:.1f}°",
            "MVE": f"{self.mve_initial:.3f} → {self.mve:.3f}",
            "translation, m": _translation(self.T_co),
            "warnings": "; ".join(self.warnings) or "none",
        }
        cells = (f"<tr><th>{key}</th><td>{value}</td></tr>" for key, value in rows.items())
        return f"<table>{''.join(cells)}</table>"


@dataclass(frozen=True, eq=False, repr=False)
class Alignment(_Record):
    """The result of a registration of two point clouds, from `align`.

    If the pose could not be refined, `T_ts` has the numbers that were passed, and `outcome` is
    "kept_initial". This is not an error.

    Attributes
    ----------
    T_ts : numpy.ndarray, shape (4, 4), float64
        The pose, target from source, meters.
    outcome : {"refined", "kept_initial"}
        "kept_initial" if the pose was not changed.
    termination : str
        The reason why the registration ended, such as "converged" or "no_pairs".
    iterations : int
        Number of iterations.
    fitness : float
        Share of the source points that have a counterpart, 0 to 1.
    rmse : float or None
        Root mean square of the distances of pairs, meters; None without pairs.
    covariance : numpy.ndarray, shape (6, 6), float64, or None
        Covariance of the pose; None if a direction is not determined, or was frozen. Translation
        first, meters and radians; a left perturbation in the frame of the target.
    warnings : list of str
        Reasons not to trust the pose, and notes on the preparation of the clouds, such as
        normals that were estimated, as sentences; empty if there are none.
    """

    T_ts: _Array
    outcome: _Outcome
    termination: str
    iterations: int
    fitness: float
    rmse: float | None
    covariance: _Array | None
    warnings: list[str]

    def __repr__(self) -> str:
        text = f"{self.outcome}, {self.termination}, fitness {self.fitness:.3f}"
        count = len(self.warnings)
        warned = "" if count == 0 else f", {count} warning{'s' if count > 1 else ''}"
        return f"Alignment({text}{warned})"


@dataclass(frozen=True, eq=False, repr=False)
class Fault(_Record):
    """A fault of the inputs of a refinement, and the evidence for it.

    Attributes
    ----------
    fault : str
        Its name, such as "mesh_scale".
    problem : str
        The fault in words.
    fix : str
        The correction in words.
    score : float or None
        The score of the corrected inputs, to compare with that of the `Diagnosis`; None if the
        fault is a fact that needs no comparison.
    numbers : dict
        The numbers of the fault by name, such as {"factor": 0.001}.
    """

    fault: str
    problem: str
    fix: str
    score: float | None
    numbers: dict[str, Any]

    def __repr__(self) -> str:
        return f"Fault({self.fault}, {self.numbers})"


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(_Record):
    """The probable faults of the inputs of a refinement, from `diagnose`.

    `print` shows them with their fixes.

    Attributes
    ----------
    faults : list of Fault
        The most probable one first; empty if none is probable.
    score : float
        The score of the inputs as they are: 0 is perfect, 1 the worst.
    """

    faults: list[Fault]
    score: float

    def __str__(self) -> str:
        if not self.faults:
            judged = "the model at the pose explains the image"
            if self.score >= 0.3:
                judged = (
                    "the model at the pose does not explain the image, or the mask shows more than"
                    " the object"
                )
            return f"no fault found (score {self.score:.3f}): {judged}"
        ranks = ["fault"] + ["less probable"] * (len(self.faults) - 1)
        lines = (
            f"{rank}: {fault.problem}\n  fix: {fault.fix}"
            for rank, fault in zip(ranks, self.faults)
        )
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"Diagnosis({[fault.fault for fault in self.faults]}, score {self.score:.3f})"


@dataclass(frozen=True, eq=False, repr=False)
class SequentialStep(_Record):
    """The pose of the object after one image, in the camera frame of that image.

    Attributes
    ----------
    T_co : numpy.ndarray, shape (4, 4), float64
        The fused pose, meters. While there is no estimate, the initial pose moved with the camera.
    covariance : numpy.ndarray, shape (6, 6), float64, or None
        Its covariance of ξ = [ρ; φ]; None while there is no estimate. It is not calibrated with
        `SequentialEstimator(covariance="mve")` or `paper=True`.
    T_init : numpy.ndarray, shape (4, 4), float64
        The pose that ICP started from, meters: the last fused pose, moved with the camera.
    T_registered : numpy.ndarray, shape (4, 4), float64
        The pose that ICP found in this image alone, meters.
    termination : str
        The reason why the registration ended.
    mve : float or None
        The mean VSD estimate of `T_registered`; None if it was not scored.
    event : str
        The result of `Fuser.update`, or "no_estimate" or "refused".
    reason : str or None
        The reason why the estimate was not accepted, for example the limit that it exceeds; None if
        it was.
    """

    T_co: _Array
    covariance: _Array | None
    T_init: _Array
    T_registered: _Array
    termination: str
    mve: float | None
    event: str
    reason: str | None

    def __repr__(self) -> str:
        return f"SequentialStep({self.event}, t = {_translation(self.T_co)} m)"


@dataclass(frozen=True, eq=False, repr=False)
class Tracked(_Record):
    """The pose of a tracked object in an image.

    Attributes
    ----------
    T_co : numpy.ndarray, shape (4, 4), float64
        The pose, camera from object, meters.
    state : {"tracking", "doubtful", "lost"}
        "doubtful" if the image does not determine the pose, or does not show the object for some
        frames; "lost" if the pose is a guess.
    confidence : float
        Probability that the pose is right, 0 to 1, by the evidence alone. Poses that look alike do
        not lower it: the motion tells them apart, or the state is "doubtful". 0 if the object is
        not seen.
    velocity : numpy.ndarray, shape (3,), float64
        Velocity of the object's center relative to the camera, meters per second, in the camera
        frame. It is that of the motion filter. While the object is not seen, it decays to 0.
    angular_velocity : numpy.ndarray, shape (3,), float64
        Angular velocity of the object relative to the camera, radians per second, in the camera
        frame.
    evidence : dict of float by name
        Evidence for and against the pose, as in `Result`.
    deviation : float
        Standard deviation of the least determined displacement of the object, meters.
    """

    T_co: _Array
    state: Literal["tracking", "doubtful", "lost"]
    confidence: float
    velocity: _Array
    angular_velocity: _Array
    evidence: dict[str, float]
    deviation: float

    def __repr__(self) -> str:
        return f"Tracked({self.state}, t = {_translation(self.T_co)} m)"
