"""Covariance of a quaternion and a gyroscope bias: a turn spreads it, gravity shrinks it.

It is P of the filter in `plumbob.filters.ekf7`, whose docstring has the symbols. It has 28 entries: a matrix that is
stored by its upper half cannot lose its symmetry. Products with A, the matrix of ``… ⊗ e``, are quaternion products of
columns.
"""

from typing import Final

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.kernels import kernel
from plumbob.filters.layout import BIAS, OWN, Q
from plumbob.rotations.kernels import Quat, Vec, half_angle, quat_mul, third_row

P_QQ: Final = OWN  # 10
P_QB: Final = OWN + 10  # 12
P_BB: Final = OWN + 22  # 6
ABOUT: Final = OWN + 28  # attitude that P is about, 4
PLACES_END: Final = OWN + 32

HEADING_LIMIT: Final = 1.0
"""Variance that the heading may reach, rad²; no sensor speaks of it, so no other figure depends on it."""


@kernel
def set_covariance(x: Floats, angle_var: float, bias_var: float) -> None:
    """Make the attitude uncertain by angle_var in every direction, the bias by bias_var, and the two independent."""
    for k in range(P_QQ, P_BB + 6):
        x[k] = 0.0
    p = 0.25 * angle_var  # a turn by θ moves q by θ/2
    x[P_QQ], x[P_QQ + 4], x[P_QQ + 7], x[P_QQ + 9] = p, p, p, p
    x[P_BB], x[P_BB + 3], x[P_BB + 5] = bias_var, bias_var, bias_var
    x[ABOUT], x[ABOUT + 1], x[ABOUT + 2], x[ABOUT + 3] = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]


@kernel
def bias_derivative(
    q0: float, q1: float, q2: float, q3: float, dt: float, wx: float, wy: float, wz: float, w: float, s: float
) -> tuple[Quat, Quat, Quat]:
    """Columns of ∂(q ⊗ exp W)/∂X, where W = (ω − X) Δt, w = cos |W|/2 and s = sin(|W|/2)/|W|."""
    angle2 = wx * wx + wy * wy + wz * wz
    small = angle2 * (1.0 / 960.0 - angle2 / 107520.0) - 1.0 / 24.0
    r = small if angle2 < 1e-4 else (0.5 * w - s) / angle2  # ds/d|W| / |W|, by its series as in `half_angle`
    u0, u1, u2, u3 = quat_mul(q0, q1, q2, q3, 0.5 * dt * s, -dt * r * wx, -dt * r * wy, -dt * r * wz)
    s = -dt * s  # [Li2012] step (1): for W = 0 this leaves Δt/2 Ψ
    return (
        (wx * u0 - s * q1, wx * u1 + s * q0, wx * u2 + s * q3, wx * u3 - s * q2),
        (wy * u0 - s * q2, wy * u1 - s * q3, wy * u2 + s * q0, wy * u3 + s * q1),
        (wz * u0 - s * q3, wz * u1 + s * q2, wz * u2 - s * q1, wz * u3 + s * q0),
    )


@kernel
def spread_to_bias(
    x: Floats, e0: float, e1: float, e2: float, e3: float, bx: Quat, by: Quat, bz: Quat
) -> tuple[Quat, Quat, Quat]:
    """Predict P_qb to A P_qb + B P_bb, with A M = M ⊗ e by columns; returns the columns of A P_qb + ½ B P_bb."""
    x0, x1, x2, x3 = quat_mul(x[P_QB], x[P_QB + 3], x[P_QB + 6], x[P_QB + 9], e0, e1, e2, e3)
    y0, y1, y2, y3 = quat_mul(x[P_QB + 1], x[P_QB + 4], x[P_QB + 7], x[P_QB + 10], e0, e1, e2, e3)
    z0, z1, z2, z3 = quat_mul(x[P_QB + 2], x[P_QB + 5], x[P_QB + 8], x[P_QB + 11], e0, e1, e2, e3)
    pxx, pxy, pxz = 0.5 * x[P_BB], 0.5 * x[P_BB + 1], 0.5 * x[P_BB + 2]
    pyy, pyz, pzz = 0.5 * x[P_BB + 3], 0.5 * x[P_BB + 4], 0.5 * x[P_BB + 5]
    fx0, fy0, fz0 = _mixed(bx[0], by[0], bz[0], pxx, pxy, pxz, pyy, pyz, pzz)
    fx1, fy1, fz1 = _mixed(bx[1], by[1], bz[1], pxx, pxy, pxz, pyy, pyz, pzz)
    fx2, fy2, fz2 = _mixed(bx[2], by[2], bz[2], pxx, pxy, pxz, pyy, pyz, pzz)
    fx3, fy3, fz3 = _mixed(bx[3], by[3], bz[3], pxx, pxy, pxz, pyy, pyz, pzz)
    dx = x0 + fx0, x1 + fx1, x2 + fx2, x3 + fx3
    dy = y0 + fy0, y1 + fy1, y2 + fy2, y3 + fy3
    dz = z0 + fz0, z1 + fz1, z2 + fz2, z3 + fz3
    x[P_QB], x[P_QB + 1], x[P_QB + 2] = dx[0] + fx0, dy[0] + fy0, dz[0] + fz0
    x[P_QB + 3], x[P_QB + 4], x[P_QB + 5] = dx[1] + fx1, dy[1] + fy1, dz[1] + fz1
    x[P_QB + 6], x[P_QB + 7], x[P_QB + 8] = dx[2] + fx2, dy[2] + fy2, dz[2] + fz2
    x[P_QB + 9], x[P_QB + 10], x[P_QB + 11] = dx[3] + fx3, dy[3] + fy3, dz[3] + fz3
    return dx, dy, dz


@kernel
def _mixed(
    bx: float, by: float, bz: float, pxx: float, pxy: float, pxz: float, pyy: float, pyz: float, pzz: float
) -> tuple[float, float, float]:
    """One row of B times the symmetric P."""
    return bx * pxx + by * pxy + bz * pxz, bx * pxy + by * pyy + bz * pyz, bx * pxz + by * pyz + bz * pzz


@kernel
def spread_turn(
    x: Floats, e0: float, e1: float, e2: float, e3: float,
    bx: Quat, by: Quat, bz: Quat, dx: Quat, dy: Quat, dz: Quat,
) -> None:  # fmt: skip
    """Predict P_qq to A P_qq Aᵀ + D Bᵀ + B Dᵀ."""
    p0, p1, p2, p3 = x[P_QQ], x[P_QQ + 1], x[P_QQ + 2], x[P_QQ + 3]
    p11, p12, p13 = x[P_QQ + 4], x[P_QQ + 5], x[P_QQ + 6]
    p22, p23, p33 = x[P_QQ + 7], x[P_QQ + 8], x[P_QQ + 9]
    y00, y10, y20, y30 = quat_mul(p0, p1, p2, p3, e0, e1, e2, e3)  # columns of A P_qq
    y01, y11, y21, y31 = quat_mul(p1, p11, p12, p13, e0, e1, e2, e3)
    y02, y12, y22, y32 = quat_mul(p2, p12, p22, p23, e0, e1, e2, e3)
    y03, y13, y23, y33 = quat_mul(p3, p13, p23, p33, e0, e1, e2, e3)
    z00, z01, z02, z03 = quat_mul(y00, y01, y02, y03, e0, e1, e2, e3)  # rows of A P_qq Aᵀ
    _, z11, z12, z13 = quat_mul(y10, y11, y12, y13, e0, e1, e2, e3)
    _, _, z22, z23 = quat_mul(y20, y21, y22, y23, e0, e1, e2, e3)
    _, _, _, z33 = quat_mul(y30, y31, y32, y33, e0, e1, e2, e3)
    bx0, bx1, bx2, bx3 = bx
    by0, by1, by2, by3 = by
    bz0, bz1, bz2, bz3 = bz
    dx0, dx1, dx2, dx3 = dx
    dy0, dy1, dy2, dy3 = dy
    dz0, dz1, dz2, dz3 = dz
    x[P_QQ] = z00 + 2.0 * (bx0 * dx0 + by0 * dy0 + bz0 * dz0)
    x[P_QQ + 1] = z01 + (bx0 * dx1 + by0 * dy1 + bz0 * dz1) + (bx1 * dx0 + by1 * dy0 + bz1 * dz0)
    x[P_QQ + 2] = z02 + (bx0 * dx2 + by0 * dy2 + bz0 * dz2) + (bx2 * dx0 + by2 * dy0 + bz2 * dz0)
    x[P_QQ + 3] = z03 + (bx0 * dx3 + by0 * dy3 + bz0 * dz3) + (bx3 * dx0 + by3 * dy0 + bz3 * dz0)
    x[P_QQ + 4] = z11 + 2.0 * (bx1 * dx1 + by1 * dy1 + bz1 * dz1)
    x[P_QQ + 5] = z12 + (bx1 * dx2 + by1 * dy2 + bz1 * dz2) + (bx2 * dx1 + by2 * dy1 + bz2 * dz1)
    x[P_QQ + 6] = z13 + (bx1 * dx3 + by1 * dy3 + bz1 * dz3) + (bx3 * dx1 + by3 * dy1 + bz3 * dz1)
    x[P_QQ + 7] = z22 + 2.0 * (bx2 * dx2 + by2 * dy2 + bz2 * dz2)
    x[P_QQ + 8] = z23 + (bx2 * dx3 + by2 * dy3 + bz2 * dz3) + (bx3 * dx2 + by3 * dy2 + bz3 * dz2)
    x[P_QQ + 9] = z33 + 2.0 * (bx3 * dx3 + by3 * dy3 + bz3 * dz3)


@kernel
def add_noise(x: Floats, angle_var: float, walk_var: float) -> None:
    """Make every turn of the attitude more uncertain by angle_var, the bias by walk_var; the length of q is kept."""
    p = 0.25 * angle_var
    q0, q1, q2, q3 = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    x[P_QQ] += p * (1.0 - q0 * q0)  # Ξ Ξᵀ = 1 − q qᵀ
    x[P_QQ + 1] -= p * (q0 * q1)
    x[P_QQ + 2] -= p * (q0 * q2)
    x[P_QQ + 3] -= p * (q0 * q3)
    x[P_QQ + 4] += p * (1.0 - q1 * q1)
    x[P_QQ + 5] -= p * (q1 * q2)
    x[P_QQ + 6] -= p * (q1 * q3)
    x[P_QQ + 7] += p * (1.0 - q2 * q2)
    x[P_QQ + 8] -= p * (q2 * q3)
    x[P_QQ + 9] += p * (1.0 - q3 * q3)
    x[P_BB] += walk_var
    x[P_BB + 3] += walk_var
    x[P_BB + 5] += walk_var


@kernel
def predict(x: Floats, dt: float, gx: float, gy: float, gz: float, angle_var: float, walk_var: float) -> None:
    """Turn the attitude by the rate less the bias, and P with it: P⁻ = Φ P Φᵀ + Q."""
    wx, wy, wz = dt * (gx - x[BIAS]), dt * (gy - x[BIAS + 1]), dt * (gz - x[BIAS + 2])  # [Li2012] (9)
    w, s = half_angle(wx * wx + wy * wy + wz * wz)  # departs from [Li2012] (10): the half angle, which it lacks
    q0, q1, q2, q3 = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    bx, by, bz = bias_derivative(q0, q1, q2, q3, dt, wx, wy, wz, w, s)
    q0, q1, q2, q3 = quat_mul(q0, q1, q2, q3, w, s * wx, s * wy, s * wz)  # [Li2012] (10)
    e0, e1, e2, e3 = quat_mul(x[ABOUT], -x[ABOUT + 1], -x[ABOUT + 2], -x[ABOUT + 3], q0, q1, q2, q3)
    dx, dy, dz = spread_to_bias(x, e0, e1, e2, e3, bx, by, bz)
    spread_turn(x, e0, e1, e2, e3, bx, by, bz, dx, dy, dz)  # departs from [Li2012]: P is predicted
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = q0, q1, q2, q3
    x[ABOUT], x[ABOUT + 1], x[ABOUT + 2], x[ABOUT + 3] = q0, q1, q2, q3
    add_noise(x, angle_var, walk_var)


@kernel
def seen(p0: float, p1: float, p2: float, p3: float, h0: float, h1: float, h2: float, h3: float) -> Vec:
    """H p for a column p; the rows of H are those of [Li2012] step (3), and h is q times twice gravity upward."""
    return (
        p1 * h3 - p0 * h2 - p2 * h0 + p3 * h1,
        p0 * h1 + p1 * h0 + p2 * h3 + p3 * h2,
        p0 * h0 - p1 * h1 - p2 * h2 + p3 * h3,
    )


@kernel
def factors(
    aa: float, ab: float, ac: float, bb: float, bc: float, cc: float
) -> tuple[float, float, float, float, float, float]:
    """1/D and L of the symmetric L D Lᵀ: three reciprocals, then ba, ca, cb."""
    da = 1.0 / aa
    l_ba, l_ca = da * ab, da * ac
    db = 1.0 / (bb - l_ba * ab)
    schur = bc - l_ba * ac
    l_cb = db * schur
    return da, db, 1.0 / (cc - l_ca * ac - l_cb * schur), l_ba, l_ca, l_cb


@kernel
def correct_gravity(x: Floats, up: float, ax: float, ay: float, az: float, var: float) -> None:
    """Take up a specific force as gravity: x += K (f − h(q)), P −= K S Kᵀ, with S = H P Hᵀ + R = L D Lᵀ.

    With the columns a, b, c of P Hᵀ L⁻ᵀ and the innovation L⁻¹ (f − h), the three are independent of each other.
    """
    h = 2.0 * up * G0
    h0, h1, h2, h3 = h * x[Q], h * x[Q + 1], h * x[Q + 2], h * x[Q + 3]
    p01, p02, p03, p12, p13, p23 = x[P_QQ + 1], x[P_QQ + 2], x[P_QQ + 3], x[P_QQ + 5], x[P_QQ + 6], x[P_QQ + 8]
    a0, b0, c0 = seen(x[P_QQ], p01, p02, p03, h0, h1, h2, h3)
    a1, b1, c1 = seen(p01, x[P_QQ + 4], p12, p13, h0, h1, h2, h3)
    a2, b2, c2 = seen(p02, p12, x[P_QQ + 7], p23, h0, h1, h2, h3)
    a3, b3, c3 = seen(p03, p13, p23, x[P_QQ + 9], h0, h1, h2, h3)
    a4, b4, c4 = seen(x[P_QB], x[P_QB + 3], x[P_QB + 6], x[P_QB + 9], h0, h1, h2, h3)
    a5, b5, c5 = seen(x[P_QB + 1], x[P_QB + 4], x[P_QB + 7], x[P_QB + 10], h0, h1, h2, h3)
    a6, b6, c6 = seen(x[P_QB + 2], x[P_QB + 5], x[P_QB + 8], x[P_QB + 11], h0, h1, h2, h3)
    s_aa, s_ab, s_ac = seen(a0, a1, a2, a3, h0, h1, h2, h3)
    _, s_bb, s_bc = seen(b0, b1, b2, b3, h0, h1, h2, h3)
    _, _, s_cc = seen(c0, c1, c2, c3, h0, h1, h2, h3)
    da, db, dc, ba, ca, cb = factors(s_aa + var, s_ab, s_ac, s_bb + var, s_bc, s_cc + var)  # [Li2012] step (4)
    b0, b1, b2, b3 = b0 - ba * a0, b1 - ba * a1, b2 - ba * a2, b3 - ba * a3
    b4, b5, b6 = b4 - ba * a4, b5 - ba * a5, b6 - ba * a6
    c0, c1, c2, c3 = c0 - ca * a0 - cb * b0, c1 - ca * a1 - cb * b1, c2 - ca * a2 - cb * b2, c3 - ca * a3 - cb * b3
    c4, c5, c6 = c4 - ca * a4 - cb * b4, c5 - ca * a5 - cb * b5, c6 - ca * a6 - cb * b6
    fx, fy, fz = third_row(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])  # departs from [Li2012] (11): the sign of specific force
    ea = ax - 0.5 * h * fx
    eb = ay - 0.5 * h * fy - ba * ea
    ec = az - 0.5 * h * fz - ca * ea - cb * eb
    ea, eb, ec = da * ea, db * eb, dc * ec
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = (  # [Li2012] step (5)
        x[Q] + (a0 * ea + b0 * eb + c0 * ec),
        x[Q + 1] + (a1 * ea + b1 * eb + c1 * ec),
        x[Q + 2] + (a2 * ea + b2 * eb + c2 * ec),
        x[Q + 3] + (a3 * ea + b3 * eb + c3 * ec),
    )
    x[BIAS], x[BIAS + 1] = x[BIAS] + (a4 * ea + b4 * eb + c4 * ec), x[BIAS + 1] + (a5 * ea + b5 * eb + c5 * ec)
    x[BIAS + 2] += a6 * ea + b6 * eb + c6 * ec
    u, v, w = da * a0, db * b0, dc * c0  # [Li2012] step (6)
    x[P_QQ], x[P_QQ + 1] = x[P_QQ] - (u * a0 + v * b0 + w * c0), x[P_QQ + 1] - (u * a1 + v * b1 + w * c1)
    x[P_QQ + 2], x[P_QQ + 3] = x[P_QQ + 2] - (u * a2 + v * b2 + w * c2), x[P_QQ + 3] - (u * a3 + v * b3 + w * c3)
    x[P_QB], x[P_QB + 1] = x[P_QB] - (u * a4 + v * b4 + w * c4), x[P_QB + 1] - (u * a5 + v * b5 + w * c5)
    x[P_QB + 2] -= u * a6 + v * b6 + w * c6
    u, v, w = da * a1, db * b1, dc * c1
    x[P_QQ + 4], x[P_QQ + 5] = x[P_QQ + 4] - (u * a1 + v * b1 + w * c1), x[P_QQ + 5] - (u * a2 + v * b2 + w * c2)
    x[P_QQ + 6], x[P_QB + 3] = x[P_QQ + 6] - (u * a3 + v * b3 + w * c3), x[P_QB + 3] - (u * a4 + v * b4 + w * c4)
    x[P_QB + 4], x[P_QB + 5] = x[P_QB + 4] - (u * a5 + v * b5 + w * c5), x[P_QB + 5] - (u * a6 + v * b6 + w * c6)
    u, v, w = da * a2, db * b2, dc * c2
    x[P_QQ + 7], x[P_QQ + 8] = x[P_QQ + 7] - (u * a2 + v * b2 + w * c2), x[P_QQ + 8] - (u * a3 + v * b3 + w * c3)
    x[P_QB + 6], x[P_QB + 7] = x[P_QB + 6] - (u * a4 + v * b4 + w * c4), x[P_QB + 7] - (u * a5 + v * b5 + w * c5)
    x[P_QB + 8] -= u * a6 + v * b6 + w * c6
    u, v, w = da * a3, db * b3, dc * c3
    x[P_QQ + 9], x[P_QB + 9] = x[P_QQ + 9] - (u * a3 + v * b3 + w * c3), x[P_QB + 9] - (u * a4 + v * b4 + w * c4)
    x[P_QB + 10], x[P_QB + 11] = x[P_QB + 10] - (u * a5 + v * b5 + w * c5), x[P_QB + 11] - (u * a6 + v * b6 + w * c6)
    u, v, w = da * a4, db * b4, dc * c4
    x[P_BB], x[P_BB + 1] = x[P_BB] - (u * a4 + v * b4 + w * c4), x[P_BB + 1] - (u * a5 + v * b5 + w * c5)
    x[P_BB + 2] -= u * a6 + v * b6 + w * c6
    u, v, w = da * a5, db * b5, dc * c5
    x[P_BB + 3], x[P_BB + 4] = x[P_BB + 3] - (u * a5 + v * b5 + w * c5), x[P_BB + 4] - (u * a6 + v * b6 + w * c6)
    u, v, w = da * a6, db * b6, dc * c6
    x[P_BB + 5] -= u * a6 + v * b6 + w * c6


@kernel
def hold_heading(x: Floats) -> None:
    """Halve the error of the heading, with all that depends on it, where its variance has reached the limit."""
    if x[P_QQ] + x[P_QQ + 4] + x[P_QQ + 7] + x[P_QQ + 9] < 0.25 * HEADING_LIMIT:
        return
    v0, v1, v2, v3 = -x[ABOUT + 3], -x[ABOUT + 2], x[ABOUT + 1], x[ABOUT]  # 2 ∂q/∂heading
    y0 = x[P_QQ] * v0 + x[P_QQ + 1] * v1 + x[P_QQ + 2] * v2 + x[P_QQ + 3] * v3
    y1 = x[P_QQ + 1] * v0 + x[P_QQ + 4] * v1 + x[P_QQ + 5] * v2 + x[P_QQ + 6] * v3
    y2 = x[P_QQ + 2] * v0 + x[P_QQ + 5] * v1 + x[P_QQ + 7] * v2 + x[P_QQ + 8] * v3
    y3 = x[P_QQ + 3] * v0 + x[P_QQ + 6] * v1 + x[P_QQ + 8] * v2 + x[P_QQ + 9] * v3
    var = v0 * y0 + v1 * y1 + v2 * y2 + v3 * y3
    if 4.0 * var < HEADING_LIMIT:
        return
    bx = 0.5 * (x[P_QB] * v0 + x[P_QB + 3] * v1 + x[P_QB + 6] * v2 + x[P_QB + 9] * v3)
    by = 0.5 * (x[P_QB + 1] * v0 + x[P_QB + 4] * v1 + x[P_QB + 7] * v2 + x[P_QB + 10] * v3)
    bz = 0.5 * (x[P_QB + 2] * v0 + x[P_QB + 5] * v1 + x[P_QB + 8] * v2 + x[P_QB + 11] * v3)
    # S P Sᵀ with S = 1 − ½ v vᵀ is P − v dᵀ − d vᵀ
    d0, d1, d2, d3 = (
        0.5 * y0 - 0.125 * var * v0,
        0.5 * y1 - 0.125 * var * v1,
        0.5 * y2 - 0.125 * var * v2,
        0.5 * y3 - 0.125 * var * v3,
    )
    x[P_QQ] -= 2.0 * v0 * d0
    x[P_QQ + 1] -= v0 * d1 + v1 * d0
    x[P_QQ + 2] -= v0 * d2 + v2 * d0
    x[P_QQ + 3] -= v0 * d3 + v3 * d0
    x[P_QQ + 4] -= 2.0 * v1 * d1
    x[P_QQ + 5] -= v1 * d2 + v2 * d1
    x[P_QQ + 6] -= v1 * d3 + v3 * d1
    x[P_QQ + 7] -= 2.0 * v2 * d2
    x[P_QQ + 8] -= v2 * d3 + v3 * d2
    x[P_QQ + 9] -= 2.0 * v3 * d3
    x[P_QB], x[P_QB + 1], x[P_QB + 2] = x[P_QB] - v0 * bx, x[P_QB + 1] - v0 * by, x[P_QB + 2] - v0 * bz
    x[P_QB + 3], x[P_QB + 4], x[P_QB + 5] = x[P_QB + 3] - v1 * bx, x[P_QB + 4] - v1 * by, x[P_QB + 5] - v1 * bz
    x[P_QB + 6], x[P_QB + 7], x[P_QB + 8] = x[P_QB + 6] - v2 * bx, x[P_QB + 7] - v2 * by, x[P_QB + 8] - v2 * bz
    x[P_QB + 9], x[P_QB + 10], x[P_QB + 11] = x[P_QB + 9] - v3 * bx, x[P_QB + 10] - v3 * by, x[P_QB + 11] - v3 * bz
