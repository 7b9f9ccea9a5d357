"""Types of the panel's messages: what the client reads and asks.

Made from the structs of crates/taxel-panel by tools/messages.py (`make messages`): edit those.
"""

from __future__ import annotations

from typing import Any, Literal, NotRequired, TypedDict


class ArrayInfo(TypedDict):
    rows: int
    columns: int
    name: str


class FoundDetection(TypedDict):
    label: str
    t_us: int
    known_us: int


class Label(TypedDict):
    label: str
    t_us: int


class RecordedNote(TypedDict):
    t_us: int | None
    text: str


class HelloMessage(TypedDict):
    type: Literal["hello"]
    array: ArrayInfo | None


class RegistersMessage(TypedDict):
    type: Literal["registers"]
    values: dict[str, bool | int]


class DetectionMessage(TypedDict):
    type: Literal["detection"]
    label: str
    t_us: int
    known_us: int
    reported_us: int
    slope_mv_per_ms: float | None


class SpikesMessage(TypedDict):
    type: Literal["spikes"]
    encoder: str
    t_ms: list[float]
    train: list[int]
    value: list[float]
    left_out: int


class OpenedMessage(TypedDict):
    type: Literal["opened"]
    name: str
    array: ArrayInfo
    registers: dict[str, bool | int] | None
    notes: list[RecordedNote]
    detections: list[FoundDetection]


class TransportMessage(TypedDict):
    type: Literal["transport"]
    state: Literal["playing", "paused", "following"]


class LabelsMessage(TypedDict):
    type: Literal["labels"]
    labels: list[Label]


class DoneMessage(TypedDict):
    type: Literal["done"]
    id: int | str


class RefusedMessage(TypedDict):
    type: Literal["refused"]
    id: int | str | None
    reason: str


class WarningMessage(TypedDict):
    type: Literal["warning"]
    text: str


class CreditRequest(TypedDict):
    type: Literal["credit"]
    id: NotRequired[int]
    n: int


class EncodeRequest(TypedDict):
    type: Literal["encode"]
    id: NotRequired[int]
    encoder: NotRequired[dict[str, Any] | None]


class OpenRequest(TypedDict):
    type: Literal["open"]
    id: NotRequired[int]
    name: str
    trial: NotRequired[str | None]


class OverviewRequest(TypedDict):
    type: Literal["overview"]
    id: NotRequired[int]


class PlayRequest(TypedDict):
    type: Literal["play"]
    id: NotRequired[int]
    speed: NotRequired[float | None]


Message = (
    HelloMessage
    | RegistersMessage
    | DetectionMessage
    | SpikesMessage
    | OpenedMessage
    | TransportMessage
    | LabelsMessage
    | DoneMessage
    | RefusedMessage
    | WarningMessage
)
Request = CreditRequest | EncodeRequest | OpenRequest | OverviewRequest | PlayRequest
