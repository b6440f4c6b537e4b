# SPDX-License-Identifier: Apache-2.0
"""What can go wrong. All of them are MeshwrightError."""

from __future__ import annotations

from typing import Optional


class MeshwrightError(Exception):
    """The base of all errors of this package."""


class UnreachableError(MeshwrightError):
    """Nobody answers at the address, also after repeating."""


class ServiceError(MeshwrightError):
    """The coordinator says no.

    code: the name of the error as gRPC has it ("NOT_FOUND"); status: that of HTTP; field: the field of the request that is
    to blame, when there is one.
    """

    def __init__(self, detail: str, code: str, status: int, field: Optional[str] = None) -> None:
        super().__init__(detail)
        self.detail = detail
        self.code = code
        self.status = status
        self.field = field


class ReconstructionFailed(MeshwrightError):
    """The reconstruction ended without a mesh; the message says why."""


class ReconstructionCancelled(MeshwrightError):
    """Somebody cancelled the reconstruction."""


class WaitTimeout(MeshwrightError):
    """It was not over in time. The reconstruction goes on."""


class FormatError(MeshwrightError):
    """A file is not what it should be: names the field, its value and what was expected."""


class ProgramError(MeshwrightError):
    """The local program failed; the message is its own line. exit_code: 2 wrong use, 3 bad input, 1 everything else."""

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message)
        self.exit_code = exit_code
