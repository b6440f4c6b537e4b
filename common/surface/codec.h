// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "common/surface/patch_lattice.h"
#include "common/surface/sparse_surface.h"

namespace meshwright {

// Bytes of a surface as it is kept in the BlobStore: magic, version, camera, runs of nodes that have a patch, their
// values little-endian, and a checksum over all of it (docs/formats/surface.md draws it). The same surface always gives
// the same bytes.
std::string EncodeSurface(const SparseSurface& surface);
std::string EncodeSurface(const PatchLattice& surface);

// DataLoss names what is wrong (magic, version, checksum, length) without trusting any byte. Never crashes.
absl::StatusOr<SparseSurface> DecodeSparseSurface(const std::string& bytes);
// The same, on its lattice.
absl::StatusOr<PatchLattice> DecodeSurface(const std::string& bytes);

}  // namespace meshwright
