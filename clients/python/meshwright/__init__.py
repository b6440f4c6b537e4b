# SPDX-License-Identifier: Apache-2.0
"""Client of Meshwright: photographs with known cameras in, a triangle mesh out."""

from .client import Client
from .depth_map import DepthMap, read_depth_map, write_depth_map
from .errors import (
    FormatError,
    MeshwrightError,
    ProgramError,
    ReconstructionCancelled,
    ReconstructionFailed,
    ServiceError,
    UnreachableError,
    WaitTimeout,
)
from .ply import Ply, read_ply
from .program import run
from .reconstruction import Event, Reconstruction
from .surface import Surface, read_surface

__all__ = [
    "Client",
    "DepthMap",
    "Event",
    "FormatError",
    "MeshwrightError",
    "Ply",
    "ProgramError",
    "Reconstruction",
    "ReconstructionCancelled",
    "ReconstructionFailed",
    "ServiceError",
    "Surface",
    "UnreachableError",
    "WaitTimeout",
    "read_depth_map",
    "read_ply",
    "read_surface",
    "run",
    "write_depth_map",
]
