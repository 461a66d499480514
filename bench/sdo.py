"""SDO client on the tick: expedited transfers of one drive (CiA 301, 7.2.4), never blocking."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from bench.errors import RigFault
from protocols.canopen import (
    pack_sdo_download,
    pack_sdo_upload,
    sdo_request_id,
    sdo_response_id,
    unpack_sdo_response,
)
from protocols.errors import FrameError, SdoAbort
from protocols.sync import TICK_S

if TYPE_CHECKING:
    from canopen import ObjectDictionary
    from canopen.objectdictionary import ODVariable

    from bench.bus import BenchBus
    from protocols.frame import Frame

SDO_TIMEOUT_S: Final = 0.2
SDO_ATTEMPTS: Final = 3

_TIMEOUT_TICKS: Final = round(SDO_TIMEOUT_S / TICK_S)


class SdoClient:
    """Reads and writes the objects of one drive, one transfer at a time.

    `start_read` or `start_write`, then `advance` once a tick until it returns True.

    Parameters
    ----------
    bus : BenchBus
    node_id : int
    axis : str
        Name of the axis for errors.
    objects : canopen.ObjectDictionary
        From the drive's EDS; gives each object's data type.
    """

    def __init__(self, bus: BenchBus, node_id: int, axis: str, objects: ObjectDictionary) -> None:
        self.node_id = node_id
        self.axis = axis
        self._bus = bus
        self._objects = objects
        self._request: bytes | None = None
        self._variable: ODVariable | None = None
        self._answer: bytes | None = None
        self._sent_tick = 0
        self._attempts = 0
        bus.subscribe(sdo_response_id(node_id), self._on_response)

    def start_read(self, index: int, subindex: int = 0) -> None:
        """Ask for an object.

        Raises
        ------
        RigFault
            If the EDS does not know it.
        """
        self._variable = self._find(index, subindex)
        self._start(pack_sdo_upload(index, subindex))

    def start_write(self, index: int, subindex: int, value: int) -> None:
        """Write an object; raises `RigFault` if the EDS does not know it."""
        self._variable = variable = self._find(index, subindex)
        self._start(pack_sdo_download(index, subindex, variable.encode_raw(value)))

    def advance(self) -> bool:
        """Return whether the answer is there; repeat the request when it does not come.

        Raises
        ------
        RigFault
            If the drive refuses the object or does not answer `SDO_ATTEMPTS` times.
        """
        if self._answer is not None:
            return True
        if self._bus.tick_count - self._sent_tick >= _TIMEOUT_TICKS:
            self._send()
        return False

    @property
    def value(self) -> int:
        """Value of the object that was read last.

        Raises
        ------
        RigFault
            If the drive refused it or sent something else.
        """
        try:
            _, _, raw = unpack_sdo_response(self.node_id, self._answer or b"")
        except (SdoAbort, FrameError) as error:
            message = f"{self.axis} axis: {error}"
            raise RigFault(message, self.axis) from error
        if self._variable is None or not raw:
            return 0
        return int(self._variable.decode_raw(raw))

    def _find(self, index: int, subindex: int) -> ODVariable:
        variable = self._objects.get_variable(index, subindex)
        if variable is None:
            message = (
                f"{self.axis} axis: the EDS of drive {self.node_id} does not know object "
                f"{index:04X}h.{subindex:02X}h: take the EDS that belongs to the drive"
            )
            raise RigFault(message, self.axis)
        return variable

    def _start(self, request: bytes) -> None:
        self._request = request
        self._answer = None
        self._attempts = 0
        self._send()

    def _send(self) -> None:
        if self._attempts >= SDO_ATTEMPTS:
            message = (
                f"{self.axis} drive (node {self.node_id}) does not answer: "
                "check its supply, its node number and the wiring"
            )
            raise RigFault(message, self.axis)
        self._attempts += 1
        self._sent_tick = self._bus.tick_count
        self._bus.send(sdo_request_id(self.node_id), self._request or b"")

    def _on_response(self, frame: Frame) -> None:
        if self._request is not None and frame.data[1:4] == self._request[1:4]:
            self._answer = frame.data
