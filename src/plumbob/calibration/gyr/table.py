"""A gyroscope on a rate table: plateaus as a linear regression takes them, and its parameters.

::

    measured = b + S ω + G f        12 parameters without G, 21 with it

ω is the rate of the table in the axes of the unit, f the specific force. A unit never sits on the table exactly: one
mounting (a face that is up, spun about one axis) has a tilt of its own, which reads as cross-axis sensitivity in
proportion to the rate; and from face to face the bias has drifted. Both are random effects of the linear regression:
tilts inflate neither the noise nor the bias, and what they do to the misalignment stays in its covariance; G is tested
against the drift between faces (a split-plot F-test), not against the noise of the many plateaus of one face. Of second
order, and left out: a tilt of 0.1° makes a rate smaller by 1.5 parts in a million.

The card's matrix is S⁻¹, its bias b and its g-sensitivity G: `plumbob.data.cards.TriadCalibration`.
"""

from dataclasses import dataclass, replace
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.calibration.fit import CaptureRefusedError, Fitted, Reason, refuse
from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import EARTH_RATE
from plumbob.core.errors import ParameterError
from plumbob.core.findings import Note, warning
from plumbob.core.text import counted, p_value
from plumbob.core.units import deg, to_deg, to_dps
from plumbob.data.cards import Quality, TriadCalibration

SIMPLE: Final = 4  # Parameters of one axis without g-sensitivity: bias and a row of the response. With it there are 7.
_TURNING = 0.02  # share of the highest rate below which a plateau says nothing about its mounting
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class TableSession:
    """Regression of one session."""

    measured: Floats  # (N, 3), mean of the gyroscope over each plateau, rad/s
    # (N, 4), what bias, response and g-sensitivity are multiplied by: 1, true rate, rad/s, specific force, m/s²
    columns: Floats
    spins: Floats  # (N, K), signed speed in each mounting, rad/s; zero for plateaus of others
    spin_axes: Floats  # (K, 3), axis of each mounting, a unit vector
    # (N, F), 1 where a face was up, else 0; F = 0 where plateaus are too few to see what changed from face to face
    faces: Floats
    weight: Floats  # (N,), in proportion to the inverse variance of a mean

    @property
    def parameters(self) -> int:
        """Parameters of one axis."""
        return int(self.columns.shape[1])

    @property
    def rate(self) -> Floats:
        """True rate (N, 3), rad/s."""
        return self.columns[:, 1:SIMPLE]

    @property
    def condition(self) -> float:
        """Condition number of the scaled columns: 1 for an orthogonal session."""
        return float(np.linalg.cond(scaled(self.columns)))

    def without_force(self) -> Self:
        """Return the same session for the model without g-sensitivity."""
        return replace(self, columns=self.columns[:, :SIMPLE])

    def residual_squares(self, *, by_face: bool) -> tuple[Floats, int]:
        """Weighted squares (3,) that a fit leaves with the best tilt of each mounting, and its degrees of freedom.

        With `by_face`, each face has whatever bias fits best.
        """
        root = np.sqrt(self.weight)[:, np.newaxis]
        free = (self.columns, self.spins, *([self.faces] if by_face else []))
        design, wanted = scaled(np.hstack(free) * root), self.measured * root
        solution, _, rank, _ = np.linalg.lstsq(design, wanted, rcond=1e-9)
        return np.asarray(((wanted - design @ solution) ** 2).sum(axis=0)), len(wanted) - int(rank)

    def tilting(self, response: Floats) -> Floats:
        """What a tilt of each mounting about two axes makes a gyroscope of that response read, (3 N, 2 K), by axis."""
        across = np.array([np.linalg.svd(axis[np.newaxis])[2][1:].T for axis in self.spin_axes])
        read = np.einsum("nk,ai,kij->ankj", self.spins, response, across)
        return np.asarray(read.reshape(3 * len(self.spins), -1))


def table_session(
    rate: ArrayLike, measured: ArrayLike, *, force: ArrayLike | None, seconds: ArrayLike | None, latitude: float | None
) -> TableSession:
    """Session of plateaus; arguments as of `fit_table`."""
    rates = check.rows("rate", rate, 3)
    means = check.rows("measured", measured, 3, len(rates))
    forces = None if force is None else check.rows("force", force, 3, len(rates))
    length = np.ones(len(rates)) if seconds is None else check.column("seconds", seconds, len(rates))
    inputs = [rates, means, *([] if forces is None else [forces])]
    if not all(np.isfinite(part).all() for part in inputs) or not (length > 0.0).all():
        text = "some plateau has no finite mean of rate or specific force, or no length."
        raise CaptureRefusedError(Reason("too-few", text, "Leave it out."))
    up, true = np.zeros(len(rates), dtype=np.intp), rates
    if forces is not None:  # which of the six faces is up: 0 to 2 for x to z, 3 to 5 for their opposites
        axis = np.argmax(np.abs(forces), axis=1)
        up = axis + 3 * (forces[np.arange(len(forces)), axis] < 0.0)
    spins, axes = _mountings(rates, up)
    if latitude is not None:  # the vertical part of the Earth's rate: what is horizontal averages out in a turn
        if forces is None:
            raise ParameterError("the Earth's rate by latitude needs the specific force, which shows where up is.")
        vertical = forces / np.linalg.norm(forces, axis=1, keepdims=True)
        true = rates + EARTH_RATE * np.sin(latitude) * vertical
    columns = np.hstack((np.ones((len(rates), 1)), true, *([] if forces is None else [forces])))
    faces = (up[:, np.newaxis] == np.unique(up)).astype(np.float64)
    session = TableSession(means, columns, spins, axes, faces, length / length.mean() if length.size else length)
    return session if session.residual_squares(by_face=True)[1] > 0 else replace(session, faces=faces[:, :0])


def _mountings(rates: Floats, up: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Spins and their axes: a mounting is one axis of spin with one face up."""
    speed = np.linalg.norm(rates, axis=1)
    turning = speed > _TURNING * speed.max(initial=0.0)
    kind = 6 * np.argmax(np.abs(rates), axis=1) + up
    kinds = np.unique(kind[turning])
    spins, axes = np.zeros((len(rates), kinds.size)), np.zeros((kinds.size, 3))
    for k, code in enumerate(kinds):
        rows = np.flatnonzero((kind == code) & turning)
        ahead = rates[rows] * np.sign(rates[rows, code // 6])[:, np.newaxis]
        axes[k] = ahead.sum(axis=0) / np.linalg.norm(ahead.sum(axis=0))
        spins[rows, k] = rates[rows] @ axes[k]
    return spins, axes


def scaled(columns: Floats) -> Floats:
    """Columns brought to norm 1; what is zero stays so."""
    return np.asarray(columns / np.maximum(np.linalg.norm(columns, axis=0), _TINY))


MODELS: Final = ("auto", "12", "21")  # without g-sensitivity, with it, or with it where it shows
MOUNTING: Final = float(deg(0.1))  # usual tilt of a mounting on the table, standard deviation per axis, rad
SCALE_GRADES: Final = {"good": 1e-4, "fair": 1e-3}  # largest standard deviation of a scale factor; above, it is poor
_AXES = "xyz"
_NAMES = ("the bias", *(f"the rate about {a}" for a in _AXES), *(f"the specific force along {a}" for a in _AXES))
_WORST_CONDITION = 100.0  # columns scaled to one size: 1 is an orthogonal session
_SURE = 0.01  # chance of a g-sensitivity that is none
_DEFORMED = 0.3  # departure of the response from the unit matrix that no gyroscope has
_FINEST = 1e-7  # of the highest rate: no mean of a plateau is known better


class _Solution(NamedTuple):
    """Parameters (3, p), their covariance (3p, 3p), residuals (N, 3), and the tilt that opposite mountings show."""

    parameters: Floats
    covariance: Floats
    residuals: Floats
    tilt: float

    @property
    def response(self) -> Floats:
        return self.parameters[:, 1:SIMPLE]


def fit_table(
    rate: ArrayLike,
    measured: ArrayLike,
    *,
    force: ArrayLike | None = None,
    seconds: ArrayLike | None = None,
    clipped: ArrayLike | None = None,
    model: str = "auto",
    mounting: float = MOUNTING,
    latitude: float | None = None,
) -> Fitted:
    """Calibrate a gyroscope from plateaus on a rate table.

    `rate` (N, 3) is the table's in the axes of the unit, rad/s, `measured` (N, 3) the gyroscope's mean; `force` (N, 3),
    calibrated, without which there is no g-sensitivity; `seconds` (N,) the length of each, whose inverse the variance
    of a mean goes with; `clipped` (N,) the share of its samples at the end of the range. The model "auto" takes 21
    parameters where the session separates them and an F-test finds g-sensitivity. `mounting` is the tilt of one
    mounting, rad, taken as larger where opposite ones disagree by more. The `latitude` of a table with a vertical axis,
    rad, takes the Earth's rate out. Residuals are those of the means, tilts and drift between faces removed.
    """
    check.one_of("model", model, MODELS)
    full = table_session(rate, measured, force=force, seconds=seconds, latitude=latitude)
    shares = np.zeros(len(full.measured)) if clipped is None else check.column("clipped", clipped, len(full.measured))
    if (shares > 0.0).any():
        i = int(np.argmax(shares))
        spun = ", ".join(f"{x:.4g}" for x in to_dps(check.floats("rate", rate)[i]))
        text = f"{100.0 * shares[i]:.0f} % of the plateau at ({spun}) °/s are at the end of the range"
        others = f"(of {counted(int(np.count_nonzero(shares)), 'such plateau')})"
        refuse(Reason("clipping", f"{text} {others}.", "Leave such rates out, or record with a wider range."))
    speed = np.abs(full.rate).max(axis=0, initial=0.0)
    resting = [_AXES[i] for i in range(3) if speed[i] <= 0.02 * speed.max(initial=0.0)]
    text = f"no plateau turns about {' or '.join(resting)}, of {len(full.rate)} plateaus."
    advice = "Spin the unit about each of its axes, both ways round, at two rates or more."
    refuse(Reason("too-few", text, advice) if resting else None)
    refuse(_why_unclear(full.without_force(), 12))
    session, remarks = _chosen(full, model)
    first = _solve(session, mounting, np.eye(3))
    solution = _solve(session, max(mounting, first.tilt), first.response)
    shown = "; ".join(" ".join(f"{x:.3g}" for x in row) for row in solution.response)
    text = f"measured over true rate comes out as [{shown}], which is far from the unit matrix."
    advice = "Check the unit of the recording, the axes, and the signs and units of the rates."
    if np.abs(solution.response - np.eye(3)).max() > _DEFORMED:
        refuse(Reason("implausible", text, advice))
    if first.tilt > 2.0 * mounting:
        tilts, usual = (f"{to_deg(angle):.2g}°" for angle in (first.tilt, mounting))
        remarks.append(warning("calibration.table_tilts", tilts=tilts, usual=usual))
    if latitude is None:
        where = "g-sensitivity" if session.parameters > SIMPLE else "bias"
        most = f"{to_dps(EARTH_RATE):.4f} °/s"
        remarks.append(
            f"the Earth's rate about the vertical, up to {most}, is in the {where}; the latitude takes it out."
        )
    return _fitted(session, solution, tuple(remarks))


def _chosen(session: TableSession, model: str) -> tuple[TableSession, list[Note]]:
    """Session with the columns of the model, and what to know about the choice."""
    why_not = _why_no_coupling(session)
    if model == "21":
        refuse(why_not)
        return session, []
    if why_not is not None:
        text = "g-sensitivity cannot be separated from the bias, and is part of it"
        return session.without_force(), [f"{text}: {why_not.text} {why_not.advice}"]
    chance = _chance_of_no_coupling(session)
    if model == "auto" and chance <= _SURE:
        return session, []
    absent = (
        f"no g-sensitivity shows against the drift from face to face (F-test, {p_value(chance)}); it is taken as zero."
    )
    ignored = f"g-sensitivity shows (F-test, {p_value(chance)}), but 12 parameters leave it in the bias."
    return session.without_force(), [absent if chance > _SURE else ignored]


def _why_no_coupling(session: TableSession) -> Reason | None:
    """Say why a session cannot tell the g-sensitivity, if so."""
    if session.parameters == SIMPLE:
        text = "there is no specific force."
        return Reason("too-few", text, "Record the accelerometer, or put acc_x_g, acc_y_g, acc_z_g into the plan.")
    unclear = _why_unclear(session, 21)
    if unclear is None and _freedom_of_drift(session) < 1:
        text = f"{session.faces.shape[1]} faces are too few to separate it from the drift of the bias."
        return Reason("too-few", text, "Spin about each axis with either end of it up.")
    return unclear


def _freedom_of_drift(session: TableSession) -> int:
    """Degrees of freedom that the faces have beyond the parameters."""
    return session.residual_squares(by_face=False)[1] - session.residual_squares(by_face=True)[1]


def _why_unclear(session: TableSession, parameters: int) -> Reason | None:
    """Say why a session does not determine that many parameters, if so."""
    if session.condition > _WORST_CONDITION:
        weakest = np.linalg.svd(scaled(session.columns))[2][-1]
        names = [_NAMES[i] for i in np.flatnonzero(np.abs(weakest) > 0.1)]
        listed = " and ".join((", ".join(names[:-1]), names[-1])) if len(names) > 1 else names[0]
        text = f"{listed} change together, so they cannot be separated."
        advice = "Spin both ways round about each axis, with either end of it up, and let each face rest too."
        return Reason("ill-conditioned", text, advice)
    if session.residual_squares(by_face=False)[1] < 1:
        text = f"{len(session.measured)} plateaus are too few for {parameters} parameters and the noise."
        return Reason("too-few", text, "Add rates, and spin both ways round.")
    return None


def _chance_of_no_coupling(session: TableSession) -> float:
    """Chance that drift from face to face makes the 9 terms of G fit that much better."""
    from scipy.special import fdtrc

    simple, _ = session.without_force().residual_squares(by_face=False)
    coupled, _ = session.residual_squares(by_face=False)
    free, _ = session.residual_squares(by_face=True)
    freedom = 3.0 * _freedom_of_drift(session)
    gained, drift = float((simple - coupled).sum()) / 9.0, float((coupled - free).sum()) / freedom
    return float(fdtrc(9.0, freedom, gained / max(drift, 1e-300)))


def _noise_and_drift(session: TableSession) -> tuple[Floats, float]:
    """Standard deviation of a mean (3,), and of the bias from face to face, all axes alike."""
    free, freedom = session.residual_squares(by_face=True)
    noise = np.maximum(np.sqrt(free / freedom), _FINEST * float(np.abs(session.rate).max()))
    spare = _freedom_of_drift(session)
    if spare < 1:
        return noise, 0.0
    between = float((session.residual_squares(by_face=False)[0] - free).mean()) / spare
    per_face = len(session.measured) / session.faces.shape[1]
    return noise, float(np.sqrt(max(0.0, (between - float((noise**2).mean())) / per_face)))


def _solve(session: TableSession, mounting: float, response: Floats) -> _Solution:
    """Least squares of all axes at once, with the spread of the tilts as further observations; response as known."""
    noise, drift = _noise_and_drift(session)
    root = (np.sqrt(session.weight) / noise[:, np.newaxis]).ravel()
    columns, tilting, faces = np.kron(np.eye(3), session.columns), session.tilting(response), session.faces
    spread = np.repeat([mounting, drift], [tilting.shape[1], 3 * faces.shape[1]])
    chances = np.hstack((tilting, np.kron(np.eye(3), faces))) * spread
    parameters = columns.shape[1]
    above = np.hstack((columns, chances)) * root[:, np.newaxis]
    design = np.vstack((above, np.eye(spread.size, above.shape[1], parameters)))
    size = np.linalg.norm(design, axis=0)
    q, r = np.linalg.qr(design / size)
    inverse = np.linalg.solve(r, q.T) / size[:, np.newaxis]
    wanted = session.measured.T.ravel()
    solution = inverse @ np.append(wanted * root, np.zeros(spread.size))
    tilt = mounting * solution[parameters : parameters + tilting.shape[1]]
    spare = int(np.linalg.matrix_rank(scaled(np.hstack((columns, tilting))))) - parameters
    return _Solution(
        solution[:parameters].reshape(3, -1),
        (inverse @ inverse.T)[:parameters, :parameters],
        (wanted - columns @ solution[:parameters] - chances @ solution[parameters:]).reshape(3, -1).T,
        float(np.sqrt((tilt**2).sum() / spare)) if spare > 0 else 0.0,
    )


def _fitted(session: TableSession, solution: _Solution, remarks: tuple[Note, ...]) -> Fitted:
    matrix = np.asarray(np.linalg.inv(solution.response), dtype=np.float64)
    first = np.arange(3)[:, np.newaxis] * (len(solution.covariance) // 3)
    places = np.concatenate((first.ravel(), (first + np.arange(1, SIMPLE)).ravel()))
    slope = np.eye(12)
    slope[3:, 3:] = -np.kron(matrix, matrix.T)  # d(S⁻¹) = −S⁻¹ dS S⁻¹
    covariance = slope @ solution.covariance[np.ix_(places, places)] @ slope.T
    scale_sd = float(np.sqrt(np.diag(covariance)[[3, 7, 11]]).max())
    coupled = session.parameters > SIMPLE
    calibration = TriadCalibration(
        matrix=matrix,
        bias=solution.parameters[:, 0],
        unit_in="rad/s",
        unit_out="rad/s",
        residual_rms=float(np.sqrt((solution.residuals**2).mean())),
        g_sensitivity=solution.parameters[:, SIMPLE:] if coupled else np.zeros((3, 3)),
        g_sensitivity_sd=np.sqrt(np.diag(solution.covariance)).reshape(3, -1)[:, SIMPLE:] if coupled else None,
        covariance=covariance,
        method=f"rate table, {len(session.measured)} plateaus, {21 if coupled else 12} parameters",
        quality=Quality(
            grade=next((grade for grade, limit in SCALE_GRADES.items() if scale_sd <= limit), "poor"),
            samples=len(session.measured),
            condition=session.condition,
            scale_sd=scale_sd,
        ),
    )
    used = np.ones(len(session.measured), dtype=np.bool_)
    return Fitted(calibration, session.measured, solution.residuals, used, remarks)
