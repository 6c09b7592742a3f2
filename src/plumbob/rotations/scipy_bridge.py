"""To and from `scipy.spatial.transform.Rotation`, with the order of components named on both sides."""

from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from plumbob import check
from plumbob.check import Floats
from plumbob.rotations.quat import quat_from_xyzw, quat_to_xyzw

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


def rotation_from_quat(q: ArrayLike) -> "Rotation":
    """SciPy rotation of unit quaternions in this project's order, wxyz, shape (4,) or (N, 4)."""
    from scipy.spatial.transform import Rotation

    array = check.last_axis("q", q, 4)
    check.unit_norm("q", array)
    return Rotation.from_quat(quat_to_xyzw(array))


def quat_from_rotation(rotation: "Rotation") -> Floats:
    """Unit quaternions, wxyz, of a SciPy rotation."""
    return quat_from_xyzw(rotation.as_quat())
