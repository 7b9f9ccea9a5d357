"""A footprint: one footfall on a plate, its picture, its axis and direction, its side, and what is doubtful about it.

Places are those of the array: x to the right, y downwards. A picture is taken as seen from above, on the screen with
its first row at the top: then the big toe of a left foot that points up is on the right.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

import taxel
from taxel import Frames, ProblemError
from taxel_gait.feet import load_of

__all__ = ["Placed", "Print", "place"]

#: The name of arrays of footfalls that were turned and resized, for a training.
BOX = "turned box"
Floats = NDArray[np.float64]

#: A cell belongs to a print above this share of the print's largest value, in a group of at least so many.
_SHARE, _GROUP = 0.01, 3
#: Where the widest places of heel and forefoot are looked for, shares of the length; how often, and how far at most the
#: foot's axis may be turned from the loaded cells' own, degrees.
_HEEL, _FOREFOOT, _ROUNDS, _TURN = (0.05, 0.30), (0.55, 0.80), 3, 25.0
#: A vote on the side counts at most so much, and below this sum the side is not known.
_VOTE, _UNDECIDED = 0.12, 0.01
#: Of a whole print: length over width; where the path of the centre is in the first and in the last twentieth of its
#: frames, shares of the length; and the width of what lies ahead of a share of the length, in widths of the forefoot.
_SLENDER, _BEGINS, _ENDS, _TIP, _TIP_WIDTH = (2.3, 3.6), (0.06, 0.20), (0.72, 0.97), 0.96, 0.72
#: No foot is longer or wider than this, mm: then there are two.
_LARGEST = (340.0, 150.0)


@dataclass(frozen=True, eq=False)
class Print:
    """Hold a footfall from its first loaded frame to its last.

    Parameters
    ----------
    frames : Frames
        Of the stance alone.
    above : float, in the frames' unit
        A cell with a greater value is loaded.
    """

    frames: Frames
    above: float

    @classmethod
    def of(cls, frames: Frames, above: float | None = None) -> Print:
        """Return the footfall in frames that hold one.

        Parameters
        ----------
        frames : Frames
            Of a grid whose pitch is known.
        above : float, in the frames' unit, optional
            Default: 1 % of the largest value.

        Raises
        ------
        ProblemError : no pitch; nothing loaded
        """
        if frames.array.name == BOX:
            raise ProblemError(
                "its cells are those of a foot that was turned and resized, whose values are no pressures"
            )
        if frames.array.pitch_mm is None:
            raise ProblemError(
                f"{frames.array!r}: the pitch is not known, so a footprint has no mm: give a layout file"
            )
        frames = frames.held()
        largest = float(frames.values.max(initial=0.0))
        least = _SHARE * largest if above is None else above
        there = np.flatnonzero((frames.values > least).any(axis=(1, 2)))
        if not len(there):
            raise ProblemError("nothing is loaded, so there is no footprint")
        return cls(frames[int(there[0]) : int(there[-1]) + 1], least)

    @cached_property
    def picture(self) -> Floats:
        """The largest value of each cell of the print, 0 elsewhere, shape (rows, columns)."""
        values = np.asarray(self.frames.maximum(), np.float64)
        # The few sensors of an insole have no neighbours.
        if self.frames.array.pitch_mm is None:
            return np.asarray(np.where(values > self.above, values, 0.0))
        groups, count = ndimage.label(values > self.above, np.ones((3, 3)))
        sizes = ndimage.sum_labels(np.ones_like(values), groups, np.arange(count + 1))
        return np.asarray(np.where((groups > 0) & (sizes[groups] >= _GROUP), values, 0.0))

    @cached_property
    def load(self) -> tuple[Floats, str]:
        """The load of each frame, and its unit: N where it is known."""
        return load_of(self.frames)

    @cached_property
    def t(self) -> Floats:
        """The times of the frames from the first one, s."""
        return np.asarray((self.frames.t - self.frames.t[0]) / 1e6)

    @cached_property
    def path(self) -> Floats:
        """The path of the centre of pressure (`Frames.centre_path`), mm."""
        return np.asarray(self.frames.centre_path())

    def times_at(self, share: float) -> tuple[float, float]:
        """Return when the load is first, and last, at a share of its largest, s from the first loaded frame."""
        force = self.load[0]
        there = self.t[force >= share * force.max()]
        return float(there[0]), float(there[-1])


@dataclass(frozen=True)
class Placed:
    """Say how a print lies on its array.

    Parameters
    ----------
    heel : (float, float), mm
        The point of the foot's axis at the heel's end.
    along : (float, float)
        The direction of the axis from heel to toes, of length 1.
    length, width : float, mm
        Of the loaded cells, along the axis and across it in the forefoot.
    side : {"left", "right", ""}
        "" if it could not be told.
    doubts : tuple of str
        What makes the print doubtful; a print with any is left out of means.
    """

    heel: tuple[float, float]
    along: tuple[float, float]
    length: float
    width: float
    side: str
    doubts: tuple[str, ...] = field(default=())

    @property
    def lateral(self) -> tuple[float, float]:
        """The direction from the medial to the lateral side; of an unknown side as of a right foot."""
        right = -self.along[1], self.along[0]
        return right if self.side != "left" else (-right[0], -right[1])

    def in_foot(self, points: Floats) -> Floats:
        """Return points of the array, shape (n, 2), as mm from medial to lateral and from heel to toes."""
        apart = points - np.array(self.heel)
        return np.stack([apart @ np.array(self.lateral), apart @ np.array(self.along)], axis=1)

    def on_array(self, points: Floats) -> Floats:
        """Return points of the foot (`in_foot`) on the array, mm."""
        return np.asarray(self.heel + points[:, :1] * np.array(self.lateral) + points[:, 1:] * np.array(self.along))


def place(one: Print, side: str = "") -> Placed:
    """Find the axis, the direction and the side of a print, and what is doubtful about it.

    Parameters
    ----------
    one : Print
    side : {"left", "right", ""}
        The foot, where it is known.

    Raises
    ------
    ProblemError : fewer than three loaded cells
    """
    array, loaded = one.frames.array, one.picture > 0
    first = taxel.axis(one.picture, array)
    centres = np.stack([place[loaded] for place in array.positions()], axis=1)
    half = np.array([array.column_mm, array.row_mm]) / 2
    corners = np.concatenate([centres + half * sign for sign in ((1, 1), (1, -1), (-1, 1), (-1, -1))])
    path, doubts = one.path[~np.isnan(one.path[:, 0])], list[str]()
    along = np.array([first.dx, first.dy])
    by_width = _is_wider_ahead(corners, along)
    fifth = max(len(path) // 5, 1)
    moved = float((path[-fifth:].mean(axis=0) - path[:fifth].mean(axis=0)) @ along) if len(path) > 1 else 0.0
    if moved and (moved > 0) is not by_width:
        doubts.append("the centre of pressure moves from the toes to the heel")
    along = along if by_width else -along
    along, middle = _foot_axis(corners, along)
    across = np.array([-along[1], along[0]])
    s, u = corners @ along, (corners - middle) @ across
    rear, length = float(s.min()), float(np.ptp(s))
    share = (s - rear) / length
    fore = (share > _FOREFOOT[0]) & (share < _FOREFOOT[1])
    width = float(np.ptp(u[fore])) if fore.any() else 0.0
    heel = middle + (rear - middle @ along) * along
    path_share, path_u = (path @ along - rear) / length, (path - middle) @ across
    if first.length > _LARGEST[0] or first.width > _LARGEST[1]:
        doubts.append("two feet at once")
    elif not width or not _SLENDER[0] < length / width < _SLENDER[1]:
        doubts.append(f"partial: length / width is {length / width if width else np.inf:.1f}")
    elif np.ptp(u[share > _TIP]) > _TIP_WIDTH * width:
        doubts.append("partial: the front end is as broad as a forefoot")
    elif len(path) > 1:
        few = max(len(path) // 20, 1)
        begin, end = path_share[:few].mean(), path_share[-few:].mean()
        if not (_BEGINS[0] < begin < _BEGINS[1] and _ENDS[0] < end < _ENDS[1]):
            doubts.append(f"partial: the path goes from {100 * begin:.0f} to {100 * end:.0f} % of the length")
    if not side and width:
        vote = _vote(share, u, path_u, width)
        side = "" if abs(vote) < _UNDECIDED else "left" if vote > 0 else "right"
        if not side:
            doubts.append("the side is not known: say --side")
    return Placed(
        (float(heel[0]), float(heel[1])), (float(along[0]), float(along[1])), length, width, side, tuple(doubts)
    )


def _is_wider_ahead(corners: Floats, along: Floats) -> bool:
    """Return whether the half ahead is wider than the third behind, and more so than the other way round."""
    across = np.array([-along[1], along[0]])
    s, u = corners @ along, corners @ across
    share = (s - s.min()) / np.ptp(s)

    def wider(ahead: NDArray[np.bool_], behind: NDArray[np.bool_]) -> float:
        return float(np.ptp(u[ahead]) - np.ptp(u[behind])) if ahead.any() and behind.any() else 0.0

    return wider(share > 0.5, share < 1 / 3) >= wider(share < 0.5, share > 2 / 3)


def _foot_axis(corners: Floats, along: Floats) -> tuple[Floats, Floats]:
    """Return the direction of the bisector of the medial and the lateral tangent, and a point of it."""
    first, middle = along, corners.mean(axis=0)
    for _ in range(_ROUNDS):
        across = np.array([-along[1], along[0]])
        s = corners @ along
        share = (s - s.min()) / np.ptp(s)
        bands = [corners[(share > low) & (share < high)] for low, high in (_HEEL, _FOREFOOT)]
        if not all(map(len, bands)):
            break
        ends = [[band[(sign * (band @ across)).argmax()] for band in bands] for sign in (1, -1)]
        lines = [(toe - heel) / np.hypot(*(toe - heel)) for heel, toe in ends]
        turned = lines[0] + lines[1]
        turned /= np.hypot(*turned)
        angle = np.degrees(np.arctan2(first[0] * turned[1] - first[1] * turned[0], first @ turned))
        limited = np.radians(np.clip(angle, -_TURN, _TURN))
        c, z = np.cos(limited), np.sin(limited)
        along = np.array([c * first[0] - z * first[1], z * first[0] + c * first[1]])
        # The middle between the tangents in the forefoot and in the heel.
        middle = np.mean([point for end in ends for point in end], axis=0)
    return along, middle


def _vote(share: Floats, u: Floats, path_u: Floats, width: float) -> float:
    """Return by how much the big toe's side is to the right of the axis: above 0 of a left foot."""
    fore = (share > _FOREFOOT[0]) & (share < _FOREFOOT[1])
    ahead = share > 0.85
    low, high = u[fore].min(), u[fore].max()
    votes = [0.5 * (u[ahead].mean() - (low + high) / 2) / width]
    front = share > 0.5
    thirds = [front & (u < low + (high - low) / 3), front & (u > high - (high - low) / 3)]
    if all(third.any() for third in thirds):
        votes.append(0.6 * (share[thirds[1]].max() - share[thirds[0]].max()))
    if len(path_u) > 9:
        pct = np.linspace(0, 1, len(path_u))
        drift = path_u[pct >= 0.9].mean() - path_u[(pct >= 0.4) & (pct <= 0.7)].mean()
        votes.append(0.5 * drift / width)
    return float(np.clip(votes, -_VOTE, _VOTE).sum())
