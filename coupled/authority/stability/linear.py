"""Linear theory of the rig: the poles of its loops, or the eigenvalues of its frame's exact map.

    loader    m·δc'' + c·δc' + (G_B + ΔG)·δc = F(t − τ)
    servo     x'' = ω²·(δc − x) − 2ζω·x';  without one x = δc
    grip      δ = x + K·F
    hand      F = −k_h·δ − c_h·δ' − k_I·∫δ dt

With a force independent of the grip (a free hand) the loader is stable while its spring G_B + ΔG is
positive, that is while K̂·G_T < 1. A hand closes a loop around loader, servo and structure, whose
stiffness is at most 1/K. τ is the loader's delay and one substep, in which hand and loader exchange
force and motion; it is approximated by its Padé fraction of second order.

    gauge     F_g = F − m_g·x''  through its amplifier, its delay, half a sample of its converter

A mass m_g between gauge and grip closes a loop of its own, also with a free hand. If it is fast
compared with the springs the loop is 1 + (m_g/m)·S(s)·A(s) = 0 with the servo S and the amplifier
A; with a first-order amplifier of lag τ it has a closed form, `mass_limit`.

The digital product ΔG·δc is held over a frame of T seconds, so the state follows

    z(t + T) = (exp(A·T) − ∫exp(A·s) ds·B·ΔG·C)·z(t),    δc = C·z

with eigenvalues λ and the growth ln|λ|/T. Without a basic gradient and with c/m = a the limit has a
closed form, `held_limit`; for small frames T < 2c/ΔG, since the product is half a frame late and
reduces the damping ratio by ω·T/4.

δ̂ = δc + K̂·F moves the surface only, and closes no loop but that of the aircraft.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from coupled.rig.equations import modifying_gradient
from coupled.rig.packing import Hand
from coupled.rig.parameters import Compensation, Control, Sensing
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
_TERMS = 18  # of the exponential's series, with a remainder of 1e-23 at a norm of a half
_COMPUTED, _RATE, _POSITION, _SPEED = range(4)
FOLLOWS_per_s = 1e4  # of a grip without a servo; far above any growth of interest


def added_gradient(control: Control) -> float:
    """Return ΔG as it acts on δc, N/d, at the first gradient of the schedule: eq. (12).

    It includes the scales of ΔF and of the δc that is multiplied: v₁, or the host's reading of it.
    """
    host = control.compensation
    bend = host.bend if host.gradient else 0.0
    total = control.schedule.total_gradient[0]
    asked = modifying_gradient(total, bend, control.assumed_basic_gradient)
    sensing = control.sensing
    hybrid = control.loader.multiplier == "hybrid"
    multiplied = sensing.computed_scale if hybrid else sensing.read_scale
    return asked * multiplied / sensing.modifying_scale


def poles_growth(matrices: Floats) -> Floats:
    """Return the largest real part of the eigenvalues of matrices, 1/s, shape (…, n, n)."""
    return np.asarray(np.max(np.linalg.eigvals(matrices).real, axis=-1))


def map_growth(maps: Floats, frame_s: Floats | float) -> Floats:
    """Return the growth of a frame's map, 1/s, for maps of shape (…, n, n)."""
    radius = np.max(np.abs(np.linalg.eigvals(maps)), axis=-1)
    return np.asarray(np.log(np.maximum(radius, 1e-300)) / frame_s)


def growth(rig: Rig, hand: Hand) -> float:
    """Return the growth of a linear rig's only control, 1/s, by its kind of multiplier."""
    (control,) = rig.controls.values()
    matrix = motion_matrix(rig, hand)
    if control.loader.multiplier == "hybrid":
        return float(poles_growth(matrix))
    return float(map_growth(frame_map(matrix, control, 1.0 / rig.frame_rate), 1.0 / rig.frame_rate))


def growths(cases: Sequence[tuple[Rig, Hand]]) -> list[float]:
    """Return the growths of linear rigs, 1/s; hybrid ones in one call, which is faster."""
    found = [next(iter(rig.controls.values())).loader.multiplier for rig, _ in cases]
    matrices = [motion_matrix(rig, hand) for rig, hand in cases if set(found) == {"hybrid"}]
    if not matrices or len({matrix.shape for matrix in matrices}) > 1:
        return [growth(rig, hand) for rig, hand in cases]
    rates: list[float] = poles_growth(np.stack(matrices)).tolist()
    return rates


def motion_matrix(rig: Rig, hand: Hand) -> Floats:
    """Return A of z' = A·z; its first states are δc, δc', x, x'.

    It includes a hybrid ΔG, but not a digital one.
    """
    (control,) = rig.controls.values()
    matrix = _with_servo(rig, control, hand)
    if control.loader.servo_frequency == 0.0:
        _follow(matrix)
    return matrix


def _follow(a: Floats) -> None:
    """Set x = δc in place of the servo, with a difference that starts at 0 and decays quickly."""
    a[_POSITION], a[_SPEED] = 0.0, a[_RATE]
    a[_POSITION, [_RATE, _COMPUTED, _POSITION]] = 1.0, FOLLOWS_per_s, -FOLLOWS_per_s
    a[_SPEED, [_RATE, _SPEED]] += FOLLOWS_per_s, -FOLLOWS_per_s


def _with_servo(rig: Rig, control: Control, hand: Hand) -> Floats:
    loader, width = control.loader, 4
    stiffness = loader.basic_gradient
    if loader.multiplier == "hybrid":
        stiffness += added_gradient(control)
    w = 2.0 * math.pi * loader.servo_frequency
    a = np.zeros((12, 12))
    a[_COMPUTED, _RATE] = a[_POSITION, _SPEED] = 1.0
    a[_RATE, :2] = -stiffness / loader.mass, -loader.damping / loader.mass
    a[_SPEED, [_COMPUTED, _POSITION, _SPEED]] = w * w, -w * w, -2.0 * loader.servo_damping_ratio * w
    a[_SPEED, _RATE] = 2.0 * loader.servo_damping_ratio * w * loader.servo_rate_share
    sensing, free = control.sensing, hand.stiffness == hand.damping == hand.integral == 0.0
    if free and sensing.gauge_mass == 0.0:
        return a[:4, :4].copy()
    force = np.zeros(len(a))
    if not free:
        width, force = _add_hand(a, hand, loader.bend)
    force -= sensing.gauge_mass * a[_SPEED]
    width, force = _add_amplifier(a, sensing, width, force)
    width, force = _add_lead(a, control.compensation, width, force)
    late_s = (
        loader.delay
        + loader.servo_delay
        + sensing.gauge_delay
        + 1.0 / (rig.frame_rate * rig.substeps)
    )
    if sensing.gauge_sampling > 0.0:
        late_s += 0.5 / sensing.gauge_sampling
    # e^(−τs) = 1 − (12/τ)·s/(s² + (6/τ)·s + 12/τ²)
    a[width, width + 1] = 1.0
    a[width + 1] = force
    a[width + 1, [width, width + 1]] -= 12.0 / late_s**2, 6.0 / late_s
    a[_RATE] += force / loader.mass
    a[_RATE, width + 1] -= 12.0 / late_s / loader.mass
    return a[: width + 2, : width + 2].copy()


def _add_hand(a: Floats, hand: Hand, bend: float) -> tuple[int, Floats]:
    """Add the hand's own states; return their new number, and F as a row of all, N."""
    width, force = 4, np.zeros(len(a))
    answer = np.zeros(len(a))
    answer[[_POSITION, _SPEED]] = -hand.stiffness, -hand.damping
    integral = width
    if hand.integral > 0.0:
        answer[integral] = 1.0
        width += 1
    give = 1.0 + bend * hand.stiffness
    if bend * hand.damping > 0.0:  # the hand damps the bend's own speed, so F has a lag
        a[width] = answer / (bend * hand.damping)
        a[width, width] = -give / (bend * hand.damping)
        force[width] = 1.0
        width += 1
    else:
        force = answer / give
    if hand.integral > 0.0:
        a[integral] = -hand.integral * bend * force
        a[integral, _POSITION] -= hand.integral
    return width, force


def _add_amplifier(a: Floats, sensing: Sensing, width: int, force: Floats) -> tuple[int, Floats]:
    """Add the gauge's amplifier behind a force; return the number of states, and its row."""
    if sensing.gauge_frequency == 0.0:
        return width, force
    w, passed = 2.0 * math.pi * sensing.gauge_frequency, np.zeros(len(a))
    passed[width] = 1.0
    if sensing.gauge_order == "first":
        a[width] = w * (force - passed)
        return width + 1, passed
    a[width, width + 1] = 1.0
    a[width + 1] = w * w * (force - passed)
    a[width + 1, width + 1] -= 2.0 * sensing.gauge_damping_ratio * w
    return width + 2, passed


def _add_lead(a: Floats, host: Compensation, width: int, force: Floats) -> tuple[int, Floats]:
    """Add the lead on the force, the first of its table; return the states and the force's row."""
    lead, lag = (host.force_lead or [0.0])[0], host.force_lead_lag
    if lead == 0.0:
        return width, force
    a[width] = force / lag
    a[width, width] -= 1.0 / lag
    return width + 1, force + lead * a[width]


def mass_limit(servo_rad_per_s: float, damping_ratio: float, lag_s: float) -> float:
    """Return the largest m_g/m of a free loader without spring and damping, by Routh.

    For τ·s³ + (1 + 2ζωτ)·s² + (2ζω + τω²)·s + ω²·(1 + m_g/m), with the servo's ω and ζ, and the
    lag τ of a first-order amplifier. Without lag any mass is stable.
    """
    w, z = servo_rad_per_s, damping_ratio
    if lag_s == 0.0:
        return math.inf
    return (1.0 + 2.0 * z * w * lag_s) * (2.0 * z * w + lag_s * w * w) / (lag_s * w * w) - 1.0


def frame_map(matrix: Floats, control: Control, frame_s: float) -> Floats:
    """Return the exact map of a frame over which the digital product is held."""
    n = len(matrix)
    grown = np.zeros((n + 1, n + 1))
    grown[:n, :n] = matrix
    grown[_RATE, n] = -added_gradient(control) / control.loader.mass
    if control.loader.servo_frequency == 0.0:
        grown[_SPEED, n] = grown[_RATE, n]
    over = exponential(grown * frame_s)
    found = over[:n, :n].copy()
    found[:, _COMPUTED] += over[:n, n]
    return np.asarray(found)


def exponential(matrix: Floats) -> Floats:
    """Return the exponential of a small matrix, by its series with scaling and squaring.

    SciPy's chooses its order by norms of powers, in threads that cost a hundred times as much as
    these few products of small matrices.
    """
    norm = float(np.max(np.sum(np.abs(matrix), axis=0)))
    halvings = max(0, math.ceil(math.log2(2.0 * norm))) if norm > 0.0 else 0
    small, one = matrix / 2.0**halvings, np.eye(len(matrix))
    found = one
    for term in range(_TERMS, 0, -1):
        found = one + small @ found / term
    for _ in range(halvings):
        found = found @ found
    return found


def held_limit(mass: float, damping: float, frame_s: float) -> float:
    """Return the largest ΔG in N/d with a product held over a frame, for G_B = 0.

    By Jury's criterion for the two eigenvalues, with a = c/m and e = exp(−a·T): a pair crosses the
    unit circle at ΔG = m·a²·(1 − e)/(1 − e − a·T·e), or one of them crosses −1 at
    2·m·a²·(1 + e)/(a·T·(1 + e) − 2·(1 − e)), whichever is smaller.
    """
    a = damping / mass
    turn, decay = a * frame_s, math.exp(-a * frame_s)
    pair = a * a * (1.0 - decay) / (1.0 - decay - turn * decay)
    flip = 2.0 * a * a * (1.0 + decay) / (turn * (1.0 + decay) - 2.0 * (1.0 - decay))
    return mass * min(pair, flip)
