"""Negative response codes of the module's diagnostics (ISO 14229-1, annex A.1)."""

from __future__ import annotations

from enum import IntEnum


class Nrc(IntEnum):
    """Why a request is refused, or only delayed."""

    SERVICE_NOT_SUPPORTED = 0x11
    SUBFUNCTION_NOT_SUPPORTED = 0x12
    INCORRECT_LENGTH = 0x13
    RESPONSE_TOO_LONG = 0x14
    BUSY_REPEAT_REQUEST = 0x21
    CONDITIONS_NOT_CORRECT = 0x22
    REQUEST_SEQUENCE_ERROR = 0x24
    REQUEST_OUT_OF_RANGE = 0x31
    SECURITY_ACCESS_DENIED = 0x33
    INVALID_KEY = 0x35
    EXCEEDED_NUMBER_OF_ATTEMPTS = 0x36
    REQUIRED_TIME_DELAY_NOT_EXPIRED = 0x37
    GENERAL_PROGRAMMING_FAILURE = 0x72
    RESPONSE_PENDING = 0x78
    SUBFUNCTION_NOT_SUPPORTED_IN_SESSION = 0x7E
    SERVICE_NOT_SUPPORTED_IN_SESSION = 0x7F


class NegativeResponse(Exception):  # noqa: N818  # ISO 14229-1 calls it a response
    """Raised by a service that refuses; `code` goes onto the wire."""

    def __init__(self, code: Nrc) -> None:
        super().__init__(f"negative response {code.name.lower()} ({code:02X}h)")
        self.code = code
